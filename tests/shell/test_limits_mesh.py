"""Meshes against exact volumes, the solver's integrals, and each other as the spacing falls."""

import io
import json
import struct
from math import pi

import numpy as np
import pytest

from shell.errors import ShellError
from shell.inertia import weigh
from shell.meridian import cylinder, hemisphere
from shell.mesh import build_mesh, encode_animation, encode_mesh
from shell.modes import solve_modes
from shell.surface import build_surface
from tests.shell.samples import BODIES, SILICA

R, H, RHO = 15e-3, 0.9e-3, 2203.0
SHAPES = BODIES | {
    "tube": cylinder(12.5e-3, 0.7e-3, 18e-3),
    "tapered": hemisphere(R, [(0.0, 1.5e-3), (1.0, 0.6e-3)]),
}


def mesh_of(resonator, fineness):
    surface = build_surface(resonator, spacing=resonator.size / fineness, count=4 * fineness)
    mesh = build_mesh(surface)
    mesh.density = RHO
    return mesh


@pytest.mark.parametrize("name", SHAPES)
def test_mass_centre_and_inertia_tend_to_the_solvers_integrals(name):
    exact = weigh(SHAPES[name], RHO)
    errors = []
    for fineness in (25, 37):
        mesh = mesh_of(SHAPES[name], fineness)
        assert mesh.is_watertight
        inertia = mesh.moment_inertia
        found = (mesh.mass / exact.mass, inertia[2, 2] / exact.axial, inertia[0, 0] / exact.transverse)
        errors.append([abs(ratio - 1) for ratio in found] + [abs(mesh.center_mass[2] - exact.center) / R])
        assert abs(mesh.center_mass[:2]).max() < 1e-9 * R
    # chords err by the square of the spacing: the coarse mesh by less than 0.3 %, one half as fine again at most half of it
    coarse, fine = np.array(errors)
    assert coarse.max() < 3e-3
    assert (fine <= np.maximum(0.5 * coarse, 1e-4)).all()


def test_exact_volumes():
    dome, tube = weigh(SHAPES["dome"], RHO), weigh(SHAPES["tube"], RHO)
    outer, inner = R + H / 2, R - H / 2
    assert dome.volume == pytest.approx(2 * pi / 3 * (outer**3 - inner**3), rel=1e-12)
    assert dome.center == pytest.approx(3 / 8 * (outer**4 - inner**4) / (outer**3 - inner**3), rel=1e-12)
    assert dome.axial == pytest.approx(RHO * 4 * pi / 15 * (outer**5 - inner**5), rel=1e-12)
    a, b, high = 12.5e-3 - 0.35e-3, 12.5e-3 + 0.35e-3, 18e-3
    assert tube.volume == pytest.approx(pi * (b**2 - a**2) * high, rel=1e-12)
    assert tube.transverse == pytest.approx(tube.mass * (3 * (a**2 + b**2) + high**2) / 12, rel=1e-12)


def test_the_closed_sphere_has_a_cavity():
    mesh = mesh_of(SHAPES["closed sphere"], 25)
    assert sorted(np.sign([body.volume for body in mesh.split(only_watertight=False)])) == [-1, 1]


@pytest.fixture(scope="module")
def swinging():
    resonator = SHAPES["inner stem"]
    mode = solve_modes(resonator, SILICA, 3, tolerance=1e-3)[0]
    return build_surface(resonator, mode, spacing=1e-3, count=48)


@pytest.mark.parametrize("kind", ["stl", "ply"])
def test_files_read_back_as_the_same_solid_in_mm(swinging, kind):
    import trimesh

    mesh = trimesh.load(io.BytesIO(encode_mesh(swinging, kind)), file_type=kind)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(build_mesh(swinging).volume * 1e9, rel=1e-5)


def test_the_deformed_solid_stays_closed_and_moves_by_the_swing(swinging):
    deformed = build_mesh(swinging, 0.5e-3)
    assert deformed.is_watertight
    moved = np.linalg.norm(deformed.vertices - swinging.points, axis=1)
    assert moved.max() == pytest.approx(0.5e-3, rel=1e-9)


def test_a_swing_that_turns_the_solid_inside_out_is_refused(swinging):
    still = build_surface(SHAPES["dome"])
    assert build_mesh(still).volume > 0
    with pytest.raises(ShellError, match="does not close"):
        build_mesh(swinging, float("nan"))


