"""Planted waves come back from three-dimensional points; planted splits are trimmed away."""

from math import pi

import numpy as np
import pytest

from shell.groove import Groove, solve_groove
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, PointMass, find_split, wave
from shell.meridian import cylinder
from shell.modes import solve_modes
from shell.scan.alignment import align
from shell.scan.projection import Projector
from shell.scan.survey import rigid_shapes, survey
from shell.trimming import SplitWave, plan_trim
from studies.resonator.scan import polar_intervals
from studies.resonator.trim import Teeth, Tool, plan_for_card, rim_sites, tooth_sites
from tests.shell.samples import DOME, SILICA, H, R
from tests.shell.scans import dome_points


@pytest.fixture(scope="module")
def pair():
    (mode,) = solve_modes(DOME, SILICA, 2)
    return Pair(mode)


@pytest.fixture(scope="module")
def projector():
    return Projector(DOME)


def test_even_waves_of_both_faces_give_the_published_split(pair, projector):
    """cos 4θ of the same amplitude on both faces is a wall wave of twice it: 0.36902 of its share of the wall."""
    rng = np.random.default_rng(11)
    found = 0j
    for side in (-1, 1):
        points = dome_points(rng, 5000, [(4, 0.5e-6, 0.3, 0), (3, 2e-6, 1.0, 3)], side, outliers=1e-3)
        face = survey(points, side, align([(points, side)], projector, ["face"]), projector, "face")
        found += face.project(pair.faces[(side + 1) // 2], 4)[0]
    assert abs(found) == pytest.approx(0.36902 * 1e-6 / H, rel=0.03)
    assert abs(np.angle(-found * np.exp(-1.2j))) / 4 < np.deg2rad(1.0)


def test_frame_noise_and_outliers_are_found(projector):
    points = dome_points(
        np.random.default_rng(2), 20000, [(2, 2e-6, 0.0, 2)], 1, outliers=2e-3, tilt_deg=2.0, shift=200e-6
    )
    motion = align([(points, 1)], projector, ["face"])
    assert np.rad2deg(motion.tilt) == pytest.approx(2.0, abs=0.05)
    face = survey(points, 1, motion, projector, "face")
    assert face.noise == pytest.approx(100e-9, rel=0.03)
    assert 20 < face.outliers < 60
    assert abs(face.at(1.0, 2)[0]) == pytest.approx(2e-6, rel=0.02)


@pytest.mark.parametrize("wild", [0, 20])
def test_points_of_the_last_rings_are_no_outliers(projector, wild):
    """Half of an outermost ring lies outside the positions that are fitted: 248 points of 14 400 were outliers, of 20 planted."""
    rng = np.random.default_rng(3)
    phi, theta = (one.ravel() for one in np.meshgrid(np.radians(np.linspace(3, 90, 60)), 2 * pi * np.arange(240) / 240))
    radius = R + H / 2 + 1e-7 * rng.standard_normal(phi.size)
    radius[rng.choice(phi.size, wild, replace=False)] += 50e-6
    points = radius[:, None] * np.column_stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])
    face = survey(points, 1, align([(points, 1)], projector, ["face"]), projector, "face")
    assert face.outliers == wild


@pytest.mark.slow
def test_no_first_wave_is_seen_where_none_is(projector):
    """Tilt, shift, gaps and waves 2 and 3 but no wave 1: its 90 % interval holds 0, and those of the others their amplitudes."""
    held = {1: 0, 2: 0, 3: 0}
    for seed in range(8):
        planted = [(2, 4e-6, 0.4, 2), (3, 2e-6, 1.0, 1)]
        points = dome_points(
            np.random.default_rng(seed), 5000, planted, 1, tilt_deg=1.0, shift=1e-4, gaps=0.1 * (seed % 2)
        )
        face = survey(points, 1, align([(points, 1)], projector, ["face"]), projector, "face")
        face = face.centred(rigid_shapes(face.waves, projector))
        for order, amplitude in ((1, 0.0), (2, 4e-6), (3, 2e-6)):
            size, _ = polar_intervals(*face.at(1.0, order), order)
            held[order] += size.low <= amplitude <= size.high
    assert min(held.values()) >= 5  # of 8: fewer is less likely than 1 in 100 where 90 % are held
    assert held[1] >= 7


def test_a_turned_over_dome_is_put_upright(projector):
    points = dome_points(np.random.default_rng(3), 20000, [], 1) @ np.diag([1.0, -1.0, -1.0]) + [0.02, 0.01, -0.03]
    motion = align([(points, 1)], projector, ["face"])
    assert motion.rotation[2, 2] == pytest.approx(-1.0, abs=1e-3)


