"""Families of resonators with solid parts (stems, corners, clamped edges) against the full solve of each design."""

import pickle
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.family import build_family
from shell.meridian import bell, cylinder, hemisphere
from shell.modes import solve_modes
from shell.profiles import Profiles
from shell.resonator import Stem

TILT = ((0.0, -1.0), (1.0, 1.0))
CUP = cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3)
FOOT = CUP.thickness[1][0]
WALL = ((0.0, 0.0), (FOOT, 0.0), (FOOT, 1.0), (1.0, 1.0))
STEMMED = hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3))
KINDS = {
    "stem": (STEMMED, {"thickness": (0.88e-3, 0.92e-3), "stem": (0.99, 1.01), "shapes": (TILT,), "amplitude": 0.02}),
    "corner and clamped face": (CUP, {"thickness": (0.99e-3, 1.01e-3), "shapes": (WALL,), "amplitude": 0.02}),
    "outer stem of a bell": (
        bell(12.5e-3, 0.8e-3, 10e-3, 6e-3, 15e-3, "stem", Stem(3e-3, 22e-3, 0.5e-3, "outer")),
        {"thickness": (0.79e-3, 0.81e-3)},
    ),
    "clamped rim": (hemisphere(15e-3, 0.9e-3, support="clamped-rim"), {"thickness": (0.85e-3, 0.95e-3)}),
    "clamped pole": (
        hemisphere(15e-3, 0.9e-3, pole_angle=0.2, support="clamped-pole"),
        {"thickness": (0.85e-3, 0.95e-3)},
    ),
}


@pytest.fixture(scope="module", params=KINDS)
def built(request):
    resonator, ranges = KINDS[request.param]
    return resonator, ranges, build_family(resonator, nu=(0.16, 0.18), tolerance=1e-6, **ranges)


def draw(family, count, seed):
    """Random designs of the whole box and all corners."""
    rng = np.random.default_rng(seed)
    d = family.shape_count + 3
    unit = np.vstack([rng.uniform(-1, 1, (count, d)), list(product((-1, 1), repeat=d))])

    def within(span, column):
        return (span[0] + span[1]) / 2 + (span[1] - span[0]) / 2 * unit[:, column]

    return {
        "thickness": within(family.thickness, 0),
        "nu": within(family.nu, 1),
        "stem": within(family.stem, 2),
        "shapes": family.amplitude * unit[:, 3:],
    }


def test_error_stays_below_the_stated_one(built):
    _, _, family = built
    designs = draw(family, 8, 3)
    found = family.evaluate(**designs, E=1.0, rho=1.0)
    full = replace(family, tolerance=1e-15).evaluate(**designs, E=1.0, rho=1.0)
    assert np.all(full.solved_in_full)
    assert not np.any(found.solved_in_full)
    error = abs(found.frequency / full.frequency - 1)
    assert np.all(error <= found.relative_error_estimate + full.relative_error_estimate)
    assert np.all(found.relative_error_estimate <= family.tolerance)
    assert np.max(error) > 0.01 * np.max(found.relative_error_estimate)  # the statement says something


def test_same_frequencies_as_the_kernel_with_cells_of_its_own(built):
    """The full solve lays out every design by itself and condenses nothing."""
    resonator, ranges, family = built
    designs = draw(family, 2, 4)
    profiles = Profiles.of(resonator, ranges.get("shapes", ()))
    found = family.evaluate(**designs, E=1.0, rho=1.0)
    for k in (0, 1, 2, len(found.frequency) - 1):
        design = profiles.build(designs["thickness"][k], designs["shapes"][k], designs["stem"][k])
        (mode,) = solve_modes(design, Elastic(1.0, designs["nu"][k], 1.0), tolerance=1e-6)
        allowed = found.relative_error_estimate[k] + found.theory_error + 2 * mode.relative_error_estimate
        assert found.frequency[k] == pytest.approx(mode.frequency, rel=allowed)