def read_glb(data):
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON"
    document = json.loads(data[20 : 20 + size])
    binary = data[28 + size :]
    assert struct.unpack("<I4s", data[20 + size : 28 + size]) == (len(binary), b"BIN\0")
    return document, binary


def accessor(document, binary, number):
    entry = document["accessors"][number]
    view = document["bufferViews"][entry["bufferView"]]
    kind = {5126: "<f4", 5125: "<u4", 5121: "u1"}[entry["componentType"]]
    wide = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[entry["type"]]
    values = np.frombuffer(binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]], kind)
    assert view["byteOffset"] % 4 == 0
    assert len(values) == entry["count"] * wide
    return values.reshape(-1, wide)


def test_the_animated_glb_swings_by_one_morph_target(swinging):
    colours = np.tile(np.array([10, 20, 30], dtype=np.uint8), (len(swinging.points), 1))
    document, binary = read_glb(encode_animation(swinging, 1e-3, colours))
    primitive = document["meshes"][0]["primitives"][0]
    position = accessor(document, binary, primitive["attributes"]["POSITION"])
    target = accessor(document, binary, primitive["targets"][0]["POSITION"])
    assert np.allclose(position, swinging.points, atol=1e-8)
    assert np.allclose(target, 1e-3 * swinging.displacement, atol=1e-9)
    assert accessor(document, binary, primitive["attributes"]["COLOR_0"])[0].tolist() == [10, 20, 30, 255]
    sampler = document["animations"][0]["samplers"][0]
    weights = accessor(document, binary, sampler["output"])[:, 0]
    times = accessor(document, binary, sampler["input"])[:, 0]
    assert np.allclose(weights, np.cos(2 * pi * times / times[-1]), atol=1e-6)
    for entry, values in (
        (primitive["attributes"]["POSITION"], position),
        (primitive["targets"][0]["POSITION"], target),
    ):
        assert np.allclose(document["accessors"][entry]["min"], values.min(axis=0))
        assert np.allclose(document["accessors"][entry]["max"], values.max(axis=0))


def test_another_library_reads_the_still_glb(swinging):
    import trimesh

    scene = trimesh.load(io.BytesIO(encode_mesh(swinging, "glb", 1e-3)), file_type="glb")
    (mesh,) = scene.geometry.values()
    assert mesh.volume == pytest.approx(build_mesh(swinging, 1e-3).volume, rel=1e-4)
    # glTF has y up: the axis of the resonator, z, is turned into it
    low, high = scene.bounds
    assert high[1] - low[1] == pytest.approx(
        np.ptp(swinging.points[:, 2] + 1e-3 * swinging.displacement[:, 2]), rel=1e-3
    )


@pytest.mark.slow
def test_vtk_reads_the_animated_glb_at_its_largest_swing(swinging, tmp_path):
    import pyvista as pv

    path = tmp_path / "swing.glb"
    path.write_bytes(encode_animation(swinging, 1e-3))
    moved = swinging.points + 1e-3 * swinging.displacement
    x_low, x_high, y_low, y_high, *_ = pv.read(path).combine().bounds
    # without a clock the weight is the mesh's own, 1; z of the resonator is y of the file
    assert (x_low, x_high) == pytest.approx((moved[:, 0].min(), moved[:, 0].max()), abs=1e-7)
    assert (y_low, y_high) == pytest.approx((moved[:, 2].min(), moved[:, 2].max()), abs=1e-7)


def test_the_surface_carries_the_modes_pattern(swinging):
    assert len(swinging.nodes) == 2 * len(swinging.grids) * swinging.harmonic
    for line in swinging.nodes:
        radial = (swinging.displacement[line, :2] * swinging.points[line, :2]).sum(axis=1) / R
        assert abs(radial).max() < 1e-12
        assert abs(swinging.displacement[line, 2]).max() < 1e-12
    assert len(swinging.antinodes) == 2 * swinging.harmonic
    assert np.linalg.norm(swinging.displacement[swinging.antinodes], axis=1) == pytest.approx(np.ones(6), rel=1e-9)


def test_the_surface_of_another_resonator_is_refused():
    mode = solve_modes(SHAPES["dome"], SILICA, 2, tolerance=1e-3)[0]
    with pytest.raises(ShellError, match="another resonator"):
        build_surface(SHAPES["open pole"], mode)
    with pytest.raises(ShellError, match="no shape"):
        build_surface(SHAPES["dome"], solve_modes(SHAPES["dome"], SILICA, 2, theory="rayleigh")[0])