def test_distances_from_a_cylinder_and_a_dome_are_exact():
    rng = np.random.default_rng(4)
    theta, zeta = rng.uniform(0, 2 * pi, 2000), rng.uniform(-0.5e-3, 0.5e-3, 2000)
    phi = rng.uniform(0.1, pi / 2, 2000)
    r = R + zeta
    places = Projector(DOME).place(
        np.stack([r * np.sin(phi) * np.cos(theta), r * np.sin(phi) * np.sin(theta), r * np.cos(phi)], axis=1)
    )
    assert np.abs(places.height - zeta).max() < 1e-11
    assert np.abs(places.position - phi / (pi / 2)).max() < 1e-8
    tube = Projector(cylinder(radius=10e-3, thickness=0.6e-3, height=18e-3))
    z = rng.uniform(1e-3, 17e-3, 2000)
    places = tube.place(np.stack([(10e-3 + zeta) * np.cos(theta), (10e-3 + zeta) * np.sin(theta), z], axis=1))
    assert np.abs(abs(places.height) - abs(zeta)).max() < 1e-12


def test_four_cuts_null_n_2_and_leave_the_balance(pair):
    f = pair.mode.frequency
    plan = plan_trim([SplitWave.of(2, f, 0.3, 0.4, 1e-4)], rim_sites(DOME, {2: pair}, 2203.0, 0.4), goal=5e-4)
    first = plan
    flaw = Imperfection(masses=tuple(PointMass(-c.mass, c.azimuth) for c in first.cuts))
    assert find_split(pair, flaw).wave * f == pytest.approx(first.share * 0.3 * np.exp(4j * 0.4), rel=1e-9)
    for k in (1, 2, 3):
        assert abs(sum(c.mass * np.exp(1j * k * c.azimuth) for c in first.cuts)) < 1e-9 * first.mass
    # no plan takes less: every cut lies on an antinode of the slower mode
    gain = -pair.mass()[1]
    assert first.mass == pytest.approx(first.share * 0.3 / f / gain, rel=1e-9)


def test_cuts_that_null_a_split_lie_where_a_known_imbalance_is(pair):
    # what four antinodes take off wave 1 they take off wave 3 mirrored
    f, u = pair.mode.frequency, {1: 20e-9 * np.exp(0.7j), 3: 22e-9 * np.exp(1j * (4 * 0.4 - 0.6))}
    sites = rim_sites(DOME, {2: pair}, 2203.0, 0.4)
    plan = plan_trim([SplitWave.of(2, f, 0.3, 0.4, 1e-4)], sites, goal=5e-4, unbalance=u)
    assert max(abs(left) for left in plan.unbalance.values()) < 1e-14
    even = plan_trim([SplitWave.of(2, f, 0.3, 0.4, 1e-4)], sites, goal=5e-4)
    assert plan.mass == pytest.approx(even.mass, rel=0.02)  # the antinodes on its heavy side give more


@pytest.mark.parametrize("split", [0.003, 0.12, 1.2])
@pytest.mark.parametrize(
    "u", [{1: 120e-9 * np.exp(0.6j)}, {1: 120e-9 * np.exp(0.6j), 2: 50e-9 * np.exp(0.35j), 3: 80e-9}, {3: 9e-9j}]
)
def test_known_imbalance_is_corrected_with_the_split(pair, split, u):
    """Σ m exp(ikθ) of the cuts is the imbalance for k known and 0 for the others; no mass that is not negative can be less than it."""
    f, sites = pair.mode.frequency, rim_sites(DOME, {2: pair}, 2203.0, 0.4, tool=Tool(0.5e-3, 2e-3, 0.5))
    plan = plan_trim([SplitWave.of(2, f, split, 0.4, 1e-4)], sites, goal=5e-4, unbalance=u)
    taken = {k: sum(cut.mass * np.exp(1j * k * cut.azimuth) for cut in plan.cuts) for k in (1, 2, 3)}
    assert taken == pytest.approx({k: u.get(k, 0.0) for k in (1, 2, 3)}, abs=1e-6 * plan.mass)
    flaw = Imperfection(masses=tuple(PointMass(-c.mass, c.azimuth) for c in plan.cuts))
    wanted = plan.share * split * np.exp(4j * 0.4)
    assert find_split(pair, flaw).wave * f == pytest.approx(
        wanted, abs=1e-6 * abs(wanted) + 1e-6 * plan.mass * f / 1e-3
    )


