"""Families of designs against full solves that they have not seen, exact scaling, and themselves in other company."""

import pickle
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.family import Axis, build_family
from shell.meridian import bell, cylinder, hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem

NU = (0.15, 0.19)
E, RHO = 72.7e9, 2203.0


def dome(v):
    return hemisphere(15e-3, 1e-3 * v[0])


def stemmed(v):
    """A dome on a stem whose root is filleted: thickness, radius of the dome, of the stem, of the fillet (mm)."""
    return hemisphere(1e-3 * v[1], 1e-3 * v[0], support="stem", stem=Stem(1e-3 * v[2], -5e-3, 1e-3 * v[3]))


def profiled(v):
    """A dome with eight thicknesses along its meridian, linear between them."""
    at = np.linspace(0, 1, len(v))
    return replace(hemisphere(15e-3, 1e-3), thickness=tuple(zip(at.tolist(), (1e-3 * v).tolist(), strict=True)))


KINDS = {
    "dome": (dome, [Axis("h", 0.8, 1.0)], {"theory": "solid", "slopes": True}),
    "dome, wide": (dome, [Axis("h", 0.45, 1.8)], {"tolerance": 3e-6}),
    "dome, n = 3, second mode": (dome, [Axis("h", 0.8, 1.0)], {"theory": "shell", "harmonic": 3, "index": 1}),
    "eight thicknesses": (profiled, [Axis(f"h{k}", 0.89, 0.91) for k in range(8)], {"theory": "shell"}),
    "stem": (
        stemmed,
        [Axis("h", 0.89, 0.91), Axis("R", 14.98, 15.02), Axis("stem", 2.48, 2.52), Axis("fillet", 0.49, 0.51)],
        {},
    ),
    "cup": (
        lambda v: cylinder(12.5e-3, 1e-3 * v[0], 18e-3, bottom_thickness=1e-3 * v[1], clamp_radius=3e-3),
        [Axis("wall", 0.59, 0.61), Axis("bottom", 0.99, 1.01)],
        {},
    ),
    "bell": (
        lambda v: bell(12.5e-3, 1e-3 * v[0], 10e-3, 6e-3, 15e-3, "stem", Stem(3e-3, 22e-3, 0.5e-3, "outer")),
        [Axis("h", 0.79, 0.81)],
        {},
    ),
    "clamped rim": (lambda v: hemisphere(15e-3, 1e-3 * v[0], support="clamped-rim"), [Axis("h", 0.85, 0.95)], {}),
    "clamped pole, open by an angle": (
        lambda v: hemisphere(15e-3, 1e-3 * v[0], pole_angle=v[1], support="clamped-pole"),
        [Axis("h", 0.85, 0.95), Axis("pole", 0.18, 0.22)],
        {},
    ),
}


@cache
def built(kind):
    build, axes, options = KINDS[kind]
    return build, build_family(build, axes, nu=NU, **options)


@pytest.fixture(scope="module")
def solid():
    return built("dome")[1]


def draw(family, inside, corners, seed):
    """Random designs of the whole box and some of its corners: values of the axes, and ν."""
    rng, ranges = np.random.default_rng(seed), [*((axis.low, axis.high) for axis in family.axes), family.nu]
    every = np.array(list(product((-1.0, 1.0), repeat=len(ranges))))
    unit = np.vstack([rng.uniform(-1, 1, (inside, len(ranges))), rng.permutation(every)[:corners]])
    low, high = np.array(ranges).T
    values = (low + high) / 2 + (high - low) / 2 * unit
    return values[:, :-1], values[:, -1]


def solve(build, family, values, nu):
    """A full solve on the elements of the design in the middle, as the family has them."""
    middle = build(np.array([(axis.low + axis.high) / 2 for axis in family.axes]))
    unit = Elastic(1.0, float(np.mean(family.nu)), 1.0)
    modes = solve_modes(middle, unit, family.harmonic, family.index + 1, family.theory, family.solver_tolerance)
    return modes[family.index].solved_on(build(values), Elastic(E, float(nu), RHO))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_errors_stay_below_the_stated_ones(kind):
    build, family = built(kind)
    values, nu = draw(family, 2, 2, 11)
    found = family.evaluate(values, nu=nu, E=E, rho=RHO)
    for k, (v, n) in enumerate(zip(values, nu, strict=True)):
        mode = solve(build, family, v, n)
        assert found.frequency[k] == pytest.approx(mode.frequency, rel=family.error.frequency)
        assert found.bryan_factor[k] == pytest.approx(mode.bryan_factor, abs=family.error.bryan_factor)
        assert mode.relative_error_estimate <= 2 * family.theory_error
        if not np.isnan(family.error.by_nu):
            assert found.by_nu[k] == pytest.approx(mode.sensitivities.nu, abs=family.error.by_nu)
            assert found.by_thickness[k] == pytest.approx(mode.sensitivities.thickness, abs=family.error.by_thickness)
    assert family.error.frequency <= 3e-6


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dome", "stem"])
def test_frequency_holds_both_errors_together_against_finer_solves(kind):
    """What is stated to a user is the family's error and the theory's: together they hold the converged frequency."""
    build, family = built(kind)
    values, nu = draw(family, 3, 2, 7)
    found = family.evaluate(values, nu=nu, E=E, rho=RHO)
    for k, (v, n) in enumerate(zip(values, nu, strict=True)):
        (fine,) = solve_modes(build(v), Elastic(E, float(n), RHO), tolerance=1e-7)
        assert found.frequency[k] == pytest.approx(fine.frequency, rel=family.error.frequency + family.theory_error)


