"""Families of designs against full solves, the kernel, exact scaling, and themselves in other company."""

import pickle
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.family import build_family
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.profiles import Profiles
from shell.resonator import Resonator

NOMINAL = hemisphere(15e-3, 0.9e-3)
TILT = ((0.0, -1.0), (1.0, 1.0))
HAT = ((0.0, 0.0), (0.5, 1.0), (1.0, 0.0))
E, RHO = 72.7e9, 2203.0


@pytest.fixture(scope="module")
def shell_family():
    return build_family(NOMINAL, thickness=(0.6e-3, 1e-3), nu=(0.14, 0.20), shapes=(TILT, HAT), theory="shell")


@pytest.fixture(scope="module")
def solid_family():
    return build_family(NOMINAL, thickness=(0.8e-3, 1e-3), nu=(0.15, 0.19), shapes=(TILT,), tolerance=1e-6)


def draw(family, count, seed):
    """Random designs of the whole box, many of them on its faces, and all corners."""
    rng = np.random.default_rng(seed)
    d = family.shape_count + 2
    unit = np.vstack(
        [
            rng.uniform(-1, 1, (count, d)),
            np.clip(rng.uniform(-2, 2, (count, d)), -1, 1),
            list(product((-1, 1), repeat=d)),
        ]
    )
    (thin, thick), (low, high) = family.thickness, family.nu
    return {
        "thickness": (thin + thick) / 2 + (thick - thin) / 2 * unit[:, 0],
        "shapes": family.amplitude * unit[:, 1:-1],
        "nu": (low + high) / 2 + (high - low) / 2 * unit[:, -1],
    }


def solve_in_full(family, designs):
    """Frequencies of the same designs by the full solve of the same discretisation."""
    return replace(family, tolerance=1e-15).evaluate(**designs, E=E, rho=RHO)


@pytest.mark.parametrize(("name", "count"), [("shell_family", 150), ("solid_family", 60)])
def test_error_stays_below_the_stated_one(request, name, count):
    family = request.getfixturevalue(name)
    designs = draw(family, count, 11)
    found, full = family.evaluate(**designs, E=E, rho=RHO), solve_in_full(family, designs)
    assert np.all(full.solved_in_full)
    assert not np.any(found.solved_in_full)
    error = abs(found.frequency / full.frequency - 1)
    assert np.all(error <= found.relative_error_estimate)
    assert np.all(found.relative_error_estimate <= family.tolerance)
    assert np.max(error) > 0.01 * np.max(found.relative_error_estimate)  # the statement says something


@pytest.mark.parametrize(("name", "theory"), [("shell_family", "shell"), ("solid_family", "solid")])
def test_same_frequencies_as_the_kernel(request, name, theory):
    family = request.getfixturevalue(name)
    designs = draw(family, 3, 5)
    found = family.evaluate(**designs, E=E, rho=RHO)
    profiles = Profiles.of(NOMINAL, (TILT, HAT)[: family.shape_count])
    for k in range(0, 10, 2):
        resonator = profiles.build(designs["thickness"][k], designs["shapes"][k])
        (mode,) = solve_modes(resonator, Elastic(E, designs["nu"][k], RHO), theory=theory, tolerance=1e-6)
        allowed = found.relative_error_estimate[k] + found.theory_error + 2 * mode.relative_error_estimate
        assert found.frequency[k] == pytest.approx(mode.frequency, rel=allowed)


def test_published_reference_of_the_free_hemisphere(solid_family):
    found = solid_family.evaluate(thickness=0.9e-3, nu=0.17, E=E, rho=RHO)
    assert found.frequency[0] == pytest.approx(4596.3915, rel=found.theory_error + found.relative_error_estimate[0])


def test_radius_stiffness_and_density_scale_exactly(shell_family):
    base = shell_family.evaluate(thickness=0.8e-3, shapes=[0.05, -0.02], nu=0.17, E=E, rho=RHO).frequency
    scaled = shell_family.evaluate(thickness=1.6e-3, shapes=[0.05, -0.02], nu=0.17, E=4 * E, rho=RHO / 4, radius=30e-3)
    assert scaled.frequency == pytest.approx(2 * base, rel=1e-14)


