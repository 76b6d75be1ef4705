"""Solid parts of the section: cells of patches become elements, tied to the shell where they meet it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from shell.cells import in_order
from shell.errors import ShellError
from shell.kernel import Orders
from shell.patches import Part, Patch
from shell.points import MeridianPoints
from shell.quadrature import Array, legendre, lobatto, nodal, values_to_hierarchic
from shell.sparse import Index, Rows


@dataclass(frozen=True, eq=False)
class Tie:
    """A cross-section of the shell that a solid part shares: the place and its unknowns (u, v, w modes in turn)."""

    place: MeridianPoints
    orders: Orders
    unknowns: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid part: its patches, what is held, and the meridian position (0 ... 1) whose material it has."""

    patches: tuple[Patch, ...]
    held: Callable[[float, float], bool]
    position: float


@dataclass(frozen=True, eq=False)
class Mesh:
    """Cells of a solid part with numbered corners and edges."""

    grid: Array  # r and z at the (p + 1)² Lobatto points, (2, cells, ξ, η)
    vertices: Index  # (cells, 4) numbers, order (ξ, η) = (-1, -1), (1, -1), (-1, 1), (1, 1)
    edges: Index  # (cells, 4) numbers, the sides η = -1, η = 1 (along ξ), ξ = -1, ξ = 1 (along η)
    reversed_: NDArray[np.bool_]  # (cells, 4), whether the cell runs along the edge against its own direction
    points: Array  # vertex coordinates; `pairs` : the two vertices of each edge, in its direction, (edges, 2)
    pairs: Index
    parts: tuple[Part, ...]

    def place(self, xi: Array, eta: Array, cells: slice | list[int] = slice(None)) -> Array:
        """R and z at ξ and η of some cells, (2, cells, ξ, η)."""
        along, across = (nodal(self.grid.shape[2] - 1, x).values for x in (xi, eta))
        return np.asarray(along @ self.grid[:, cells] @ across.T)

    def between(self, vertices: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The edges that have both of their vertices among these."""
        return np.asarray(vertices[self.pairs].all(axis=1))

    @property
    def outside(self) -> NDArray[np.bool_]:
        """The edges of one cell alone."""
        return np.asarray(np.bincount(self.edges.ravel()) == 1)


SIDES = ((0, 1), (2, 3), (0, 2), (1, 3))


@lru_cache(maxsize=12)  # the same for every harmonic
def mesh_solid(solid: Solid, degree: int) -> Mesh:
    """Place the cells, identify the corners that coincide and the edges between them."""
    nodes = lobatto(degree)
    xi, eta = (axis.ravel() for axis in np.meshgrid(nodes, nodes, indexing="ij"))
    placed = np.concatenate([np.array(patch.place_cells(xi, eta)) for patch in solid.patches], axis=1)
    grid = placed.reshape(2, -1, degree + 1, degree + 1)
    corners = np.stack([grid[:, :, 0, 0], grid[:, :, -1, 0], grid[:, :, 0, -1], grid[:, :, -1, -1]], axis=2)
    r, z = corners.reshape(2, -1)
    shortest = min(np.hypot(*(corners[:, :, a] - corners[:, :, b])).min() for a, b in SIDES)
    apart = abs(r[:, None] - r) + abs(z[:, None] - z) > 1e-3 * shortest
    kept, numbers = np.unique(np.argmin(apart, axis=1), return_inverse=True)
    vertices = numbers.reshape(-1, 4)
    first, last = vertices[:, SIDES].transpose(2, 0, 1)
    low, high = np.minimum(first, last), np.maximum(first, last)
    codes, edges = np.unique(low * len(kept) + high, return_inverse=True)
    pairs = np.stack(np.divmod(codes, len(kept)), axis=1)
    if np.bincount(edges.ravel()).max() > 2 or len(kept) - len(pairs) + len(vertices) != 1:  # Euler's count of a disc
        raise ShellError(f"the cells of the solid part at {100 * solid.position:.3g} % do not join edge to edge.")
    parts = tuple(patch.part for patch in solid.patches for _ in patch.cells)
    return Mesh(grid, vertices, edges.reshape(-1, 4), first > last, np.array([r, z])[:, kept], pairs, parts)


@dataclass(frozen=True, eq=False)
class Support:
    """What holds the vertices of a mesh: on the axis, held, or on the cross-section of a tie (η there, NaN elsewhere)."""

    on_axis: NDArray[np.bool_]
    held: NDArray[np.bool_]
    heights: tuple[Array, ...]

    @property
    def kinds(self) -> list[NDArray[np.bool_]]:
        """Axis, held, each tie: an edge belongs where both of its vertices do."""
        return [self.on_axis, self.held, *(np.isfinite(eta) for eta in self.heights)]


def find_boundary(mesh: Mesh, solid: Solid, ties: tuple[Tie, ...]) -> Support:
    """Classify the vertices of a solid part: on the axis, held, tied or free."""
    size = float(np.ptp(mesh.points, axis=1).max())
    held = np.array([solid.held(float(r), float(z)) for r, z in mesh.points.T])
    heights = []  # η in [-1, 1] of points on each cross-section, NaN elsewhere
    for place in (tie.place for tie in ties):
        r, z = mesh.points[0] - place.r[0], mesh.points[1] - place.z[0]
        off, h = r * place.tangent_r[0] + z * place.tangent_z[0], place.thickness[0]
        eta = 2 * (r * place.normal_r[0] + z * place.normal_z[0]) / h
        heights.append(np.where((abs(off) < 1e-8 * min(size, h)) & (abs(eta) < 1 + 1e-6), eta, np.nan))
    return Support(mesh.points[0] < 1e-9 * size, held, tuple(heights))


def number_functions(mesh: Mesh, degree: int) -> tuple[Index, Array, int]:
    """Numbers and signs (cells, functions) of the hierarchic functions: of vertices, edges (odd ones backwards: −), insides; and their count."""
    inside = degree - 1
    cells, vertices = len(mesh.vertices), mesh.points.shape[1]
    numbers = np.zeros((cells, degree + 1, degree + 1), dtype=np.intp)
    signs = np.ones(numbers.shape)
    numbers[:, :2, :2] = mesh.vertices.reshape(-1, 2, 2).transpose(0, 2, 1)
    run = vertices + inside * mesh.edges[..., None] + np.arange(inside)
    flip = np.where(mesh.reversed_[..., None], np.where(np.arange(2, degree + 1) % 2, -1.0, 1.0), 1.0)
    for values, of in ((numbers, run), (signs, flip)):
        values[:, 2:, :2] = of[:, :2].transpose(0, 2, 1)
        values[:, :2, 2:] = of[:, 2:]
    start = vertices + inside * len(mesh.pairs)
    numbers[:, 2:, 2:] = start + np.arange(cells * inside**2).reshape(cells, inside, inside)
    i, j = in_order(degree)
    return numbers[:, i, j], signs[:, i, j], start + cells * inside**2


def constrain(mesh: Mesh, boundary: Support, ties: tuple[Tie, ...], degree: int, n: int, start: int) -> Rows:
    """Constraints of vertices and edges: the axis, what is held, and what follows a cross-section of the shell."""
    inside = degree - 1
    count = mesh.points.shape[1]
    a, b = mesh.pairs.T
    at_vertices = start + np.arange(3 * count).reshape(count, 3, 1)
    at_edges = start + 3 * count + np.arange(3 * inside * len(a)).reshape(-1, inside, 3).transpose(0, 2, 1)
    rows = Rows()
    on_axis, held = boundary.on_axis, boundary.held
    for own, is_held, axial in ((at_vertices, held, on_axis), (at_edges, *map(mesh.between, (held, on_axis)))):
        rows.hold(own[is_held])
        hold_on_axis(rows, n, *np.moveaxis(own[axial & ~is_held], 1, 0))
    for tie, eta in zip(ties, boundary.heights, strict=True):
        there = np.isfinite(eta)
        _follow(rows, at_vertices[there], tie, legendre(max(tie.orders), eta[there]).values[:, None])
        along = there[a] & there[b]
        at = (eta[a] + eta[b])[along, None] / 2 + (eta[b] - eta[a])[along, None] / 2 * lobatto(degree)
        modes = legendre(max(tie.orders), at.ravel()).values.reshape(*at.shape, -1)
        _follow(rows, at_edges[along], tie, (values_to_hierarchic(degree) @ modes)[:, 2:])
    return rows


def open_edges(mesh: Mesh, boundary: Support) -> NDArray[np.bool_]:
    """The edges that are neither on the axis nor held nor tied."""
    return np.asarray(~np.any([mesh.between(where) for where in boundary.kinds], axis=0))


def surface_sides(mesh: Mesh, boundary: Support) -> tuple[tuple[int, int], ...]:
    """The sides (cell, side) that no other cell shares, that are not tied and do not lie on the axis."""
    free = mesh.outside & ~np.any([mesh.between(where) for where in (boundary.on_axis, *boundary.kinds[2:])], axis=0)
    return tuple(zip(*(index.tolist() for index in np.nonzero(free[mesh.edges])), strict=True))


def hold_on_axis(rows: Rows, n: int, radial: Index, around: Index, axial: Index, turn: float = -1.0) -> None:
    """Regularity on the axis: n = 0 only along it; n = 1 a translation, around = `turn` times radial; n > 1 nothing."""
    for one in {0: (radial, around), 1: (axial,)}.get(n, (radial, around, axial)):
        rows.hold(one)
    if n == 1:
        rows.follow(around, radial, np.full(radial.size, turn))


def _follow(rows: Rows, own: Index, tie: Tie, modes: Array) -> None:
    """Unknowns (places, component, function) that follow the cross-section's modes: along (t, θ, n) there, (r, θ, z) in the solid."""
    place = tie.place
    t_r, t_z, n_r, n_z = (float(x[0]) for x in (place.tangent_r, place.tangent_z, place.normal_r, place.normal_z))
    turn = np.array([[t_r, 0.0, n_r], [0.0, 1.0, 0.0], [t_z, 0.0, n_z]])
    first = 0
    rows.hold(own)
    for component, order in enumerate(tie.orders):
        masters = np.array(tie.unknowns[first : first + order + 1])
        factors = turn[:, component, None, None] * modes[:, None, :, : order + 1]
        followers, masters = np.broadcast_arrays(own[..., None], masters)
        used = abs(factors) > 1e-15
        rows.follow(followers[used], masters[used], factors[used])
        first += order + 1
