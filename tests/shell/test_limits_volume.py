"""Solid meshes read back by VTK's own elements, against exact volumes, Gmsh's numbering, and another finite-element program."""

import io
from collections import Counter
from math import pi

import numpy as np
import pytest

from shell.errors import ShellError
from shell.inertia import weigh
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.volume import build_volume, encode_volume
from tests.shell.samples import BODIES, SILICA, H, R

SHAPES = BODIES | {"clamped rim": hemisphere(R, H, support="clamped-rim")}
CELLS = {25: "QuadraticHexahedron", 29: "TriQuadraticHexahedron", 26: "QuadraticWedge", 32: "BiQuadraticQuadraticWedge"}


def determinants(nodes, cells, kind):
    """det of the Jacobian at Gauss points (points, cells) with their weights, by VTK's shape functions."""
    from vtkmodules import vtkCommonDataModel

    x, w = np.polynomial.legendre.leggauss(4)
    x, w = (x + 1) / 2, w / 2
    a, b, c = (axis.ravel() for axis in np.meshgrid(x, x, x, indexing="ij"))
    weights = (w[:, None, None] * w[:, None] * w).ravel()
    if kind in (26, 32):  # the square folded onto the triangle
        b, weights = b * (1 - a), weights * (1 - a)
    found, cell = [], getattr(vtkCommonDataModel, f"vtk{CELLS[kind]}")()
    for place in zip(a, b, c, strict=True):
        slopes = [0.0] * (3 * cells.shape[1])
        cell.InterpolateDerivs(list(place), slopes)
        found.append(np.linalg.det(np.reshape(slopes, (3, -1)) @ nodes[cells]))
    return np.array(found), weights


def read_vtu(data, folder):
    import pyvista

    (folder / "mesh.vtu").write_bytes(data)
    grid = pyvista.read(folder / "mesh.vtu")
    return np.asarray(grid.points), grid.cells_dict, np.asarray(grid.point_data["held"])


@pytest.mark.parametrize("complete", [False, True])
@pytest.mark.parametrize("name", SHAPES)
def test_the_mesh_fills_the_solid_and_no_element_folds(name, complete, tmp_path):
    """Parabolas through points of a circle 7.5° apart err by less than 1e-5 in area."""
    mesh = build_volume(SHAPES[name], layers=1)
    nodes, cells, _ = read_vtu(encode_volume(mesh if complete else mesh.serendipity(), "vtu"), tmp_path)
    volume = 0.0
    for kind, numbers in cells.items():
        det, weights = determinants(nodes, numbers, kind)
        assert det.min() > 0
        volume += float(weights @ det.sum(axis=1))
    assert volume == pytest.approx(weigh(SHAPES[name], 1.0).volume, rel=2e-5)
    if name == "dome":
        assert volume == pytest.approx(2 * pi / 3 * ((R + H / 2) ** 3 - (R - H / 2) ** 3), rel=2e-5)


@pytest.mark.parametrize("name", SHAPES)
def test_every_face_joins_two_elements_or_lies_on_the_surface(name):
    """By the nodes on edges too, and the surface is closed: every edge of it joins two of its faces."""
    mesh = build_volume(SHAPES[name], layers=2, around=12).serendipity()
    faces = Counter()
    hexahedron = ("0 3 2 1 11 10 9 8", "4 5 6 7 12 13 14 15", "0 1 5 4 8 17 12 16", "1 2 6 5 9 18 13 17")
    hexahedron += ("2 3 7 6 10 19 14 18", "3 0 4 7 11 16 15 19")
    wedge = ("0 2 1 8 7 6", "3 4 5 9 10 11", "0 1 4 3 6 13 9 12", "1 2 5 4 7 14 10 13", "2 0 3 5 8 12 11 14")
    for cells, of in ((mesh.hexahedra, hexahedron), (mesh.wedges, wedge)):
        for face in of:
            faces.update(tuple(sorted(row)) for row in cells[:, [int(k) for k in face.split()]].tolist())
    assert set(faces.values()) <= {1, 2}
    outside = {face for face, count in faces.items() if count == 1}
    held = {tuple(sorted(face)) for part in (mesh.held_quadrilaterals, mesh.held_triangles) for face in part.tolist()}
    assert held <= outside
    assert bool(held) == (name not in ("dome", "open pole", "closed sphere", "bell") or SHAPES[name].support != "free")
    # Euler's number of the surface: nodes on corners and edges count twice in faces of eight (six) nodes
    on_surface = {node for face in outside for node in face}
    corners = {node for cells, k in ((mesh.hexahedra, 8), (mesh.wedges, 6)) for node in cells[:, :k].ravel().tolist()}
    edges = on_surface - corners
    euler = len(on_surface & corners) - len(edges) + len(outside)
    assert euler == {"open pole": 0, "clamped rim": 2, "closed sphere": 4}.get(name, 2)


def test_the_clamp_of_a_stem_is_its_flat_end():
    mesh = build_volume(SHAPES["inner stem"])
    x, y, z = mesh.nodes[mesh.held].T
    assert z == pytest.approx(-5e-3, abs=1e-12)
    assert np.hypot(x, y).max() == pytest.approx(2.5e-3, rel=1e-9)


def test_nodes_of_the_dome_are_counted():
    mesh = build_volume(SHAPES["dome"], layers=2, around=24, spacing=2 * R)
    along = len(mesh.hexahedra) // (2 * 24) + 1  # one row of elements is wedges
    assert len(mesh.wedges) == 2 * 24
    assert len(mesh.nodes) == 5 + 5 * 2 * along * 48  # five nodes of the section on the axis


