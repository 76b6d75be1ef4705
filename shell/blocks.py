"""Solid parts of the section: cells of patches become elements, tied to the shell where they meet it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shell.constraints import Index, Rows
from shell.kernel import Orders, StrainTable, block_table
from shell.patches import Part, Patch
from shell.quadrature import Array, gauss, hierarchic, interpolate_hierarchic, legendre, lobatto, nodal
from shell.resonator import MeridianPoints


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
    """Cells of a solid part with numbered corners and edges.

    grid : r and z at the (p + 1)² Lobatto points, (2, cells, ξ, η).
    vertices : (cells, 4) numbers, order (ξ, η) = (-1, -1), (1, -1), (-1, 1), (1, 1).
    edges : (cells, 4) numbers, the sides η = -1, η = 1 (along ξ), ξ = -1, ξ = 1 (along η).
    reversed_ : (cells, 4), whether the cell runs along the edge against its own direction.
    points : vertex coordinates; `pairs` : the two vertices of each edge, in its direction, (edges, 2).
    """

    grid: Array
    vertices: Index
    edges: Index
    reversed_: NDArray[np.bool_]
    points: Array
    pairs: Index
    parts: tuple[Part, ...]


SIDES = ((0, 1), (2, 3), (0, 2), (1, 3))


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
    parts = tuple(patch.part for patch in solid.patches for _ in patch.cells)
    return Mesh(grid, vertices, edges.reshape(-1, 4), first > last, np.array([r, z])[:, kept], pairs, parts)


def tabulate(mesh: Mesh, solid: Solid, degree: int, n: int) -> StrainTable:
    """Strain table of all cells, geometry interpolated at the Lobatto points."""
    points, weights = gauss(degree + 2)
    shape = nodal(degree, points)
    r, z = np.einsum("ia,gcab,jb->gcij", shape.values, mesh.grid, shape.values)
    by_xi = np.einsum("ia,gcab,jb->gcij", shape.slopes, mesh.grid, shape.values)
    by_eta = np.einsum("ia,gcab,jb->gcij", shape.values, mesh.grid, shape.slopes)
    jacobian = np.stack([by_xi, by_eta], axis=1)
    basis = hierarchic(degree, points)
    position = np.full(len(mesh.vertices), solid.position)
    return block_table((r, z), jacobian, np.outer(weights, weights), n, basis, basis, position)


def number_unknowns(mesh: Mesh, degree: int, start: int) -> tuple[Index, Array, int]:
    """Global numbers and signs (cells, size) of the hierarchic unknowns: vertices, edges, then insides.

    Unknowns of an element are ordered (ξ-function, component, η-function). An edge taken backwards changes the sign of
    its odd functions.
    """
    inside = degree - 1
    edge_start = start + 3 * mesh.points.shape[1]
    inner_start = edge_start + 3 * inside * len(mesh.pairs)
    cells = len(mesh.vertices)
    numbers = np.zeros((cells, degree + 1, 3, degree + 1), dtype=np.intp)
    signs = np.ones(numbers.shape)
    parity = np.where(np.arange(2, degree + 1) % 2, -1.0, 1.0)
    along = np.arange(inside)
    for c in range(3):
        for corner, (a, b) in enumerate(((0, 0), (1, 0), (0, 1), (1, 1))):
            numbers[:, a, c, b] = start + 3 * mesh.vertices[:, corner] + c
        for side in range(4):
            run = edge_start + 3 * inside * mesh.edges[:, side, None] + c * inside + along
            flip = np.where(mesh.reversed_[:, side, None], parity, 1.0)
            where = (slice(None), slice(2, None), c, side) if side < 2 else (slice(None), side - 2, c, slice(2, None))
            numbers[where], signs[where] = run, flip
    inner = np.arange(3 * inside**2).reshape(inside, 3, inside)
    numbers[:, 2:, :, 2:] = inner_start + 3 * inside**2 * np.arange(cells)[:, None, None, None] + inner
    end = inner_start + 3 * inside**2 * cells
    return numbers.reshape(cells, -1), signs.reshape(cells, -1), end


def constrain(mesh: Mesh, solid: Solid, ties: tuple[Tie, ...], degree: int, n: int, start: int) -> Rows:
    """Constraints of vertices and edges: the axis, what is held, and what follows a cross-section of the shell."""
    inside = degree - 1
    count = mesh.points.shape[1]
    a, b = mesh.pairs.T
    size = float(np.ptp(mesh.points, axis=1).max())
    on_axis = mesh.points[0] < 1e-9 * size
    held = np.array([solid.held(float(r), float(z)) for r, z in mesh.points.T])
    at_vertices = start + np.arange(3 * count).reshape(count, 3, 1)
    at_edges = start + 3 * count + np.arange(3 * inside * len(a)).reshape(-1, 3, inside)
    rows = Rows()
    for own, is_held, axial in (
        (at_vertices, held, on_axis),
        (at_edges, held[a] & held[b], on_axis[a] & on_axis[b]),
    ):
        rows.hold(own[is_held])
        _regular_on_axis(rows, own[axial & ~is_held], n)
    for tie in ties:
        eta = _thickness_coordinate(tie.place, mesh.points, size)
        there = np.isfinite(eta)
        _follow(rows, at_vertices[there], tie, legendre(max(tie.orders), eta[there]).values[:, None])
        along = there[a] & there[b]
        at = (eta[a] + eta[b])[along, None] / 2 + (eta[b] - eta[a])[along, None] / 2 * lobatto(degree)
        modes = legendre(max(tie.orders), at.ravel()).values.reshape(*at.shape, -1)
        _follow(rows, at_edges[along], tie, interpolate_hierarchic(degree, modes)[:, 2:])
    return rows


def surface_sides(mesh: Mesh, ties: tuple[Tie, ...]) -> tuple[tuple[int, int], ...]:
    """The sides (cell, side) that no other cell shares, that are not tied and do not lie on the axis."""
    size = float(np.ptp(mesh.points, axis=1).max())
    a, b = mesh.pairs.T
    outside = np.bincount(mesh.edges.ravel()) == 1
    inside = [mesh.points[0] < 1e-9 * size]
    inside += [np.isfinite(_thickness_coordinate(tie.place, mesh.points, size)) for tie in ties]
    for where in inside:
        outside &= ~(where[a] & where[b])
    return tuple(zip(*(index.tolist() for index in np.nonzero(outside[mesh.edges])), strict=True))


def _thickness_coordinate(place: MeridianPoints, points: Array, size: float) -> Array:
    """η in [-1, 1] of points on a cross-section, NaN elsewhere."""
    r, z = points[0] - place.r[0], points[1] - place.z[0]
    off = r * place.tangent_r[0] + z * place.tangent_z[0]
    h = place.thickness[0]
    eta = 2 * (r * place.normal_r[0] + z * place.normal_z[0]) / h
    return np.where((abs(off) < 1e-8 * min(size, h)) & (abs(eta) < 1 + 1e-6), eta, np.nan)


def _regular_on_axis(rows: Rows, own: Index, n: int) -> None:
    """Regularity on the axis in cylindrical components: n = 0 only along z; n = 1 a translation; n > 1 nothing."""
    radial, around, axial = own[:, 0], own[:, 1], own[:, 2]
    if n == 0:
        rows.hold(radial)
        rows.hold(around)
    elif n == 1:
        rows.hold(axial)
        rows.follow(around.ravel(), radial.ravel(), np.full(radial.size, -1.0))
    else:
        rows.hold(own)


def _follow(rows: Rows, own: Index, tie: Tie, modes: Array) -> None:
    """Unknowns (places, component, function) that follow the cross-section's modes (places, function, order + 1).

    The cross-section moves along (t, θ, n), the solid along (r, θ, z).
    """
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
