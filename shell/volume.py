"""The solid as a conforming mesh of quadratic elements, for other finite-element programs.

The section is cut into quadrilaterals of nine nodes, which divide the solver's own elements: every cross-section of the
shell has the same number of layers, so that shell, roots and corners meet node on node. Turned around the axis they become
hexahedra, and wedges where a side lies on the axis. All nodes lie on the true surfaces; between them these are parabolas.

>>> mesh = build_volume(resonator, layers=2, around=48).serendipity()
"""

import io
import tempfile
from dataclasses import dataclass, replace
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from shell.assembly import build_system
from shell.blocks import Mesh, Support
from shell.errors import ShellError, mm
from shell.layout import Level
from shell.quadrature import Array, nodal
from shell.resonator import Resonator
from shell.sparse import Index

LEVEL = Level((3, 3, 3), 9, 8, 1)  # cells of degree 8 carry the shape of fillets; one ring around a sharp corner
# places (ξ, η, θ) on the lattice 0, 1, 2 of a turned quadrilateral, in the order that VTK and Abaqus share
HEXAHEDRON = "000 200 220 020 002 202 222 022 100 210 120 010 102 212 122 012 001 201 221 021 011 211 101 121 110 112 111"  # fmt: skip
WEDGE = "000 202 200 020 222 220 102 201 100 122 221 120 010 212 210 112 211 110"  # its side ξ = 0 lies on the axis


@dataclass(frozen=True, eq=False)
class Volume:
    """A mesh of quadratic elements."""

    nodes: Array  # (N, 3) array, m, places; the axis of the resonator is z
    hexahedra: Index  # (H, 27 or 20) array, node numbers in VTK's order: corners, edges, then faces and middle
    wedges: Index  # (W, 18 or 15) array, the same for the elements on the axis
    # (Q, 9 or 8), (T, 6) arrays, faces that the support holds: corners, edges, middle
    held_quadrilaterals: Index
    held_triangles: Index

    @property
    def held(self) -> Index:
        """Numbers of the held nodes."""
        return np.unique(np.concatenate([self.held_quadrilaterals.ravel(), self.held_triangles.ravel()]))

    def serendipity(self) -> "Volume":
        """The same elements with nodes on corners and edges only: 20 and 15."""
        hexahedra, wedges, faces = self.hexahedra[:, :20], self.wedges[:, :15], self.held_quadrilaterals[:, :8]
        kept, numbers = np.unique(np.concatenate([hexahedra.ravel(), wedges.ravel()]), return_inverse=True)
        cut = hexahedra.size
        return replace(
            self, nodes=self.nodes[kept], hexahedra=numbers[:cut].reshape(hexahedra.shape),
            wedges=numbers[cut:].reshape(wedges.shape), held_quadrilaterals=np.searchsorted(kept, faces),
            held_triangles=np.searchsorted(kept, self.held_triangles),
        )  # fmt: skip


LAYERS, AROUND, MOST_ALONG = (1, 16), (8, 720), 2000  # fewest and most elements of a mesh


@dataclass(frozen=True, eq=False)
class Pieces:
    """The section in quadrilaterals of 3 x 3 nodes: points (2, N), numbers (Q, 3, 3), and whether a node's side is held."""

    points: Array
    quadrilaterals: Index
    held: NDArray[np.bool_]


def build_volume(resonator: Resonator, layers: int = 2, around: int = 48, spacing: float | None = None) -> Volume:
    """Mesh a resonator with complete quadratic elements, at most `spacing` (m), or R/6, long along the meridian."""
    if not (LAYERS[0] <= layers <= LAYERS[1] and AROUND[0] <= around <= AROUND[1]):
        raise ShellError(
            "a mesh has {} to {} elements through the thickness and {} to {} around.".format(*LAYERS, *AROUND)
        )
    spacing = resonator.size / 6 if spacing is None else spacing
    if not resonator.length / MOST_ALONG <= spacing < np.inf:
        raise ShellError(f"the spacing along the meridian must be at least {mm(resonator.length / MOST_ALONG)}.")
    return _turn(_cut_section(resonator, layers, spacing), around, resonator.size)


