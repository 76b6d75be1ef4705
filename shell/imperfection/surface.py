"""An imperfect resonator for pictures: its departures exaggerated, its mode turned onto an axis, the axes themselves."""

from dataclasses import replace
from math import pi

import numpy as np

from shell.imperfection.field import Field
from shell.imperfection.imperfect import Imperfection
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.surface import Surface

DEPARTURE = 0.5  # largest departure in a picture over the thickness of the wall
REACH = 1.15  # of the axes beyond the rim


def turn_surface(surface: Surface, angle: float) -> Surface:
    """The surface with its mode turned about the axis, rad."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(surface, points=surface.points @ turn.T, displacement=surface.displacement @ turn.T)


def depart_surface(
    surface: Surface, resonator: Resonator, imperfection: Imperfection, exaggerated: bool = True
) -> tuple[Surface, float]:
    """The surface with the departures of its faces and rim, exaggerated to a visible size or as they are, and the factor.

    What is not a shape (density, modulus, masses) is not seen.
    """
    inner, outer = imperfection.faces()
    x = surface.position
    theta = np.arctan2(surface.points[:, 1], surface.points[:, 0])
    r = np.hypot(surface.points[:, 0], surface.points[:, 1])
    place = resonator.at(np.clip(x, 0.0, 1.0) * resonator.length)
    height = (r - place.r) * place.normal_r + (surface.points[:, 2] - place.z) * place.normal_z
    through = np.clip(2 * height / place.thickness, -1.0, 1.0)
    along_normal, along_tangent = np.zeros(len(x)), np.zeros(len(x))
    for field, share in ((inner, -(1 - through) / 2), (outer, (1 + through) / 2)):
        if field is not None:
            along_normal += share * _at(field, x, theta)
    if imperfection.rim is not None:
        along_tangent += np.where(x > 1 - 1e-6, _at(imperfection.rim, np.ones(len(x)), theta), 0.0)
    largest = float(np.max(np.hypot(along_normal, along_tangent)))
    if largest == 0:
        return surface, 0.0
    factor = DEPARTURE * float(place.thickness.min()) / largest if exaggerated else 1.0
    out = factor * (along_normal * place.normal_r + along_tangent * place.tangent_r)
    up = factor * (along_normal * place.normal_z + along_tangent * place.tangent_z)
    moved = np.stack([out * np.cos(theta), out * np.sin(theta), up], axis=1)
    return replace(surface, points=surface.points + np.where(r[:, None] > 0, moved, 0.0)), factor


def draw_axes(surface: Surface, slow_axis: float) -> Array:
    """Lines across the rim, (2n, 2, 3): n through the antinodes of the slower mode, then n of the faster one."""
    n = surface.harmonic
    rim = surface.points[surface.position > 0.98] if np.any(surface.position > 0.98) else surface.points
    radius, z = REACH * float(np.hypot(rim[:, 0], rim[:, 1]).max()), float(rim[:, 2].mean())
    angles = np.concatenate([slow_axis + shift + np.arange(n) * pi / n for shift in (0.0, pi / (2 * n))])
    ends = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.stack([np.column_stack([sign * ends, np.full(2 * n, z)]) for sign in (-1, 1)], axis=1)


def _at(field: Field, x: Array, theta: Array) -> Array:
    """Values of a field at places, position by position with its azimuth."""
    found = np.zeros(len(x))
    for m in field.orders:
        found += (field.wave(m, x) * np.exp(-1j * m * theta)).real
    return found
