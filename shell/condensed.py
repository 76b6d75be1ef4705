r"""Solid parts of a resonator (root, corner, clamped edge) condensed onto the unknowns of the shell that they hold.

The cells of a part are laid out once; another design has the same cells on its own curves, and the shell begins where
it began. Statically, or better at the frequency of the nominal mode μ_0, everything inside follows the shell's edges q:

    u = [1; Ψ] q,  (K_ii - μ_0 M_ii) Ψ = -(K_ib - μ_0 M_ib),   K_q = [1; Ψ]ᵀ K [1; Ψ],   M_q = [1; Ψ]ᵀ M [1; Ψ],

which leaves an error of the eigenvalue of the order ((μ - μ_0)/μ_part)², the part's own modes being far above.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from shell.assembly import Layout, lay_resonator, solid_group
from shell.blocks import Solid, Tie, mesh_solid
from shell.constraints import Index
from shell.eigen import Factor, Pattern, find_pattern
from shell.errors import FoldedCells, ShellError
from shell.kernel import Orders, lame
from shell.levels import Level
from shell.patches import Cell, Patch, Path, straight
from shell.quadrature import Array, gauss, legendre
from shell.resonator import MeridianPoints, Resonator
from shell.system import Pair, System

LEAST = (
    0.3  # length of the outermost cells over that of the same design laid out by itself, and the inverse of the most
)
OTHER_CELLS = "the cells of the solid parts change within the range of thickness: narrow it."


class UnfitSolids(ShellError):
    """The solid parts of some design of a family cannot be had from those of the others."""


@dataclass(frozen=True, eq=False)
class Part:
    """One solid part of the nominal layout.

    number : its place in the layout.
    cells : of each of its patches.
    ties : (chain, end) of the shell that it holds.
    ends : arc length (m) and segment of each.
    references : thickness that the unknowns of each refer to, m.
    columns : these unknowns among the shell's.
    """

    number: int
    cells: tuple[tuple[Cell, ...], ...]
    ties: tuple[tuple[int, int], ...]
    ends: tuple[tuple[float, int], ...]
    references: tuple[float, ...]
    columns: Index

    def reach(self, resonator: Resonator) -> list[tuple[float, float]]:
        """The pieces of the meridian (arc lengths) whose thickness shapes the part, without a joint inside."""
        if len(self.ends) == 2:
            first, last = self.ends[0][0], self.ends[1][0]
        elif self.ties[0][1] == 0:
            first, last = 0.0, self.ends[0][0]
        else:
            first, last = self.ends[0][0], resonator.length
        breaks = [first, *(s for s in resonator.joints if first < s < last), last]
        return list(pairwise(breaks))

    def condense(self, resonator: Resonator, layout: Layout, n: int, level: Level, nu: float, mu: float) -> Pair:
        """K per unit G and M per unit density of one design on the part's unknowns."""
        solid, _ = layout.solids[self.number]
        if len(solid.patches) != len(self.cells):
            raise UnfitSolids(OTHER_CELLS)
        patches = [replace(patch, cells=cells) for patch, cells in zip(solid.patches, self.cells, strict=True)]
        ties: list[Tie] = []
        width = sum(level.through) + 3
        for k, ((chain, side), (s, segment)) in enumerate(zip(self.ties, self.ends, strict=True)):
            own = layout.chains[chain].breaks[-side]
            place = resonator.at([s], segment)
            patches = [_stretch(patch, resonator.at([own], segment), place) for patch in patches]
            ties.append(Tie(place, level.through, tuple(range(k * width, (k + 1) * width))))
        system = _build(Solid(tuple(patches), solid.held, solid.position), tuple(ties), n, level)
        K, M = _condense(system, len(ties) * width, nu, mu)
        turn = np.zeros_like(K)
        for k, (tie, reference) in enumerate(zip(ties, self.references, strict=True)):
            block = slice(k * width, (k + 1) * width)
            turn[block, block] = _rescaled(level.through, float(tie.place.thickness[0]) / reference)
        return turn.T @ K @ turn, turn.T @ M @ turn


def find_parts(
    layout: Layout, orders: Orders, references: list[float], unknowns: Callable[[int, int], Index]
) -> tuple[Part, ...]:
    """The solid parts of a layout; `unknowns` gives the shell's unknowns at one end of a chain."""
    parts = []
    for number, (solid, ties) in enumerate(layout.solids):
        ends = tuple((layout.chains[c].breaks[-side], layout.chains[c].segments[-side]) for c, side in ties)
        cells = tuple(patch.cells for patch in solid.patches)
        columns = np.concatenate([unknowns(chain, side) for chain, side in ties])
        parts.append(Part(number, cells, ties, ends, tuple(references[chain] for chain, _ in ties), columns))
    return tuple(parts)


