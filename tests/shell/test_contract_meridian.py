"""Meridians: geometry against closed forms, and refusal of what cannot exist."""

from math import pi

import numpy as np
import pytest

from shell.curves import Arc, Hyperbola, Line
from shell.errors import ShellError
from shell.meridian import bell, cylinder, hemisphere, meridian
from shell.modes import solve_modes
from shell.resonator import Resonator, Stem
from tests.shell.samples import DOME, SILICA


def test_hemisphere_is_a_sphere() -> None:
    points = DOME.sample(31)
    phi = np.linspace(0, pi / 2, 31)
    assert points.r == pytest.approx(15e-3 * np.sin(phi))
    assert points.z == pytest.approx(15e-3 * np.cos(phi))
    assert points.curvature == pytest.approx(np.full(31, 1 / 15e-3))
    assert points.normal_r == pytest.approx(np.sin(phi))
    assert points.normal_z == pytest.approx(np.cos(phi))
    assert points.arc_length[-1] == pytest.approx(15e-3 * pi / 2)


def test_bell_follows_its_equation() -> None:
    """BVG paper eq. (1), and the length of the hyperbola by another rule."""
    resonator = bell(12e-3, 0.8e-3, 8e-3, 5e-3, 14e-3)
    points = resonator.sample(400)
    mouth = points.z < -8e-3
    r, z = points.r[mouth], points.z[mouth]
    left = r**2 / 12e-3**2 - (14e-3**2 - 12e-3**2) * (z + 8e-3) ** 2 / (12e-3**2 * 5e-3**2)
    assert left == pytest.approx(np.ones(mouth.sum()))
    assert (points.r[-1], points.z[-1]) == pytest.approx((14e-3, -13e-3))
    steps = np.hypot(np.diff(points.r), np.diff(points.z))
    assert steps == pytest.approx(np.full(399, resonator.length / 399), rel=1e-4)


def test_arc_length_of_a_curve_and_its_inverse() -> None:
    curve = Hyperbola(12e-3, -8e-3, 5e-3, 14e-3)
    x = np.linspace(0, 1, 200001)
    jet = curve.jet(x)
    assert curve.length == pytest.approx(np.trapezoid(np.hypot(jet.dr, jet.dz), x), rel=1e-10)
    there = curve.at_length(np.array([0.3 * curve.length]))
    partial = np.hypot(np.diff(jet.r), np.diff(jet.z)).cumsum()
    assert float(there.r[0]) == pytest.approx(jet.r[np.searchsorted(partial, 0.3 * curve.length)], rel=1e-6)


def test_curvature_of_the_hyperbola_is_that_of_its_jet() -> None:
    curve = Hyperbola(12e-3, -8e-3, 5e-3, 14e-3)
    x, d = np.array([0.2, 0.7]), 1e-5
    low, here, high = (curve.jet(x + k * d) for k in (-1, 0, 1))
    assert here.dr == pytest.approx((high.r - low.r) / (2 * d), rel=1e-8)
    assert here.ddr == pytest.approx((high.dr - low.dr) / (2 * d), rel=1e-8)


def test_thickness_is_linear_between_its_knots() -> None:
    resonator = hemisphere(15e-3, [(0, 1e-3), (0.4, 2e-3), (1, 0.5e-3)])
    assert resonator.sample(6).thickness == pytest.approx([1e-3, 1.5e-3, 2e-3, 1.5e-3, 1e-3, 0.5e-3])
    assert resonator.sample(6).thickness_slope[[0, 5]] * resonator.length == pytest.approx([2.5e-3, -2.5e-3])


def test_cup_has_its_faces_where_the_card_says() -> None:
    cup = cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3)
    start, foot, rim = cup.at([0.0, cup.joints[0], cup.length]).z
    assert (start, rim) == pytest.approx((0.5e-3, 18e-3))
    assert foot == pytest.approx(0.5e-3)
    assert cup.at([cup.joints[0]], 0).thickness[0] == pytest.approx(1e-3)
    assert cup.at([cup.joints[0]], 1).thickness[0] == pytest.approx(0.6e-3)


def test_scaling_scales_every_length() -> None:
    resonator = hemisphere(
        15e-3, [(0, 1e-3), (1, 0.5e-3)], support="stem", stem=Stem(2.5e-3, (-5e-3, 20e-3), 0.5e-3, "both")
    )
    twice = resonator.scaled(2.0)
    assert (twice.length, twice.size) == pytest.approx((2 * resonator.length, 2 * resonator.size))
    assert twice.stem == Stem(5e-3, (-10e-3, 40e-3), 1e-3, "both")
    assert twice.thickness == ((0, 2e-3), (1, 1e-3))


