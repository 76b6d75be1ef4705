"""Deviations of a resonator from the designed body of revolution."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from math import sqrt

import numpy as np

from shell.imperfection.field import NOTHING, Field
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.system import System


@dataclass(frozen=True)
class PointMass:
    """A small mass (kg, negative: removed) at azimuth (rad), position 0 ... 1 (rim) and height -1 (inner) ... 1 (outer face)."""

    mass: float
    azimuth: float
    position: float = 1.0
    height: float = 0.0


@dataclass(frozen=True)
class Imperfection:
    """Small departures from the body of revolution; lengths in m, densities and moduli relative."""

    thickness: Field = NOTHING  # change of the wall, the middle surface kept
    outer: Field = NOTHING  # outer, inner: how far the outer and the inner face stand out of the material
    inner: Field = NOTHING
    # how far the middle surface stands out along its normal, the wall kept (a radius that varies around)
    offset: Field = NOTHING
    density: Field = NOTHING  # density, modulus: of ρ, and of E at constant ν
    modulus: Field = NOTHING
    # how far the edge of the rim stands out along the meridian; its value at position 1 counts
    rim: Field = NOTHING
    masses: tuple[PointMass, ...] = ()

    def __add__(self, other: "Imperfection") -> "Imperfection":
        """Both together."""
        joined = {name: getattr(self, name) + getattr(other, name) for name in FIELDS}
        return Imperfection(**joined, masses=self.masses + other.masses)

    def faces(self, fade: Callable[[Array], Array] | None = None) -> tuple[Field, Field]:
        """How far the inner and the outer face stand out of the material: thickness, faces and offset, times `fade` along the meridian."""
        half = self.thickness * 0.5
        inner, outer = half + self.inner + self.offset * -1.0, half + self.outer + self.offset
        return (inner, outer) if fade is None else (inner * fade, outer * fade)

    def faded(self, fade: Callable[[Array], Array] | None) -> "Imperfection":
        """The same with its shape given by the faces, which `fade` along the meridian."""
        inner, outer = self.faces(fade)
        return replace(self, thickness=NOTHING, offset=NOTHING, inner=inner, outer=outer)


def fade(resonator: Resonator, system: System) -> Callable[[Array], Array] | None:
    """Factor of the departures of the faces: 1, falling to 0 over √(h R) at a solid part or clamp, which keeps its shape; or None."""
    edges: list[tuple[float, int, float]] = []
    spans: list[tuple[float, float]] = []
    for chain in (group.chain for group in system.chains.values()):
        spans.append((chain.breaks[0] / resonator.length, chain.breaks[-1] / resonator.length))
        for s, inward, end in zip((chain.breaks[0], chain.breaks[-1]), (1, -1), chain.ends, strict=True):
            if end in ("tied", "clamped"):
                h = float(resonator.at([s], chain.segments[0 if inward > 0 else -1]).thickness[0])
                edges.append((s / resonator.length, inward, sqrt(h * resonator.size) / resonator.length))
    if not edges:
        return None

    def factor(position: Array) -> Array:
        found = np.zeros(np.shape(position))
        for one, two in spans:
            found[(position > one - 1e-9) & (position < two + 1e-9)] = 1.0
        for place, inward, width in edges:
            off = (position - place) * inward / width
            beside = abs(position - place) < width
            x = np.clip(off, 0.0, 1.0)
            found = np.where(beside, found * x**3 * (10 - 15 * x + 6 * x**2), found)
        return found

    return factor


FIELDS = tuple(one.name for one in fields(Imperfection) if one.name != "masses")