@pytest.fixture(scope="module")
def stemmed():
    return build_family(STEMMED, thickness=(0.895e-3, 0.905e-3), nu=(0.168, 0.172), stem=(0.99, 1.01))


def test_a_larger_dome_on_the_same_stem(stemmed):
    """Only the dome's radius grows: the stem is smaller beside it, and the thickness over the radius too."""
    radius = 15e-3 * 1.004
    larger = hemisphere(radius, 0.9e-3, support="stem", stem=STEMMED.stem)
    (mode,) = solve_modes(larger, Elastic(72.7e9, 0.17, 2203.0), tolerance=1e-6)
    found = stemmed.evaluate(thickness=0.9e-3, radius=radius, stem=1 / 1.004, nu=0.17, E=72.7e9, rho=2203.0)
    allowed = found.relative_error_estimate[0] + found.theory_error + 2 * mode.relative_error_estimate
    assert found.frequency[0] == pytest.approx(mode.frequency, rel=allowed)


def test_growth_of_every_length_scales_exactly(stemmed):
    design = {"nu": 0.17, "E": 72.7e9, "rho": 2203.0}
    one = stemmed.evaluate(thickness=0.9e-3, **design).frequency
    two = stemmed.evaluate(thickness=1.8e-3, radius=30e-3, **design).frequency
    assert two == pytest.approx(one / 2, rel=1e-13)


def test_a_design_does_not_depend_on_its_company(stemmed):
    designs = draw(stemmed, 1500, 5)
    found = stemmed.evaluate(**designs, E=1.0, rho=1.0)
    order = np.random.default_rng(6).permutation(len(designs["nu"]))
    mixed = stemmed.evaluate(**{name: values[order] for name, values in designs.items()}, E=1.0, rho=1.0)
    np.testing.assert_array_equal(mixed.frequency, found.frequency[order])
    copy = pickle.loads(pickle.dumps(stemmed))
    alone = copy.evaluate(**{name: values[700:701] for name, values in designs.items()}, E=1.0, rho=1.0)
    assert alone.frequency[0] == found.frequency[700]


def test_what_polynomials_cannot_hold_is_solved_in_full_and_says_so():
    family = build_family(STEMMED, thickness=(0.8e-3, 1e-3), nu=(0.15, 0.19), harmonic=1)
    assert "solid parts" in family.reason
    found = family.evaluate(thickness=0.85e-3, nu=0.17, E=72.7e9, rho=2203.0)
    (mode,) = solve_modes(STEMMED.thickened(0.85 / 0.9), Elastic(72.7e9, 0.17, 2203.0), 1, tolerance=family.tolerance)
    assert found.solved_in_full[0]
    assert found.frequency[0] == pytest.approx(mode.frequency, rel=1e-9)


@pytest.mark.parametrize(("resonator", "stem"), [(STEMMED, (1.1, 1.2)), (STEMMED, (-1.0, 1.0)), (CUP, (0.9, 1.1))])
def test_impossible_ranges_of_the_stem_are_refused(resonator, stem):
    with pytest.raises(ShellError, match="stem"):
        build_family(resonator, thickness=(0.8e-3, 1e-3), nu=(0.15, 0.19), stem=stem)


def test_a_step_of_a_shape_becomes_a_step_of_the_profile():
    built = Profiles.of(CUP, (WALL,)).build(1e-3, np.array([0.05]))
    assert built.at([0.999 * FOOT * CUP.length]).thickness[0] == pytest.approx(1e-3)
    assert built.at([1.001 * FOOT * CUP.length]).thickness[0] == pytest.approx(0.65e-3)


def test_a_smooth_shape_reaches_the_thickness_and_its_slope():
    built = Profiles.of(STEMMED, (np.sin,)).build(1e-3, np.array([0.1]))
    there = built.at([0.3 * STEMMED.length])
    assert there.thickness[0] == pytest.approx(1e-3 * (1 + 0.1 * np.sin(0.3)), rel=1e-12)
    assert there.thickness_slope[0] == pytest.approx(1e-4 * np.cos(0.3) / STEMMED.length, rel=1e-8)
