"""Curved quadrilaterals of the (r, z) plane and how they are cut into cells, finer towards a corner."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from shell.quadrature import Array

Planar = tuple[Array, Array]
Path = Callable[[Array], Planar]
Part = Literal["shell", "root", "stem", "corner", "base"]
Cell = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]

SHRINK = 0.18  # size of one ring of cells around a sharp corner over the ring outside it


@dataclass(frozen=True)
class Patch:
    """A curved quadrilateral, its sides [0, 1] -> (r, z), and its cells: four points of the unit square, (-1, -1), (1, -1), (-1, 1), (1, 1)."""

    bottom: Path
    top: Path
    left: Path
    right: Path
    cells: tuple[Cell, ...]
    part: Part

    def place(self, x: Array, y: Array) -> Planar:
        """The transfinite (Coons) interpolation of the sides at points of the unit square."""
        # each side at its points and at its two ends
        ends = np.array([0.0, 1.0])
        low, high = (np.array(side(np.append(x, ends))) for side in (self.bottom, self.top))
        left, right = (np.array(side(y)) for side in (self.left, self.right))
        r, z = (
            (1 - y) * low[:, :-2]
            + y * high[:, :-2]
            + (1 - x) * left
            + x * right
            - (1 - x) * ((1 - y) * low[:, -2:-1] + y * high[:, -2:-1])
            - x * ((1 - y) * low[:, -1:] + y * high[:, -1:])
        )
        return r, z

    def place_cells(self, xi: Array, eta: Array) -> Planar:
        """Points of all cells at ξ, η in [-1, 1], (cells, points)."""
        weights = np.array([(1 - xi) * (1 - eta), (1 + xi) * (1 - eta), (1 - xi) * (1 + eta), (1 + xi) * (1 + eta)]) / 4
        x, y = np.moveaxis(np.array(self.cells), 2, 0) @ weights
        r, z = self.place(x.ravel(), y.ravel())
        return r.reshape(x.shape), z.reshape(x.shape)


def whole() -> tuple[Cell, ...]:
    """One cell."""
    return (((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)),)


def layers(steps: tuple[float, ...], cuts: tuple[float, ...] = (1.0,)) -> tuple[Cell, ...]:
    """Cells between the falling steps 1, ..., > 0 of x, and the last down to 0; `cuts` does the same for y."""
    return tuple(
        ((inner, low), (outer, low), (inner, high), (outer, high))
        for outer, inner in pairwise((*steps, 0.0))
        for high, low in pairwise((*cuts, 0.0))
    )


def rings(steps: tuple[float, ...]) -> tuple[Cell, ...]:
    """Rings of two cells around the corner (0, 0) between the falling steps, and one square at the corner; far sides stay whole."""
    last = steps[-1]
    cells: list[Cell] = [((0.0, 0.0), (last, 0.0), (0.0, last), (last, last))]
    for outer, inner in pairwise(steps):
        cells.append(((inner, 0.0), (outer, 0.0), (inner, inner), (outer, outer)))
        cells.append(((0.0, inner), (inner, inner), (0.0, outer), (outer, outer)))
    return tuple(cells)


def narrowed(cells: tuple[Cell, ...], width: float) -> tuple[Cell, ...]:
    """The cells pressed towards y = 0, and one of such a width beside the whole side y = 1."""
    stay = 1 - width
    pressed = [((a, stay * b), (c, stay * d), (e, stay * f), (g, stay * h)) for (a, b), (c, d), (e, f), (g, h) in cells]
    return (*pressed, ((0.0, 1 - width), (1.0, 1 - width), (0.0, 1.0), (1.0, 1.0)))


def shrinking(count: int, ratio: float = SHRINK) -> tuple[float, ...]:
    """The steps 1, q, q², ... of `count` rings."""
    return tuple(ratio**k for k in range(count + 1))


def straight(start: tuple[float, float], end: tuple[float, float]) -> Path:
    """The straight side from one point to another."""

    def path(x: Array) -> Planar:
        return start[0] + (end[0] - start[0]) * x, start[1] + (end[1] - start[1]) * x

    return path


def along(curve: Path, first: float, last: float) -> Path:
    """The part of a curve between two of its parameters."""
    return lambda x: curve(first + (last - first) * x)


def box(
    corner: tuple[float, float], opposite: tuple[float, float], cells: tuple[Cell, ...], part: Part = "root"
) -> Patch:
    """A rectangle."""
    (r0, z0), (r1, z1) = corner, opposite
    bottom, top = straight((r0, z0), (r1, z0)), straight((r0, z1), (r1, z1))
    return Patch(bottom, top, straight((r0, z0), (r0, z1)), straight((r1, z0), (r1, z1)), cells, part)


def circular(center: tuple[float, float], radius: float, first: float, last: float) -> Path:
    """A circular side, center + radius (cos ψ, sin ψ) for ψ from `first` to `last`."""

    def path(x: Array) -> Planar:
        psi = first + (last - first) * x
        return center[0] + radius * np.cos(psi), center[1] + radius * np.sin(psi)

    return path
