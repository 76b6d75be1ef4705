"""Mesh files, VTK (.vtu), Gmsh (.msh), Abaqus and CalculiX (.inp), in metres, with "held" and "resonator" as sets."""

import io
from typing import Literal

import numpy as np

from shell.errors import ShellError
from shell.volume import Volume

VolumeKind = Literal["vtu", "msh", "inp"]

VTK_TYPES = {27: 29, 20: 25, 18: 32, 15: 26}
GMSH_TYPES = {27: 12, 20: 17, 18: 13, 15: 18, 9: 10, 8: 16, 6: 9}
# Gmsh numbers edges and faces otherwise than VTK: its node k is VTK's node ORDER[k]
HEXAHEDRON = (*range(8), 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14, 24, 22, 20, 21, 23, 25, 26)
WEDGE = (*range(6), 6, 8, 12, 7, 13, 14, 9, 11, 10, 15, 17, 16)
GMSH_ORDERS = {27: HEXAHEDRON, 20: HEXAHEDRON[:20], 18: WEDGE, 15: WEDGE[:15]}
ABAQUS_TYPES = {20: "C3D20", 15: "C3D15"}
ABAQUS_LINE = 16  # entries of a line at most


def encode_volume(mesh: Volume, kind: VolumeKind) -> bytes:
    """Return the bytes of a mesh file."""
    return {"vtu": _encode_vtu, "msh": _encode_msh, "inp": _encode_inp}[kind](mesh)


def _encode_vtu(mesh: Volume) -> bytes:
    import pyvista

    blocks = {VTK_TYPES[cells.shape[1]]: cells for cells in (mesh.hexahedra, mesh.wedges) if len(cells)}
    grid = pyvista.UnstructuredGrid(blocks, mesh.nodes)
    held = np.zeros(len(mesh.nodes), dtype=np.uint8)
    held[mesh.held] = 1
    grid.point_data["held"] = held
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    if not writer.Write():
        raise ShellError("VTK cannot write this mesh.")
    return str(writer.GetOutputString()).encode()


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
