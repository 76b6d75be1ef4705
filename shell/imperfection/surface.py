"""An imperfect resonator for pictures: its departures exaggerated, its mode turned onto an axis, the axes themselves."""

from dataclasses import replace
from math import pi

import numpy as np

from shell.imperfection.field import Complex
from shell.imperfection.imperfect import Imperfection
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.scan.projection import Projector
from shell.surface import Surface

DEPARTURE = 0.5  # largest departure in a picture over the thickness of the wall
REACH = 1.15  # of the axes beyond the rim
SLACK = 1e-4  # share of the wall or of the meridian that rounding puts a point beyond its end


def turn_surface(surface: Surface, angle: float) -> Surface:
    """The surface with its mode turned about the axis, rad."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(surface, points=surface.points @ turn.T, displacement=surface.displacement @ turn.T)


def find_departures(
    resonator: Resonator, imperfection: Imperfection, x: Array, r: Array, z: Array
) -> dict[int, Complex]:
    """How far points of the section (position x, r, z) depart outwards and upwards by shapes: waves m to (2, points), m."""
    inner, outer = imperfection.faces()
    place = resonator.at(np.clip(x, 0.0, 1.0) * resonator.length)
    normal = resonator.outward * np.array((place.normal_r, place.normal_z))
    height = (r - place.r) * normal[0] + (z - place.z) * normal[1]
    through = np.clip(2 * height / place.thickness, -1.0, 1.0)
    tangent = np.array((place.tangent_r, place.tangent_z))
    found: dict[int, Complex] = {}
    edge = np.where(x > 1 - 1e-6, 1.0, 0.0)
    for field, way in (
        (inner, -(1 - through) / 2 * normal),
        (outer, (1 + through) / 2 * normal),
        (imperfection.rim, edge * tangent),  # at x = 1
    ):
        for m in field.orders:
            found[m] = found.get(m, 0j) + field.wave(m, x) * np.where(r > 0, way, 0.0)
    return found


def depart_points(points: Array, resonator: Resonator, imperfection: Imperfection) -> Array:
    """Move points (count, 3) of the perfect solid to their places in the imperfect one."""
    at = Projector(resonator).place(points)
    x = np.clip(at.position, 0.0, 1.0)
    on_shell = (abs(at.height) < at.thickness * (0.5 + SLACK)) & (abs(at.position - x) < SLACK)
    return np.asarray(points + _departures(resonator, imperfection, x, points) * on_shell[:, None])


def depart_surface(
    surface: Surface, resonator: Resonator, imperfection: Imperfection, exaggerated: bool = True
) -> tuple[Surface, float]:
    """The surface with the departures of its faces and rim, exaggerated to a visible size or as they are, and the factor."""
    moved = _departures(resonator, imperfection, surface.position, surface.points)
    largest = float(np.linalg.norm(moved, axis=1).max())
    if largest == 0:
        return surface, 0.0
    thinnest = float(resonator.at(np.clip(surface.position, 0.0, 1.0) * resonator.length).thickness.min())
    factor = DEPARTURE * thinnest / largest if exaggerated else 1.0
    return replace(surface, points=surface.points + factor * moved), factor


def _departures(resonator: Resonator, imperfection: Imperfection, position: Array, points: Array) -> Array:
    """How far points (count, 3) at positions of the meridian depart, (count, 3)."""
    theta, r = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    waves = find_departures(resonator, imperfection, position, r, points[:, 2])
    out, up = sum(((wave * np.exp(-1j * m * theta)).real for m, wave in waves.items()), np.zeros((2, len(r))))
    return np.stack([out * np.cos(theta), out * np.sin(theta), up], axis=1)


def draw_axes(surface: Surface, slow_axis: float) -> Array:
    """Lines across the rim, (2n, 2, 3): n through the antinodes of the slower mode, then n of the faster one."""
    n = surface.harmonic
    rim = surface.points[surface.position > 0.98] if np.any(surface.position > 0.98) else surface.points
    radius, z = REACH * float(np.hypot(rim[:, 0], rim[:, 1]).max()), float(rim[:, 2].mean())
    angles = np.concatenate([slow_axis + shift + np.arange(n) * pi / n for shift in (0.0, pi / (2 * n))])
    ends = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.stack([np.column_stack([sign * ends, np.full(2 * n, z)]) for sign in (-1, 1)], axis=1)
