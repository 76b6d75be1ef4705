"""How the solver's error falls with its orders, and whether its own estimate tells that error."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from math import log10, pi, sqrt

import numpy as np
import pytest

from shell.assembly import build_system
from shell.curves import Line
from shell.elastic import Elastic
from shell.levels import LEVELS, Level, Theory
from shell.meridian import bell, cylinder, hemisphere, meridian
from shell.modes import TheoryRangeWarning, solve_modes
from shell.refinement import solve_level
from shell.resonator import Resonator, Stem, Support

SILICA = Elastic(72.7e9, 0.17, 2203.0)


def random_design(rng: np.random.Generator) -> tuple[Resonator, Elastic, int]:
    """Any shape and support, h/R from 0.002 to 0.12."""
    R = 10 ** rng.uniform(-2.3, -1.3)
    h = R * 10 ** rng.uniform(-2.7, -0.92)
    kind, n = rng.integers(13), int(rng.integers(1, 5))
    if kind < 3:
        resonator = hemisphere(R, h, rim_angle=rng.uniform(1, 2.6))
    elif kind < 6:
        resonator = hemisphere(R, [(0, h), (0.5, h * rng.uniform(0.7, 1.3)), (1, h * rng.uniform(0.7, 1.3))])
    elif kind == 6:
        resonator = hemisphere(R, h, pole_angle=rng.uniform(0.2, 0.6), support="clamped-pole")
    elif kind == 7:
        resonator = hemisphere(R, h, pole_angle=rng.uniform(0.2, 0.6), support="clamped-rim")
    elif kind < 10:
        resonator = cylinder(R, h, R * rng.uniform(0.5, 3))
    elif kind < 12:
        resonator = bell(R, h, R * rng.uniform(0.2, 1), R * rng.uniform(0.2, 0.8), R * rng.uniform(1.05, 1.5))
    else:
        stem = Stem(R * rng.uniform(0.12, 0.3), R * rng.uniform(-0.5, 0.4), fillet=R * rng.uniform(0.01, 0.03))
        resonator = hemisphere(R, h, support="stem", stem=stem)
    return resonator, Elastic(7e10, rng.uniform(0, 0.4), 2500.0), n


def random_corner(rng: np.random.Generator) -> tuple[Resonator, Elastic, int]:
    """Singular corners of every kind: sharp stems, cups held or free, kinks between clamped edges; n = 0 too."""
    R = 10 ** rng.uniform(-2.3, -1.3)
    h = R * 10 ** rng.uniform(-2.3, -1.0)
    kind, n = rng.integers(4), int(rng.integers(5))
    if kind == 0:
        resonator = hemisphere(R, h, support="stem", stem=Stem(R * rng.uniform(0.12, 0.3), R * rng.uniform(-0.5, 0.4)))
    elif kind == 1:
        clamp = R * rng.uniform(0.1, 0.4) * rng.integers(2)
        resonator = cylinder(
            R, h, R * rng.uniform(0.8, 2), bottom_thickness=h * rng.uniform(0.8, 2), clamp_radius=clamp
        )
    elif kind == 2:
        edge = R * rng.uniform(0.7, 1.3)
        cone = [Line((0.3 * R, R), (R, 0.5 * R)), Line((R, 0.5 * R), (edge, -0.8 * R))]
        supports: tuple[Support, ...] = ("clamped-pole", "clamped-rim", "free")
        resonator = meridian(cone, h, supports[rng.integers(3)])
    else:
        resonator = hemisphere(R, h, pole_angle=rng.uniform(0.2, 0.6), support="clamped-pole")
    return resonator, Elastic(7e10, rng.uniform(0, 0.4), 2500.0), n


@pytest.mark.parametrize(
    ("design", "theory", "count"),
    [(random_design, "solid", 50), (random_corner, "solid", 15), (random_design, "shell", 30)],
)
def test_error_estimate_is_true_for_random_designs(
    design: Callable[[np.random.Generator], tuple[Resonator, Elastic, int]], theory: Theory, count: int
) -> None:
    """The estimate of random designs lies between 0.1 and 10 times the distance from a level two steps finer."""
    rng = np.random.default_rng(20)
    ratios = []
    for _ in range(count):
        resonator, elastic, n = design(rng)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TheoryRangeWarning)  # shells of 0.12 R
            (mode,) = solve_modes(resonator, elastic, n, theory=theory)
        assert mode.solution is not None
        finer = LEVELS[theory][LEVELS[theory].index(mode.solution.system.level) + 2]
        error = mode.frequency / frequency(resonator, elastic, n, theory, finer) - 1
        assert mode.relative_error_estimate <= 1e-5
        ratios.append(mode.relative_error_estimate / max(abs(error), 1e-12))  # rounding
    assert min(ratios) > 0.1
    assert max(ratios) < 10


def frequency(resonator: Resonator, elastic: Elastic, n: int, theory: Theory, level: Level) -> float:
    """Lowest frequency at one level."""
    (solution,) = solve_level(build_system(resonator, n, theory, level), resonator.size, elastic, 1, 1e-11)
    return sqrt(solution.eigenvalue) / (2 * pi)


@pytest.mark.parametrize("thickness", [0.9e-3, 0.15e-3])
def test_convergence_along_the_meridian_is_exponential(thickness: float) -> None:
    """Each step of two orders gains the same factor, at least three, until rounding."""
    dome = hemisphere(15e-3, thickness)

    def at(along: int) -> float:
        return frequency(dome, SILICA, 2, "shell", replace(LEVELS["shell"][0], along=along))

    best = at(20)
    errors = np.array([abs(at(p) / best - 1) for p in (5, 7, 9, 11)])
    assert np.all(errors[1:] < errors[:-1] / 3)
    assert errors[-1] < 1e-7
    assert np.polyfit((5, 7, 9, 11), np.log10(errors), 1)[0] < -log10(3) / 2


@pytest.mark.parametrize("ratio", [1e-3, 1e-4, 1e-5])
def test_thin_shells_keep_their_digits(ratio: float) -> None:
    """The levels agree to eight digits although λ_min/λ_max is (h/R)² and less; shell and solid agree."""
    thin = hemisphere(15e-3, 15e-3 * ratio)
    solid, shell = (solve_modes(thin, SILICA, theory=theory, tolerance=2e-8)[0] for theory in ("solid", "shell"))
    assert max(solid.relative_error_estimate, shell.relative_error_estimate) < 2e-8
    assert solid.frequency == pytest.approx(shell.frequency, rel=3e-3 * ratio + 2e-8)
