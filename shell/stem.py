"""The stem below its root: a cylinder of columns and rows of cells from the end of the core to the clamp."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from shell.curves import Point
from shell.patches import Cell, Patch, Path, Planar, rings, straight, whole
from shell.quadrature import Array
from shell.resonator import Resonator, Stem

QUIET = 2.5  # stem lengths over its radius from which its clamp is not felt by n > 1


@dataclass(frozen=True)
class Base:
    """Where the core ends and the stem begins: a curve, and its parameters at the radii of the columns."""

    path: Callable[[Array], Planar]
    arcs: tuple[float, ...]


def find_base(resonator: Resonator, side: int, s: float, level: float, radii: tuple[float, ...]) -> Base:
    """The level of T1, or under an outer stem (`side` 1, T2 at the arc length s) the dome's face raised to T1."""
    if side < 0:
        return Base(lambda r: (r, np.full_like(r, level)), radii)
    face = resonator.surface(side, 0)
    arcs = tuple(arc_at_radius(face, r, (1 + 1e-6) * s) for r in radii)
    rise = level - point_on(face, arcs[0])[1]

    def raised(s: Array) -> Planar:
        r, z = face(s)
        return r, z + rise

    return Base(raised, arcs)


def columns_of(stem: Stem, h: float) -> list[float]:
    """Bounds of the columns of the stem, from its side to the axis, wider the further in."""
    inset = min(0.5 * stem.radius, 2 * h + stem.fillet)
    radii, step = [stem.radius, stem.radius - inset], 3 * inset
    while radii[-1] > 1.5 * step:
        radii.append(radii[-1] - step)
        step *= 3
    return [*radii, 0.0]


def lay_rows(radii: tuple[float, ...], base: Base, end: float, n: int) -> tuple[list[float], bool]:
    """Bounds of the rows of cells, 0 at the root and 1 at the clamp, and whether that is felt: n > 1 dies out as exp(-1.8 z/a) within `QUIET` radii."""
    length = min(abs(end - point_on(base.path, arc)[1]) for arc in (base.arcs[0], base.arcs[-1]))
    # cells grow from both ends; the first is as tall as the outer column is wide
    step = min(radii[0] - radii[1], 0.4 * length)
    low, high = [0.0], [length]
    is_felt = n < 2 or length <= QUIET * radii[0]
    if not is_felt:
        while low[-1] + 3.5 * step < length:
            low.append(low[-1] + step)
            step *= 2.5
    else:
        while high[-1] - low[-1] > 2.4 * step:
            low.append(low[-1] + step)
            high.append(high[-1] - step)
            step = min(2.5 * step, 1.5 * radii[0])
        middle = np.linspace(low[-1], high[-1], 1 + ceil((high[-1] - low[-1]) / (1.5 * step)))
        low += middle[1:-1].tolist()
    return [height / length for height in (*low, *high[::-1])], is_felt


def mesh_stem(
    base: Base, end: float, rows: list[float], steps: tuple[float, ...], sharp: tuple[Cell, ...]
) -> list[Patch]:
    """The stem from its root to the clamped end, in columns between the radii; `sharp` cells at the edge of a clamp that is felt."""
    patches = []
    for k, (one, two) in enumerate(pairwise(rows)):
        if k == len(rows) - 2 and sharp:  # as singular as a sharp corner
            side = _block(base, base.arcs[:2], (two, one), end, sharp)
        else:
            side = _block(base, base.arcs[:2], (one, two), end, rings(steps) if k == 0 else whole())
        patches += [side, *(_block(base, arcs, (one, two), end, whole()) for arcs in pairwise(base.arcs[1:]))]
    return patches


def _block(
    base: Base, arcs: tuple[float, ...], rows: tuple[float, float], end: float, cells: tuple[Cell, ...]
) -> Patch:
    """A patch between two columns and two rows, 0 at the base and 1 at the flat end."""

    def row(x: float) -> Path:
        def path(y: Array) -> Planar:
            r, z = base.path(arcs[0] + (arcs[1] - arcs[0]) * y)
            return r, (1 - x) * z + x * end

        return path

    bottom, top = row(rows[0]), row(rows[1])
    left, right = (straight(point_on(bottom, y), point_on(top, y)) for y in (0.0, 1.0))
    return Patch(bottom, top, left, right, cells, "stem")


def arc_at_radius(surface: Callable[[Array], Planar], r: float, s_most: float) -> float:
    """Arc length at which a surface is r away from the axis."""
    if r == 0:
        return 0.0
    return crossing(lambda s: surface(s)[0] - r, 0.0, s_most)


def crossing(value: Callable[[Array], Array], low: float, high: float) -> float:
    """Where a rising function vanishes, by intervals of 256 (importing scipy.optimize takes half of what a start and solve take)."""
    for _ in range(7):  # 256^7 = 2^56
        places = np.linspace(low, high, 257)
        k = max(int(np.searchsorted(value(places[1:-1]), 0.0)), 0)
        low, high = places[k], places[k + 1]
    return float((low + high) / 2)


def point_on(surface: Callable[[Array], Planar], s: float) -> Point:
    """Return the point of a surface at an arc length."""
    r, z = surface(np.array([s]))
    return float(r[0]), float(z[0])
