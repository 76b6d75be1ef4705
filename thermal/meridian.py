"""Conduction along the meridian of a shell of revolution, from its stem to its rim.

    ρ c h ∂T/∂t = (1/r) ∂/∂s (k r h ∂T/∂s) − losses,  heat flowing through the section 2π r h,

by finite volumes: cells of constant temperature, joined by the exact resistance ∫ ds / (2π k r h) between their
middles. The cells are nodes of a network, so that every solver of networks solves the field as well.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thermal.errors import ThermalError
from thermal.network import Array, Capacity, Conductor, Node, Part, Radiator

Along = Callable[[Array], Array]
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(12)


@dataclass(frozen=True)
class MeridianCells:
    """A meridian cut into cells, with plain numbers for each."""

    edge: Array  # array (N + 1,), arc length, m, from the stem to the rim
    middle: Array  # array (N,), arc length, m
    area: Array  # array (N,), area of the middle surface, m²
    volume: Array  # array (N,), m³
    # array (N,), ∫ ds / (2π r h) from the middle before (the first: from the stem) to this one, 1/m
    shape_resistance: Array

    @property
    def count(self) -> int:
        """Number of cells."""
        return len(self.middle)


def cut_meridian(length: float, radius: Along, thickness: Along, count: int) -> MeridianCells:
    """Cut a meridian into `count` equal cells; radius and thickness (m) are functions of the arc length (m)."""
    if not (length > 0 and count >= 1):
        raise ThermalError("a meridian needs a positive length and at least one cell.")
    edge = np.linspace(0.0, length, count + 1)
    middle = (edge[1:] + edge[:-1]) / 2

    def section(s: Array) -> Array:
        area: Array = 2 * np.pi * radius(s) * thickness(s)
        if not (np.isfinite(area).all() and (area > 0).all()):
            raise ThermalError("radius and thickness must be positive all along; start it at the stem, not at the pole.")  # fmt: skip
        return area

    return MeridianCells(
        edge=edge,
        middle=middle,
        area=_integrate(lambda s: 2 * np.pi * radius(s), edge[:-1], edge[1:]),
        volume=_integrate(section, edge[:-1], edge[1:]),
        shape_resistance=_integrate(lambda s: 1 / section(s), np.concatenate([edge[:1], middle[:-1]]), middle),
    )


def cut_meridian_table(s: ArrayLike, radius: ArrayLike, thickness: ArrayLike, count: int) -> MeridianCells:
    """Cut a meridian given as a table of arc length (increasing from 0), radius and thickness (m)."""
    s, radius, thickness = (np.asarray(column, dtype=float) for column in (s, radius, thickness))
    if s.ndim != 1 or s.size < 2 or s[0] != 0 or not (np.diff(s) > 0).all():
        raise ThermalError("the arc length of a meridian must start at 0 and increase.")
    if s.shape != radius.shape or s.shape != thickness.shape:
        raise ThermalError("arc length, radius and thickness of a meridian need the same number of rows.")
    return cut_meridian(float(s[-1]), lambda x: np.interp(x, s, radius), lambda x: np.interp(x, s, thickness), count)


def lump(cells: MeridianCells) -> MeridianCells:
    """Make one cell of many, joined by ∫ m² ds / (2π r h), m(s) the share of the volume beyond s: the mean of even heating."""
    beyond = np.cumsum(cells.volume[::-1])[::-1] / cells.volume.sum()
    return MeridianCells(
        edge=cells.edge[[0, -1]],
        middle=cells.edge[[0, -1]].mean(keepdims=True),
        area=cells.area.sum(keepdims=True),
        volume=cells.volume.sum(keepdims=True),
        shape_resistance=np.array([beyond**2 @ cells.shape_resistance]),
    )


def describe_meridian(
    cells: MeridianCells, root: str, volumetric_capacity: Capacity, conductivity: float, root_resistance: float = 0.0,
    exchange: Mapping[str, float] | None = None,
) -> list[Part]:  # fmt: skip
    """Return the parts "shell-1" (joined to `root`) … "shell-N" (at the rim); `exchange` is the radiating area per middle surface, both faces, by what they face."""
    names = cell_names(cells.count)
    parts: list[Part] = [
        Node(name, scale(volumetric_capacity, float(volume))) for name, volume in zip(names, cells.volume, strict=True)
    ]
    resistance = cells.shape_resistance / conductivity
    resistance[0] += root_resistance
    ends = zip([root, *names[:-1]], names, resistance, strict=True)
    parts += [Conductor(one, other, 1 / float(R)) for one, other, R in ends]
    for faced, share in (exchange or {}).items():
        parts += [Radiator(name, faced, share * float(A)) for name, A in zip(names, cells.area, strict=True) if share]
    return parts


def cell_names(count: int) -> list[str]:
    """Names of the nodes of a meridian, from its root to its rim."""
    return [f"shell-{k + 1}" for k in range(count)]


def energy_weights(cells: MeridianCells, place: ArrayLike, share: ArrayLike) -> Array:
    """Give the places' contributions to d ln f/dT to the cells, Σ weights (T − T_ref) = δ ln f, linear between middles, even beyond."""
    place = np.asarray(place, dtype=float)
    hats = np.array([np.interp(place, cells.middle, unit) for unit in np.eye(cells.count)])
    return np.asarray(hats @ np.asarray(share, dtype=float))


def scale(value: Capacity, factor: float) -> Capacity:
    """Multiply a number, or a callable of temperature, by a factor."""
    if callable(value):
        return lambda temperature: factor * value(temperature)
    return factor * value


def _integrate(function: Along, start: Array, end: Array) -> Array:
    half = (end - start)[:, None] / 2
    s = start[:, None] + half * (POINTS + 1)
    return np.asarray((half * WEIGHTS * np.broadcast_to(function(s), s.shape)).sum(axis=1))
