"""Solid parts of the section: cells of patches become elements, tied to the shell where they meet it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shell.kernel import Orders, StrainTable, block_table
from shell.meridian import MeridianPoints
from shell.patches import Cell, Part, Patch
from shell.quadrature import Array, gauss, hierarchic, interpolate_hierarchic, legendre, lobatto, nodal

Rows = dict[int, list[tuple[int, float]]]


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
    points : vertex coordinates; `pairs` : the two vertices of each edge, in its direction.
    """

    grid: Array
    vertices: np.ndarray
    edges: np.ndarray
    reversed_: np.ndarray
    points: Array
    pairs: list[tuple[int, int]]
    parts: tuple[Part, ...]


SIDES = ((0, 1), (2, 3), (0, 2), (1, 3))


def mesh_solid(solid: Solid, degree: int) -> Mesh:
    """Place the cells, identify the corners that coincide and the edges between them."""
    nodes = lobatto(degree)
    xi, eta = (axis.ravel() for axis in np.meshgrid(nodes, nodes, indexing="ij"))
    cells: list[tuple[Patch, Cell]] = [(patch, cell) for patch in solid.patches for cell in patch.cells]
    placed = np.array([patch.place_cell(cell, xi, eta) for patch, cell in cells])
    grid = placed.transpose(1, 0, 2).reshape(2, len(cells), degree + 1, degree + 1)
    corners = np.stack([grid[:, :, 0, 0], grid[:, :, -1, 0], grid[:, :, 0, -1], grid[:, :, -1, -1]], axis=2)
    flat = corners.reshape(2, -1)
    lengths = [np.hypot(*(corners[:, :, a] - corners[:, :, b])).min() for a, b in SIDES]
    apart = np.hypot(*(flat[:, :, None] - flat[:, None, :])) > 1e-3 * min(lengths)
    first = np.argmin(apart, axis=1)
    kept, numbers = np.unique(first, return_inverse=True)
    vertices = numbers.reshape(-1, 4)
    known: dict[tuple[int, int], int] = {}
    edges, against = np.zeros_like(vertices), np.zeros(vertices.shape, dtype=bool)
    for cell_number, corner_numbers in enumerate(vertices):
        for side, (a, b) in enumerate(SIDES):
            ends = int(corner_numbers[a]), int(corner_numbers[b])
            edges[cell_number, side] = known.setdefault((min(ends), max(ends)), len(known))
            against[cell_number, side] = ends[0] > ends[1]
    return Mesh(grid, vertices, edges, against, flat[:, kept], list(known), tuple(patch.part for patch, _ in cells))


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


def number_unknowns(mesh: Mesh, degree: int, start: int) -> tuple[np.ndarray, Array, int]:
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
    edge_start = start + 3 * mesh.points.shape[1]
    rows: Rows = {}
    size = float(np.ptp(mesh.points, axis=1).max())
    on_axis = mesh.points[0] < 1e-9 * size
    held = np.array([solid.held(float(r), float(z)) for r, z in mesh.points.T])
    across = [_thickness_coordinate(tie.place, mesh.points, size) for tie in ties]
    for vertex in range(mesh.points.shape[1]):
        own = [[start + 3 * vertex + c] for c in range(3)]
        if held[vertex]:
            rows.update({k[0]: [] for k in own})
        elif on_axis[vertex]:
            rows.update(_axis_rows(own, n))
        for tie, eta in zip(ties, across, strict=True):
            if np.isfinite(eta[vertex]):
                rows.update(_tied_rows(own, tie, legendre(max(tie.orders), eta[[vertex]]).values))
    for edge, (a, b) in enumerate(mesh.pairs):
        own = [[edge_start + 3 * inside * edge + c * inside + k for k in range(inside)] for c in range(3)]
        if held[a] and held[b]:
            rows.update({k: [] for component in own for k in component})
        elif on_axis[a] and on_axis[b]:
            rows.update(_axis_rows(own, n))
        for tie, eta in zip(ties, across, strict=True):
            if np.isfinite(eta[a]) and np.isfinite(eta[b]):
                at = (eta[a] + eta[b]) / 2 + (eta[b] - eta[a]) / 2 * lobatto(degree)
                modes = interpolate_hierarchic(degree, legendre(max(tie.orders), at).values)
                rows.update(_tied_rows(own, tie, modes[2:]))
    return rows


def surface_sides(mesh: Mesh, ties: tuple[Tie, ...]) -> tuple[tuple[int, int], ...]:
    """The sides (cell, side) that no other cell shares, that are not tied and do not lie on the axis."""
    size = float(np.ptp(mesh.points, axis=1).max())
    uses = np.bincount(mesh.edges.ravel())
    inside = [mesh.points[0] < 1e-9 * size]
    inside += [np.isfinite(_thickness_coordinate(tie.place, mesh.points, size)) for tie in ties]
    return tuple(
        (int(cell), int(side))
        for cell, side in zip(*np.nonzero(uses[mesh.edges] == 1), strict=True)
        if not any(where[a] and where[b] for where in inside for a, b in [mesh.pairs[mesh.edges[cell, side]]])
    )


def _thickness_coordinate(place: MeridianPoints, points: Array, size: float) -> Array:
    """η in [-1, 1] of points on a cross-section, NaN elsewhere."""
    r, z = points[0] - place.r[0], points[1] - place.z[0]
    off = r * place.tangent_r[0] + z * place.tangent_z[0]
    h = place.thickness[0]
    eta = 2 * (r * place.normal_r[0] + z * place.normal_z[0]) / h
    return np.where((abs(off) < 1e-8 * min(size, h)) & (abs(eta) < 1 + 1e-6), eta, np.nan)


def _axis_rows(own: list[list[int]], n: int) -> Rows:
    """Regularity on the axis in cylindrical components: n = 0 only along z; n = 1 a translation; n > 1 nothing."""
    radial, around, axial = own
    if n == 0:
        return {k: [] for k in (*radial, *around)}
    if n == 1:
        return {k: [] for k in axial} | {b: [(a, -1.0)] for a, b in zip(radial, around, strict=True)}
    return {k: [] for component in own for k in component}


def _tied_rows(own: list[list[int]], tie: Tie, modes: Array) -> Rows:
    """Unknowns (component, function) that follow the cross-section's modes, turned from (t, θ, n) to (r, θ, z)."""
    place = tie.place
    turn = np.zeros((3, 3))
    turn[0, 0], turn[0, 2] = place.tangent_r[0], place.normal_r[0]
    turn[1, 1] = 1.0
    turn[2, 0], turn[2, 2] = place.tangent_z[0], place.normal_z[0]
    rows: Rows = {}
    for c in range(3):
        for k, row in enumerate(modes):
            entries: list[tuple[int, float]] = []
            first = 0
            for component, order in enumerate(tie.orders):
                factors = turn[c, component] * row[: order + 1]
                entries += [(tie.unknowns[first + j], float(x)) for j, x in enumerate(factors) if abs(x) > 1e-15]
                first += order + 1
            rows[own[c][k]] = entries
    return rows