def test_a_design_does_not_depend_on_its_company(shell_family):
    designs = draw(shell_family, 1500, 3)
    found = shell_family.evaluate(**designs, E=E, rho=RHO)
    order = np.random.default_rng(4).permutation(len(designs["nu"]))
    mixed = shell_family.evaluate(**{name: values[order] for name, values in designs.items()}, E=E, rho=RHO)
    np.testing.assert_array_equal(mixed.frequency, found.frequency[order])
    np.testing.assert_array_equal(mixed.relative_error_estimate, found.relative_error_estimate[order])
    for k in (0, 1234, len(order) - 1):
        alone = shell_family.evaluate(**{name: values[k : k + 1] for name, values in designs.items()}, E=E, rho=RHO)
        assert alone.frequency[0] == found.frequency[k]


def test_a_copy_in_another_process_is_the_same(shell_family):
    copy = pickle.loads(pickle.dumps(shell_family))
    design = {"thickness": 0.77e-3, "shapes": [0.01, 0.03], "nu": 0.16, "E": E, "rho": RHO}
    assert copy.evaluate(**design).frequency == shell_family.evaluate(**design).frequency


def test_building_again_gives_the_same_numbers():
    def first():
        family = build_family(NOMINAL, thickness=(0.85e-3, 0.95e-3), nu=(0.16, 0.18), theory="shell")
        return family.evaluate(thickness=0.88e-3, nu=0.165, E=E, rho=RHO).frequency[0]

    assert first() == first()


def test_designs_beyond_the_tolerance_are_solved_in_full(shell_family):
    designs = draw(shell_family, 30, 8)
    loose = shell_family.evaluate(**designs, E=E, rho=RHO)
    limit = float(np.median(loose.relative_error_estimate))
    strict = replace(shell_family, tolerance=limit).evaluate(**designs, E=E, rho=RHO)
    np.testing.assert_array_equal(strict.solved_in_full, loose.relative_error_estimate > limit)
    full = solve_in_full(shell_family, designs)
    chosen = strict.solved_in_full
    np.testing.assert_array_equal(strict.frequency[chosen], full.frequency[chosen])
    np.testing.assert_array_equal(strict.frequency[~chosen], loose.frequency[~chosen])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"thickness": 1.2e-3}, "thickness"),
        ({"nu": 0.3}, "Poisson"),
        ({"shapes": [0.2, 0.0]}, "amplitude"),
        ({"shapes": [0.0]}, "2 shapes"),
        ({"E": -1.0}, "positive"),
        ({"thickness": np.nan}, "thickness"),
    ],
)
def test_designs_outside_the_family_are_refused(shell_family, change, message):
    design = {"thickness": 0.8e-3, "nu": 0.17, "E": E, "rho": RHO} | change
    with pytest.raises(ShellError, match=message):
        shell_family.evaluate(**design)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"thickness": (1e-3, 0.8e-3)}, "thickness"),
        ({"nu": (0.2, 0.6)}, "Poisson"),
        ({"amplitude": 1.5}, "amplitude"),
        ({"theory": "rayleigh"}, "theory"),
        ({"harmonic": 1}, "harmonic"),
        ({"shapes": (((0.0, 1.0), (0.5, 1.0)),)}, "positions"),
        ({"shapes": (TILT,) * 3, "amplitude": 0.4}, "zero"),
        ({"shapes": (TILT,) * 7}, "at most"),
    ],
)
def test_impossible_families_are_refused(change, message):
    request = {"thickness": (0.8e-3, 1e-3), "nu": (0.15, 0.19)} | change
    with pytest.raises(ShellError, match=message):
        build_family(NOMINAL, **request)


def test_profiles_add_up():
    profiles = Profiles.of(Resonator(NOMINAL.segments, ((0.0, 0.5e-3), (1.0, 1e-3))), (HAT,))
    built = profiles.build(2e-3, np.array([0.1]))
    assert built.thickness == ((0.0, pytest.approx(1e-3)), (0.5, pytest.approx(1.7e-3)), (1.0, pytest.approx(2e-3)))