GMSH_EDGES = {17: "01 03 04 12 15 23 26 37 45 47 56 67", 18: "01 02 03 12 14 25 34 35 45"}


def test_gmsh_finds_the_nodes_of_edges_where_it_looks_for_them():
    """Numbering of the Gmsh manual; its own reader gave the volumes of hrg-30mm and free-dome with positive Jacobians."""
    mesh = build_volume(SHAPES["inner stem"], around=16).serendipity()
    text = encode_volume(mesh, "msh").decode()
    lines = text.split("$Nodes\n")[1].split("$EndNodes")[0].splitlines()
    nodes = np.loadtxt(io.StringIO("\n".join(lines[1:])))
    assert nodes[:, 1:] == pytest.approx(mesh.nodes, rel=1e-12)
    elements = [line.split() for line in text.split("$Elements\n")[1].split("$EndElements")[0].splitlines()[1:]]
    assert [int(words[0]) for words in elements] == list(range(1, len(elements) + 1))
    for kind, edges in GMSH_EDGES.items():
        cells = np.array([words[5:] for words in elements if words[1] == str(kind)], dtype=int) - 1
        corners = 8 if kind == 17 else 6
        for k, (a, b) in enumerate(edges.split()):
            ends, middle = mesh.nodes[cells[:, [int(a), int(b)]]], mesh.nodes[cells[:, corners + k]]
            length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
            assert (np.linalg.norm(middle - ends.mean(axis=1), axis=1) < 0.3 * length).all()
    assert {words[3] for words in elements if words[1] in ("16", "9")} == {"2"}


def test_an_abaqus_file_holds_every_element_on_lines_of_sixteen():
    mesh = build_volume(SHAPES["inner stem"], around=8).serendipity()
    blocks = encode_volume(mesh, "inp").decode().split("*")
    (solid,) = [block for block in blocks if block.startswith("ELEMENT, TYPE=C3D20")]
    body = solid.split("\n", 1)[1]
    assert max(line.rstrip(",").count(",") for line in body.splitlines()) <= 15
    (nodes,) = [block for block in blocks if block.startswith("NODE")]
    words = [word.strip() for line in nodes.splitlines()[1:] for word in line.split(",")]
    assert max(len(word) for word in words) <= 20  # CalculiX cuts what is longer, exponent and all
    numbers = np.array(body.replace(",\n", ", ").replace(",", " ").split(), dtype=int).reshape(-1, 21)
    assert (numbers[:, 1:] == mesh.hexahedra + 1).all()
    (held,) = [block for block in blocks if block.startswith("NSET, NSET=HELD")]
    assert len(held.split("\n", 1)[1].replace(",", " ").split()) == len(mesh.held)
    with pytest.raises(ShellError, match="20 and 15 nodes"):
        encode_volume(build_volume(SHAPES["dome"], around=8), "inp")


def test_impossible_numbers_are_refused():
    for wrong in ({"layers": 0}, {"around": 4}, {"spacing": 0.0}, {"spacing": 1e-9}):
        with pytest.raises(ShellError):
            build_volume(SHAPES["dome"], **wrong)


@pytest.mark.slow
def test_another_program_finds_the_same_frequency_on_the_mesh():
    """scikit-fem's isoparametric elements of 27 nodes: from above, and nearer as the mesh is refined."""
    dome = hemisphere(R, 4e-3, pole_angle=0.4)  # thick, so that few elements go far
    (mode,) = solve_modes(dome, SILICA)
    errors = [frequency_on(build_volume(dome, 1, around, R / 2)) / mode.frequency - 1 for around in (8, 16)]
    assert 0 < errors[1] < errors[0] / 4
    assert errors[1] < 0.02


def frequency_on(mesh):
    """The lowest frequency above the rigid motions, Hz, of a mesh of complete hexahedra."""
    from scipy.sparse.linalg import eigsh
    from skfem import Basis, BilinearForm, ElementHex2, ElementVector, MeshHex1, MeshHex2
    from skfem.assembly import Dofs
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    lattice = (
        "000 200 220 020 002 202 222 022 100 210 120 010 102 212 122 012 001 201 221 021 011 211 101 121 110 112 111"
    )
    place = {tuple(int(k) for k in name): vtk for vtk, name in enumerate(lattice.split())}

    def vtk_of(points):
        return [place[tuple(round(2 * x) for x in point)] for point in points]

    corners, numbers = np.unique(mesh.hexahedra[:, :8], return_inverse=True)
    own = numbers.reshape(-1, 8)[:, vtk_of(MeshHex1.elem.refdom.p.T)].T
    straight = MeshHex1(mesh.nodes[corners].T, own)
    dofs = Dofs(straight, ElementHex2())
    places = np.zeros((3, dofs.N))
    places[:, dofs.element_dofs] = mesh.nodes[mesh.hexahedra[:, vtk_of(ElementHex2.doflocs)]].transpose(2, 1, 0)
    basis = Basis(MeshHex2(places, own), ElementVector(ElementHex2()), intorder=5)
    stiffness = linear_elasticity(*lame_parameters(SILICA.E, SILICA.nu)).assemble(basis)
    mass = BilinearForm(lambda u, v, _: SILICA.rho * (u * v).sum(axis=0)).assemble(basis)
    values = eigsh(stiffness, 1, mass, sigma=(2 * pi * 14000.0) ** 2, return_eigenvectors=False)
    return float(np.sqrt(values[0])) / (2 * pi)
