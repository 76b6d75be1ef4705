"""The inner face is the one towards the axis, whichever way the meridian is drawn."""

from functools import cache
from math import pi

import numpy as np
import pytest

from shell.curves import Arc, Line
from shell.damping.faces import Vibration
from shell.damping.film import Film, film_internal_loss, film_shift
from shell.damping.gas import GASES, viscous_loss
from shell.electrodes import VACUUM, Electrodes, ring_of_electrodes
from shell.errors import ShellError
from shell.groove import Groove, solve_groove
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, PointMass, find_split, wave
from shell.imperfection.surface import depart_surface
from shell.materials import find_material
from shell.meridian import bell, cylinder, hemisphere, meridian
from shell.modes import solve_modes
from shell.scan.alignment import align
from shell.scan.projection import Projector
from shell.scan.survey import survey
from shell.surface import build_surface
from tests.shell.samples import SILICA

R, H, L = 12.5e-3, 1e-3, 5e-3
UP, DOWN = (meridian([Line((R, a), (R, b))], H) for a, b in ((0.0, L), (0.0, -L)))
TUBES = pytest.mark.parametrize("tube", [cylinder(R, H, L), UP, DOWN], ids=["cylinder", "up", "down"])


@cache
def solved(resonator):
    (mode,) = solve_modes(resonator, SILICA, 2, tolerance=1e-8)
    return mode


@pytest.mark.parametrize(
    "closed",
    [
        hemisphere(R, H),
        hemisphere(R, H, rim_angle=pi / 6),
        bell(R, H, L, L, R + 1e-3),
        cylinder(R, H, L, bottom_thickness=H),
        meridian([Line((1e-3, 0.0), (R, 0.0)), Line((R, 0.0), (R, -L))], H),  # the cup turned over
        meridian([Line((R, L), (R, 0.0)), Line((R, 0.0), (1e-3, 0.0))], H),  # from its rim to the bottom
        meridian([Arc((4e-3, 0.0), 3e-3, -pi / 2, pi / 2)], H),  # an arch like a birdbath's, from the anchor
        meridian([Arc((4e-3, 0.0), 3e-3, pi / 2, -pi / 2)], H),
        cylinder(R, H, L),
        UP,
        DOWN,
    ],
)
def test_the_inner_face_is_smaller_and_encloses_less(closed):
    """The inner face of a tube has a smaller radius; that of a dome, cup or arch is concave, so it encloses less with the axis."""
    s = np.linspace(0.0, closed.length, 20001)
    areas = []
    for face in ("inner", "outer"):
        r, z = closed.surface(closed.height_of(face))(s)
        areas.append(abs(float(np.trapezoid(r, z))))
    assert areas[0] < areas[1]


def test_the_inner_face_of_a_flat_disc_is_the_lower_one():
    for ends in ((1e-3, R), (R, 1e-3)):
        disc = meridian([Line((ends[0], 0.0), (ends[1], 0.0))], H)
        z = [
            float(disc.surface(disc.height_of(face))(np.array([disc.length / 2]))[1][0]) for face in ("inner", "outer")
        ]
        assert z == pytest.approx([-H / 2, H / 2])


@TUBES
def test_electrodes_on_a_thin_ring_soften_by_the_area_of_their_face(tube):
    """½ · 4/5 ε₀ V²/(g³ ρ h ω²) · (1 ∓ h/2r): the area of the face, and w² = 4/5 of |u|² of the inextensional ring, n = 2."""
    mode = solved(tube)
    pair, omega, patches = Pair(mode), 2 * pi * mode.frequency, ring_of_electrodes(1, 1.0, 100.0)
    ring = -0.5 * 0.8 * VACUUM * 100.0**2 / (100e-6**3 * SILICA.rho * H * omega**2)
    for face, sign in (("inner", -1), ("outer", 1)):
        shift = Electrodes(pair, patches, 100e-6, face=face).soften().shift
        assert shift / ring == pytest.approx(1 + sign * H / (2 * R), abs=0.01)