def test_published_reference_of_the_free_hemisphere(solid):
    found = solid.evaluate([[0.9]], nu=0.17, E=E, rho=RHO)
    assert found.frequency[0] == pytest.approx(4596.3915, rel=solid.theory_error + solid.error.frequency)


def test_growth_stiffness_and_density_scale_exactly(solid):
    base = solid.evaluate([[0.85]], nu=0.17, E=E, rho=RHO).frequency
    scaled = solid.evaluate([[0.85]], nu=0.17, E=4 * E, rho=RHO / 4, growth=2.0).frequency
    assert scaled == pytest.approx(2 * base, rel=1e-14)
    mode = solve(lambda v: dome(v).scaled(1.01), solid, [0.85], 0.17)
    grown = solid.evaluate([[0.85]], nu=0.17, E=E, rho=RHO, growth=1.01).frequency[0]
    assert grown == pytest.approx(mode.frequency, rel=solid.error.frequency)


def test_slope_by_the_thickness_is_that_of_the_full_solve(solid):
    values, nu = draw(solid, 5, 0, 4)
    (below, above), found = (
        (solid.evaluate(values * (1 + step), nu=nu, E=E, rho=RHO).frequency for step in (-1e-4, 1e-4)),
        solid.evaluate(values, nu=nu, E=E, rho=RHO),
    )
    assert np.log(above / below) / 2e-4 == pytest.approx(found.by_thickness, rel=2e-5)  # the solver's own differences


def test_a_design_does_not_depend_on_its_company(solid):
    values, nu = draw(solid, 1500, 4, 3)
    found = solid.evaluate(values, nu=nu, E=E, rho=RHO)
    order = np.random.default_rng(4).permutation(len(nu))
    mixed = solid.evaluate(values[order], nu=nu[order], E=E, rho=RHO)
    np.testing.assert_array_equal(mixed.frequency, found.frequency[order])
    copy = pickle.loads(pickle.dumps(solid))
    for k in (0, 1234, len(order) - 1):
        alone = copy.evaluate(values[k : k + 1], nu=nu[k], E=E, rho=RHO)
        assert (alone.frequency[0], alone.bryan_factor[0]) == (found.frequency[k], found.bryan_factor[k])


def test_building_again_gives_the_same_numbers(solid):
    again = build_family(dome, [Axis("h", 0.8, 1.0)], nu=NU, slopes=True)
    np.testing.assert_array_equal(again.polynomial.surpluses, solid.polynomial.surpluses)
    assert again.error == solid.error or repr(again.error) == repr(solid.error)


def test_a_range_of_nothing_takes_no_axis():
    one = build_family(dome, [Axis("h", 0.9, 0.9)], nu=(0.17, 0.17), theory="shell")
    (mode,) = solve_modes(dome([0.9]), Elastic(E, 0.17, RHO), theory="shell")
    assert one.evaluate([[0.9]], nu=0.17, E=E, rho=RHO).frequency[0] == pytest.approx(mode.frequency, rel=1e-9)


@pytest.mark.parametrize(
    ("values", "nu", "message"),
    [
        ([[1.2]], 0.17, "h from 0.8 to 1"),
        ([[0.9]], 0.3, "Poisson"),
        ([[np.nan]], 0.17, "h from"),
        ([[0.9, 1]], 0.17, "axes"),
    ],
)
def test_designs_outside_the_family_are_refused(solid, values, nu, message):
    with pytest.raises(ShellError, match=message):
        solid.evaluate(values, nu=nu, E=E, rho=RHO)


def kinked(v):
    """A design that is no smooth function of its number."""
    return dome([0.9 + 0.05 * abs(v[0] - 0.31)])


@pytest.mark.parametrize(
    ("build", "change", "message"),
    [
        (dome, {"axes": [Axis("h", 1.0, 0.8)]}, "range of h"),
        (dome, {"nu": (0.2, 0.6)}, "Poisson"),
        (dome, {"theory": "rayleigh"}, "theory"),
        (dome, {"tolerance": 0.0}, "tolerance"),
        (dome, {"axes": [Axis("h", 2.0, 4.0)], "theory": "shell"}, "solid theory"),
        (dome, {"axes": [Axis("h", 0.9, 40.0)], "theory": "solid"}, "overlap"),
        (
            dome,
            {"axes": [Axis("h", 0.5, 1.5)], "most": 14},
            "the interpolation error of the frequency .* solve each design in full",
        ),
        (kinked, {"axes": [Axis("v", -1.0, 1.0)], "nu": (0.17, 0.17)}, "solve each design in full"),
    ],
)
def test_impossible_families_are_refused(build, change, message):
    request = {"axes": [Axis("h", 0.8, 1.0)], "nu": NU, "theory": "shell"} | change
    with pytest.raises(ShellError, match=message):
        build_family(build, request.pop("axes"), **request)