def condense_parts(
    parts: tuple[Part, ...], resonator: Resonator, n: int, level: Level, nu: float, mu: float
) -> list[Pair]:
    """K per unit G and M per unit density of every part of one design.

    Raises
    ------
    UnfitSolids
        When the design has other cells than the nominal one.
    """
    layout = lay_resonator(resonator, n, level)
    if len(layout.solids) != len(parts):
        raise UnfitSolids(OTHER_CELLS)
    return [part.condense(resonator, layout, n, level, nu, mu) for part in parts]


def _stretch(patch: Patch, own: MeridianPoints, place: MeridianPoints) -> Patch:
    """Let a patch that ends on the cross-section `own` end on `place` instead, its other sides prolonged or shortened."""
    for name, rails in (("top", ("left", "right")), ("right", ("bottom", "top"))):
        if _lies_on(getattr(patch, name), own):
            paths = [getattr(patch, rail) for rail in rails]
            ends = [_cut(path, place) for path in paths]
            longer = {rail: _prolonged(path, end) for rail, path, end in zip(rails, paths, ends, strict=True)}
            corners = [tuple(float(x[0]) for x in path(np.array([end]))) for path, end in zip(paths, ends, strict=True)]
            return replace(patch, **longer, **{name: straight(corners[0], corners[1])})  # type: ignore[arg-type]
    return patch


def _lies_on(side: Path, place: MeridianPoints) -> bool:
    r, z = side(np.array([0.0, 0.5, 1.0]))
    r, z, h = r - place.r[0], z - place.z[0], place.thickness[0]
    off = r * place.tangent_r[0] + z * place.tangent_z[0]
    across = r * place.normal_r[0] + z * place.normal_z[0]
    return bool(np.all(abs(off) < 1e-8 * h) and np.all(abs(across) < 0.5001 * h))


def _cut(path: Path, place: MeridianPoints) -> float:
    """Where a path, run beyond its end if need be, crosses the plane of a cross-section."""

    def off(x: float) -> float:
        r, z = path(np.array([x]))
        return float((r[0] - place.r[0]) * place.tangent_r[0] + (z[0] - place.z[0]) * place.tangent_z[0])

    if off(LEAST) * off(1 / LEAST) > 0:
        raise UnfitSolids(OTHER_CELLS)
    return float(brentq(off, LEAST, 1 / LEAST, xtol=1e-15, rtol=1e-14))


def _prolonged(path: Path, end: float) -> Path:
    return lambda x: path(end * x)


def _build(solid: Solid, ties: tuple[Tie, ...], n: int, level: Level) -> System:
    """A solid part alone: the unknowns of its ties first."""
    first = sum(len(tie.unknowns) for tie in ties)
    try:
        group, rows, size = solid_group(mesh_solid(solid, level.block), solid, ties, n, level.block, first)
    except FoldedCells as fault:
        raise UnfitSolids(OTHER_CELLS) from fault
    return System((group,), rows.matrix(size), 0, n, level)


def _condense(system: System, held: int, nu: float, mu: float) -> Pair:
    """Condense a system onto its first unknowns."""
    lam, G = (float(x) for x in lame(np.array(1.0), np.array(nu), False))
    one = np.ones((len(system.groups[0].unknowns), 1))
    dynamic, M = system.operators([lam / G * one], [one], [one], True, -mu / G)
    unknowns, size = system.pattern.unknowns, system.pattern.size
    load = np.zeros((size - held, held))
    inner: list[Array] = []
    for members, stiff in zip(unknowns, dynamic, strict=True):
        own, outer = np.flatnonzero(members >= held), np.flatnonzero(members < held)
        inner.append(stiff[own[:, None], own])
        load[(members[own] - held)[:, None], members[outer]] -= stiff[own[:, None], outer]
    pattern = find_pattern([members[members >= held] - held for members in unknowns], size - held)
    follow = np.vstack([np.eye(held), Factor(pattern, arrange(pattern, inner)).solve(load)])
    parts = [follow[members] for members in unknowns]
    inertia = follow.T @ (M @ follow)
    return np.sum([p.T @ k @ p for p, k in zip(parts, dynamic, strict=True)], axis=0) + mu / G * inertia, inertia


def arrange(pattern: Pattern, matrices: list[Array]) -> list[Array]:
    """Element matrices in the order that a pattern gave to their unknowns."""
    return [matrix[order[:, None], order] for matrix, order in zip(matrices, pattern.order, strict=True)]


def _rescaled(orders: Orders, stretch: float) -> Array:
    """From modes P_k(stretch η) of the thickness to modes P_j(η), for u, v, w."""
    eta, _ = gauss(max(orders) + 1)
    turn = np.linalg.solve(legendre(max(orders), eta).values, legendre(max(orders), stretch * eta).values)
    size = sum(orders) + 3
    full, first = np.zeros((size, size)), 0
    for order in orders:
        full[first : first + order + 1, first : first + order + 1] = turn[: order + 1, : order + 1]
        first += order + 1
    return full