@TUBES
def test_a_moved_face_is_the_frequency_of_the_changed_tube(tube):
    """Material on one face makes another tube: δ more inside is a radius δ/2 smaller, δ outside δ/2 larger."""
    mode, d = solved(tube), 1e-4 * H
    pair, coupled = Pair(mode), CoupledHarmonics(mode, SILICA)
    for flaw, radius, wall in (
        (Imperfection(inner=wave(0, d)), R - d / 2, H + d),
        (Imperfection(outer=wave(0, d)), R + d / 2, H + d),
        (Imperfection(offset=wave(0, d)), R + d, H),
    ):
        wanted = solved(cylinder(radius, wall, L)).frequency / mode.frequency - 1
        assert find_split(pair, flaw).shift == pytest.approx(wanted, rel=1e-3)
        assert coupled.solve(flaw).shift == pytest.approx(wanted, rel=1e-3)


@TUBES
def test_a_film_of_the_walls_material_is_a_thicker_wall_on_its_face(tube):
    mode, t = solved(tube), 1e-4 * H
    for face, radius in (("inner", R - t / 2), ("outer", R + t / 2)):
        film = Film(t, SILICA.E, SILICA.nu, faces=(face,), rho=SILICA.rho)
        wanted = solved(cylinder(radius, H + t, L)).frequency / mode.frequency - 1
        assert film_shift(mode, film) == pytest.approx(wanted, rel=1e-3)


def effects(resonator):
    """What depends on a face, of each."""
    mode = solved(resonator)
    pair, coupled = Pair(mode), CoupledHarmonics(mode, SILICA)
    vibration = Vibration(mode.solution, mode.resonator, find_material("fused-silica"), 293.15)
    found = {"gas": viscous_loss(vibration, GASES["air"], 1e5, 293.15)}
    for face, height in (("inner", -1.0), ("outer", 1.0)):
        found[f"film {face}"] = film_internal_loss(Film(1e-7, 7e10, 0.4, 1e-3, faces=(face,)), vibration)
        found[f"shaving {face}"] = pair.shaving(1.0, face)[1]
        flaw = Imperfection(masses=(PointMass(1e-9, 0.3, 0.8, height),))
        found[f"mass {face}"] = find_split(pair, flaw).relative
        found[f"mass {face}, all orders"] = coupled.solve(flaw).relative
    cut = solve_groove(pair, Groove("inner", 1.0, 0.5e-3, 0.5e-3, 0.1 * H))
    return found | {"groove inner": cut.wave / cut.mass}


@pytest.mark.slow
def test_a_tube_drawn_the_other_way_has_the_same_effects_on_each_face():
    down = effects(DOWN)
    assert effects(UP) == pytest.approx(down, rel=1e-5)
    assert down["film inner"] > 1.01 * down["film outer"]


@TUBES
def test_a_picture_moves_the_face_that_departs(tube):
    """10 µm outwards at the crests of the outer face: the largest radius grows, the least stays; of the inner face inwards."""
    surface, d = build_surface(tube), 1e-5
    for face, grown in (("inner", (-d, 0.0)), ("outer", (0.0, d))):
        moved, _ = depart_surface(surface, tube, Imperfection(**{face: wave(4, d)}), exaggerated=False)
        r = np.hypot(moved.points[:, 0], moved.points[:, 1])
        assert [r.min() - (R - H / 2), r.max() - (R + H / 2)] == pytest.approx(grown, abs=1e-12)


@TUBES
def test_points_of_a_face_are_taken_for_that_face(tube):
    """2 µm cos 4(θ - 10°) out of the material of the inner face of a tube, towards the axis."""
    rng, projector = np.random.default_rng(3), Projector(tube)
    theta, z = rng.uniform(0, 2 * pi, 20000), rng.uniform(0.0, 1.0, 20000) * tube.sample(2).z[-1]
    r = R - H / 2 - 2e-6 * np.cos(4 * (theta - np.deg2rad(10.0)))
    points = np.stack([r * np.cos(theta), r * np.sin(theta), z], axis=1)
    side = tube.height_of("inner")
    face = survey(points, side, align([(points, side)], projector, ["face"]), projector, "face")
    assert face.at(0.5, 4)[0] == pytest.approx(2e-6 * np.exp(4j * np.deg2rad(10.0)), abs=2e-9)
    with pytest.raises(ShellError, match="the points of the outer face lie on the inner face"):
        align([(points, -side)], projector, ["face"])