@pytest.mark.parametrize("azimuth", np.linspace(0.0, pi / 3, 7))
def test_an_imbalance_that_is_too_large_for_the_cuts_is_lowered_as_far_as_they_go(pair, azimuth):
    f, u = pair.mode.frequency, {1: 5e-6 * np.exp(1j * azimuth)}
    sites = tooth_sites({2: pair}, Teeth(32, 0.1, 100e-9))
    plan = plan_trim([SplitWave.of(2, f, 0.12, 0.4, 1e-4)], sites, goal=5e-4, unbalance=u)
    # a half circle of 16 teeth of 100 µg takes off at most 100 µg / sin(π/32) along its middle; balance of k = 2, 3 costs some of it
    assert 0.5 < (abs(u[1]) - abs(plan.unbalance[1])) / (100e-9 / np.sin(pi / 32)) < 1.0


def test_two_harmonics_and_teeth(pair):
    (three,) = solve_modes(DOME, SILICA, 3)
    pairs = {2: pair, 3: Pair(three)}
    readings = [SplitWave.of(2, pair.mode.frequency, 0.2, 0.4, 1e-4), SplitWave.of(3, three.frequency, 0.5, 0.1, 1e-4)]
    plan = plan_trim(readings, tooth_sites(pairs, Teeth(36, 0.05, 200e-9)), goal=5e-4)
    first = plan
    flaw = Imperfection(masses=tuple(PointMass(-c.mass, c.azimuth) for c in first.cuts))
    for reading, one in zip(readings, (pair, pairs[3]), strict=True):
        assert find_split(one, flaw).wave == pytest.approx(-first.share * reading.wave, rel=1e-6)
    assert all(abs((np.rad2deg(c.azimuth - 0.05) + 5) % 10 - 5) < 1e-6 for c in first.cuts)


def test_planted_splits_end_below_half_a_millihertz_in_three_rounds(pair):
    """Three seeds: cuts with 2 % of error, readings with 0.1 mHz, coupled harmonics as nature."""
    coupled, f = CoupledHarmonics(pair.mode, SILICA), pair.mode.frequency
    for seed, planted in ((0, 0.02), (1, 0.2), (2, 1.0)):
        rng = np.random.default_rng(seed)
        axis = rng.uniform(0, pi / 2)
        density = wave(4, planted / f / 0.3608, axis)
        gone = []
        for _ in range(3):
            seen = coupled.solve(Imperfection(density=density, masses=tuple(gone))).wave
            seen += 1e-4 / f * complex(*rng.standard_normal(2))
            if abs(seen) * f < 3.5e-4:
                break
            slow = float(np.angle(-seen) / 4)
            plan = plan_trim(
                [SplitWave.of(2, f, abs(seen) * f, slow, 1e-4)], rim_sites(DOME, {2: pair}, 2203.0, slow), goal=5e-4
            )
            for cut in plan.cuts:
                gone.append(PointMass(-cut.mass * (1 + 0.02 * rng.standard_normal()), cut.azimuth))
        assert coupled.solve(Imperfection(density=density, masses=tuple(gone))).hertz < 5e-4


@pytest.mark.slow
def test_cuts_side_by_side_are_one_wide_groove(pair):
    """Five touching cuts of 1 mm change the split as one of their width does; each alone would change it a third less."""
    plan = plan_for_card(DOME, SILICA, [(2, 6.0, 0.5, 1e-4)], goal=1e-3, tool=Tool(1e-3, 1e-3, 0.1), kind="edge")
    (cut,) = plan.cuts.values()
    whole = solve_groove(pair, Groove("edge", 1.0, 5e-3, 1e-3, cut.groove.depth))
    alone = solve_groove(pair, Groove("edge", 1.0, 1e-3, 1e-3, cut.groove.depth))
    assert len(plan.plan.cuts) == 20
    assert cut.gain(2) == pytest.approx(whole.wave / (whole.mass * cut.first[2]), rel=0.02)
    assert alone.wave / alone.mass < 0.75 * whole.wave / whole.mass


@pytest.mark.parametrize("errors", [0.0, 1.0, 5.0, 1200.0])
def test_the_upper_limit_of_a_split_holds_95_of_100_of_its_vectors(errors):
    """At many errors the limit was short: 1.2 of them hold 88 of 100."""
    rng = np.random.default_rng(2)
    drawn = abs(errors + rng.normal(size=(2, 100_000)).T @ [1.0, 1.0j])
    share = np.mean(drawn < SplitWave(2, 1.0, 0.0, complex(errors), 1.0).most)
    assert share == pytest.approx(0.95, abs=0.003)