def _cut_section(resonator: Resonator, layers: int, spacing: float) -> Pieces:
    system = build_system(resonator, 2, LEVEL)
    solids = [*system.solids.values()]
    # how many cells of each lie on the cross-section that it shares with the shell
    crossing = [max((np.isfinite(eta).sum() - 1 for eta in place.boundary.heights), default=1) for place in solids]
    common = int(np.lcm.reduce(crossing)) if crossing else 1
    layers = common * int(np.ceil(layers / common))
    grids: list[Array] = []  # (2, 2a + 1, 2b + 1) points of elements divided into a x b
    held: list[NDArray[np.bool_]] = []
    eta = np.linspace(-1.0, 1.0, 2 * layers + 1)
    for chain in (group.chain for group in system.chains.values()):
        for (start, stop), segment in zip(pairwise(chain.breaks), chain.segments, strict=True):
            count = int(np.ceil((stop - start) / spacing - 1e-9))
            place = resonator.at(np.linspace(start, stop, 2 * count + 1), segment)
            grids.append(np.array(place.at_heights(eta)))
            held.append(np.zeros(grids[-1].shape[1:], dtype=bool))
    for solid, count in zip(solids, crossing, strict=True):
        _divide_cells(solid.mesh, solid.boundary, layers // count, grids, held)
    return _join(grids, held)


def _divide_cells(mesh: Mesh, boundary: Support, count: int, grids: list[Array], held: list[NDArray[np.bool_]]) -> None:
    along = nodal(mesh.grid.shape[2] - 1, np.linspace(-1.0, 1.0, 2 * count + 1)).values
    fixed = mesh.outside & mesh.between(boundary.held)
    grids.extend(np.einsum("ia,gcab,jb->cgij", along, mesh.grid, along))
    marks = np.zeros((len(mesh.edges), len(along), len(along)), dtype=bool)
    for edge, side in enumerate((np.s_[:, :, 0], np.s_[:, :, -1], np.s_[:, 0], np.s_[:, -1])):
        marks[side] |= fixed[mesh.edges[:, edge], None]
    held.extend(marks)


def _join(grids: list[Array], held: list[NDArray[np.bool_]]) -> Pieces:
    """Number the points that coincide once, and cut every grid into 3 x 3 nodes."""
    points = np.concatenate([grid.reshape(2, -1) for grid in grids], axis=1)
    shortest = min(min(np.hypot(*np.diff(grid, axis=axis)).min() for axis in (1, 2)) for grid in grids)
    pairs = scipy.spatial.cKDTree(points.T).query_pairs(1e-3 * shortest, output_type="ndarray")
    size = points.shape[1]
    links = scipy.sparse.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    count, numbers = scipy.sparse.csgraph.connected_components(links, directed=False)
    first = np.zeros(count, dtype=np.intp)
    first[numbers[::-1]] = np.arange(size)[::-1]
    marks = np.zeros(count, dtype=bool)
    np.logical_or.at(marks, numbers, np.concatenate([one.ravel() for one in held]))
    pieces, start = [], 0
    for grid in grids:
        own = numbers[start : (start := start + grid[0].size)].reshape(grid.shape[1:])
        pieces.append(np.lib.stride_tricks.sliding_window_view(own, (3, 3))[::2, ::2].reshape(-1, 3, 3))
    return Pieces(points[:, first], np.concatenate(pieces), marks)


def _turn(section: Pieces, around: int, size: float) -> Volume:
    r, z = section.points
    on_axis: NDArray[np.bool_] = np.asarray(r < 1e-7 * size)
    r = np.where(on_axis, 0.0, r)
    # (ξ, η, θ) is a right-handed frame: clockwise with r to the right and z up
    corners = section.quadrilaterals[:, [0, 2, 2, 0], [0, 0, 2, 2]]
    area = np.sum(r[corners] * np.roll(z[corners], -1, axis=1) - np.roll(r[corners], -1, axis=1) * z[corners], axis=1)
    quads = np.where((area > 0)[:, None, None], section.quadrilaterals[:, ::-1], section.quadrilaterals)
    inner = on_axis[quads]
    axial: NDArray[np.bool_] = np.all(_sides(inner), axis=2)  # (side, quadrilateral)
    touching = inner.any(axis=(1, 2))
    if np.any(axial.sum(axis=0) != touching):
        raise ShellError("an element touches the axis at a corner instead of along a side.")
    widths = np.where(on_axis, 1, 2 * around)
    first = np.cumsum(widths) - widths
    theta = pi * np.arange(2 * around) / around
    spin = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    spin[abs(spin) < 1e-15] = 0.0
    # a point of the axis stays one node
    rings = [np.column_stack([r[k] * spin[: widths[k]], np.full(widths[k], z[k])]) for k in range(len(r))]
    # turned in their sense until the side on the axis is ξ = 0
    turns = np.array([3, 1, 0, 2])[np.argmax(axial, axis=0)[touching]]
    wedges = np.array([np.rot90(quad, turn) for quad, turn in zip(quads[touching], turns, strict=True)], dtype=np.intp)
    edges = _held_edges(section, quads, on_axis)
    off = ~np.any(on_axis[edges], axis=1)

    def elements(pieces: Index, order: str) -> Index:
        """Elements (pieces x around, nodes) from numbers (pieces, ξ, η) of the section, in an order of places (ξ, η, θ)."""
        i, j, k = np.array([[int(digit) for digit in place] for place in order.split()]).T
        points = pieces[:, i, j]  # (pieces, nodes)
        angle = (2 * np.arange(around)[:, None] + k) % (2 * around)  # (around, nodes)
        numbers = first[points][:, None, :] + np.where(on_axis[points][:, None, :], 0, angle)
        return np.asarray(numbers.reshape(-1, len(i)))

    return Volume(
        np.concatenate(rings),
        elements(quads[~touching], HEXAHEDRON),
        elements(wedges.reshape(-1, 3, 3), WEDGE),
        elements(edges[off][:, :, None], "000 002 202 200 001 102 201 100 101"),
        elements(edges[~off][:, :, None], "000 202 200 102 201 100"),
    )


def _sides(pieces: NDArray[Any]) -> NDArray[Any]:
    """The sides η = -1, η = 1, ξ = -1, ξ = 1 of pieces (Q, 3, 3): (4, Q, 3)."""
    return np.stack([pieces[:, :, 0], pieces[:, :, 2], pieces[:, 0, :], pieces[:, 2, :]])


def _held_edges(section: Pieces, quads: Index, on_axis: NDArray[np.bool_]) -> Index:
    """The held edges (E, 3) of the section's outline; one that meets the axis begins there."""
    edges = _sides(quads).reshape(-1, 3)
    ends = np.sort(edges[:, [0, 2]], axis=1)
    _, which, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    found = edges[(count[which.ravel()] == 1) & section.held[edges].all(axis=1) & ~on_axis[edges].all(axis=1)]
    return np.asarray(np.where(on_axis[found[:, 2]][:, None], found[:, ::-1], found))


VolumeKind = Literal["vtu", "msh", "inp"]

VTK_TYPES = {27: 29, 20: 25, 18: 32, 15: 26}
GMSH_TYPES = {27: 12, 20: 17, 18: 13, 15: 18, 9: 10, 8: 16, 6: 9}
# Gmsh numbers edges and faces otherwise than VTK: its node k is VTK's node ORDER[k]
GMSH_HEXAHEDRON = (*range(8), 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14, 24, 22, 20, 21, 23, 25, 26)
GMSH_WEDGE = (*range(6), 6, 8, 12, 7, 13, 14, 9, 11, 10, 15, 17, 16)
GMSH_ORDERS = {27: GMSH_HEXAHEDRON, 20: GMSH_HEXAHEDRON[:20], 18: GMSH_WEDGE, 15: GMSH_WEDGE[:15]}
ABAQUS_TYPES = {20: "C3D20", 15: "C3D15"}
ABAQUS_LINE = 16  # entries of a line at most


def encode_volume(mesh: Volume, kind: VolumeKind) -> bytes:
    """Return the bytes of a mesh file, in metres, with "held" and "resonator" as sets."""
    return {"vtu": _encode_vtu, "msh": _encode_msh, "inp": _encode_inp}[kind](mesh)


def _encode_vtu(mesh: Volume) -> bytes:
    import pyvista

    blocks = {VTK_TYPES[cells.shape[1]]: cells for cells in (mesh.hexahedra, mesh.wedges) if len(cells)}
    grid = pyvista.UnstructuredGrid(blocks, mesh.nodes)
    held = np.zeros(len(mesh.nodes), dtype=np.uint8)
    held[mesh.held] = 1
    grid.point_data["held"] = held
    with tempfile.TemporaryDirectory() as folder:
        grid.save(path := Path(folder, "mesh.vtu"))
        return path.read_bytes()


def _encode_msh(mesh: Volume) -> bytes:
    """Gmsh's format 2.2, which every reader knows."""
    text = io.StringIO()
    text.write(
        '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n3 1 "resonator"\n2 2 "held"\n$EndPhysicalNames\n'
    )
    text.write(f"$Nodes\n{len(mesh.nodes)}\n")
    _write_nodes(text, mesh, " ")
    blocks = [(mesh.held_quadrilaterals, 2), (mesh.held_triangles, 2), (mesh.hexahedra, 1), (mesh.wedges, 1)]
    text.write(f"$EndNodes\n$Elements\n{sum(len(cells) for cells, _ in blocks)}\n")
    first = 1
    for cells, group in blocks:
        size = cells.shape[1]
        ordered = cells[:, GMSH_ORDERS.get(size, range(size))] + 1
        head = np.tile([0, GMSH_TYPES[size], 2, group, group], (len(cells), 1))
        head[:, 0] = np.arange(first, first + len(cells))
        np.savetxt(text, np.hstack([head, ordered]), "%d")
        first += len(cells)
    text.write("$EndElements\n")
    return text.getvalue().encode()


def _encode_inp(mesh: Volume) -> bytes:
    if mesh.hexahedra.shape[1] == 27:
        raise ShellError("an .inp file has elements of 20 and 15 nodes: leave out the centres of faces and elements.")
    text = io.StringIO()
    text.write("** lengths in m\n*NODE, NSET=ALL\n")
    _write_nodes(text, mesh, ", ")
    first = 1
    for cells in (mesh.hexahedra, mesh.wedges):
        if len(cells):
            text.write(f"*ELEMENT, TYPE={ABAQUS_TYPES[cells.shape[1]]}, ELSET=RESONATOR\n")
            for number, nodes in enumerate((cells + 1).tolist(), first):  # a line that goes on ends with a comma
                row = [str(number), *map(str, nodes)]
                lines = [", ".join(row[k : k + ABAQUS_LINE]) for k in range(0, len(row), ABAQUS_LINE)]
                text.write(",\n".join(lines) + "\n")
            first += len(cells)
    if len(mesh.held):
        text.write("*NSET, NSET=HELD\n")
        for start in range(0, len(mesh.held), ABAQUS_LINE):
            text.write(", ".join(str(k + 1) for k in mesh.held[start : start + ABAQUS_LINE]) + "\n")
    return text.getvalue().encode()


def _write_nodes(text: io.StringIO, mesh: Volume, between: str) -> None:
    """Thirteen digits: CalculiX reads twenty characters of a number and takes what is left of a longer one for the whole."""
    numbers = np.arange(1, len(mesh.nodes) + 1)
    np.savetxt(text, np.column_stack([numbers, mesh.nodes]), between.join(["%d", "%.13g", "%.13g", "%.13g"]))