def test_arc_through_points_takes_the_shorter_way() -> None:
    arc = Arc.through((0.0, 1.0), (1.0, 0.0), (0.0, 0.0))
    assert arc.length == pytest.approx(pi / 2)
    back = Arc.through((1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
    assert back.end_points == (pytest.approx((1, 0)), pytest.approx((0, 1)))


def stemmed(**stem: object) -> Resonator:
    return hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(**stem))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: hemisphere(-1.0, 1e-3), "radius must be positive"),
        (lambda: hemisphere(15e-3, 0.0), "thickness must be positive"),
        (lambda: hemisphere(15e-3, [(0, 1e-3), (1, -1e-3)]), "thickness must be positive"),
        (lambda: hemisphere(15e-3, [(0, 1e-3), (0.9, 1e-3)]), "rise from 0"),
        (lambda: hemisphere(15e-3, [(0, 1e-3), (0.5, 1e-3), (0.5, 2e-3), (1, 2e-3)]), "none of them twice"),
        (lambda: hemisphere(15e-3, 35e-3), "overlap"),
        (lambda: hemisphere(15e-3, 1e-3, rim_angle=0.2, pole_angle=0.3), "pole angle < rim angle"),
        (lambda: hemisphere(15e-3, 1e-3, support="glued"), "support is one of"),
        (lambda: hemisphere(15e-3, 1e-3, support="clamped-pole"), "no edge to clamp"),
        (lambda: hemisphere(15e-3, 1e-3, rim_angle=pi, support="clamped-rim"), "no rim"),
        (lambda: hemisphere(15e-3, 1e-3, support="stem"), "needs a stem"),
        (lambda: hemisphere(15e-3, 1e-3, pole_angle=0.2, support="stem", stem=Stem(2e-3, -5e-3)), "closed pole"),
        (lambda: stemmed(radius=14.9e-3, ends=-5e-3), "larger than the dome"),
        (lambda: stemmed(radius=2.5e-3, ends=14.2e-3), "not clear of the dome"),
        (lambda: stemmed(radius=2.5e-3, ends=-5e-3, side="outer"), "not clear of the dome"),
        (lambda: stemmed(radius=0.05e-3, ends=-5e-3), "times as long as its radius"),
        (lambda: stemmed(radius=0.0, ends=-5e-3), "stem radius must be positive"),
        (lambda: stemmed(radius=2.5e-3, ends=-5e-3, fillet=-1e-3), "fillet"),
        (lambda: stemmed(radius=2.5e-3, ends=-5e-3, side="both"), "two ends"),
        (lambda: stemmed(radius=2.5e-3, ends=-5e-3, side="left"), "inner, outer or both"),
        (lambda: cylinder(12e-3, 1e-3, 20e-3, clamp_radius=3e-3), "no bottom"),
        (lambda: cylinder(12e-3, 1e-3, 0.5e-3, bottom_thickness=1e-3), "must exceed"),
        (lambda: cylinder(12e-3, 1e-3, 20e-3, bottom_thickness=1e-3, clamp_radius=12e-3), "within the cup"),
        (lambda: cylinder(1e-3, 3e-3, 20e-3), "overlap"),
        (lambda: bell(12e-3, 1e-3, 8e-3, 5e-3, 11e-3), "mouth radius"),
        (lambda: meridian([], 1e-3), "at least one segment"),
        (
            lambda: meridian([Line((1e-2, 0), (1e-2, 1e-2)), Line((1.1e-2, 1e-2), (1e-2, 2e-2))], 1e-3),
            "segment 2 .* starts at",
        ),
        (lambda: meridian([Line((0.0, 0.0), (1e-2, 1e-2))], 1e-4), "at an angle"),
        (lambda: meridian([Line((1e-2, 0), (-1e-2, 0))], 1e-3), "crosses the axis"),
        (lambda: Line((1.0, 2.0), (1.0, 2.0)), "no length"),
        (lambda: Arc.through((0.0, 1.0), (2.0, 0.0), (0.0, 0.0)), "from its centre"),
    ],
)
def test_impossible_geometry_is_refused(build: object, message: str) -> None:
    with pytest.raises(ShellError, match=message):
        build()  # type: ignore[operator]


def test_a_corner_too_sharp_for_the_thickness_is_refused() -> None:
    folded = meridian([Line((10e-3, 0.0), (12e-3, 0.0)), Line((12e-3, 0.0), (10e-3, 0.1e-3))], 1e-3)
    with pytest.raises(ShellError, match=r"too sharp|fold back"):
        solve_modes(folded, SILICA)
