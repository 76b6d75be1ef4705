"""Measured thickness profiles of many points, against elements that break at every point and against kinks in known places."""

from math import pi, sqrt

import numpy as np
import pytest

from shell.assembly import build_system
from shell.fitted import fit_profile
from shell.layout import LEVELS
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.refinement import solve_level
from shell.resonator import Resonator
from tests.shell.samples import SILICA

R = 15e-3


def measured(points: int, noise: float, h: float = 0.9e-3) -> Resonator:
    s = np.linspace(0, 1, points)
    wave = 1 + 0.05 * np.cos(3 * s) + noise * np.random.default_rng(4).standard_normal(points)
    return hemisphere(R, list(zip(s.tolist(), (h * wave).tolist(), strict=True)))


def point_by_point(resonator: Resonator, n: int) -> float:
    """The frequency (Hz) with elements that break at every point of the profile."""
    (solution,), *_ = solve_level(build_system(resonator, n, LEVELS["solid"][0]), R, SILICA, 1, 1e-11)
    return sqrt(solution.eigenvalue) / (2 * pi)


@pytest.mark.parametrize(("h", "noise"), [(0.9e-3, 0.0), (0.9e-3, 1e-4), (0.9e-3, 1e-3), (0.2e-3, 3e-4)])
def test_the_same_frequency_as_with_an_element_between_each_two_points(h: float, noise: float) -> None:
    resonator = measured(31, noise, h)
    (mode,) = solve_modes(resonator, SILICA, 2, tolerance=1e-4)
    assert abs(mode.frequency / point_by_point(resonator, 2) - 1) <= mode.relative_error_estimate


def test_three_hundred_points_need_no_more_unknowns_than_a_constant_wall() -> None:
    (smooth,), (even,) = (solve_modes(one, SILICA, 2) for one in (measured(300, 1e-4), hemisphere(R, 0.9e-3)))
    assert smooth.solution is not None
    assert even.solution is not None
    assert smooth.solution.vector.size <= 1.5 * even.solution.vector.size
    assert smooth.relative_error_estimate < 1e-5


@pytest.mark.slow
def test_a_kink_and_a_step_stay_where_they_are() -> None:
    s = np.array([*np.linspace(0, 0.6, 100), *np.linspace(0.6, 1, 100)[1:]])
    kinked = hemisphere(R, [(x, 0.9e-3 * (1 + 2 * max(x - 0.6, 0.0))) for x in s.tolist()])
    plain = hemisphere(R, [(0.0, 0.9e-3), (0.6, 0.9e-3), (1.0, 1.62e-3)])
    many, few = (solve_modes(one, SILICA, 2)[0].frequency for one in (kinked, plain))
    assert many == pytest.approx(few, rel=1e-9)
    profile = [(x, 0.9e-3 if x < 0.6 else 1.2e-3) for x in np.linspace(0, 1, 51).tolist()]
    stepped = Resonator(
        plain.segments, (*(p for p in profile if p[0] < 0.6), (0.6, 0.9e-3), *(p for p in profile if p[0] >= 0.6))
    )
    step = Resonator(plain.segments, ((0.0, 0.9e-3), (0.6, 0.9e-3), (0.6, 1.2e-3), (1.0, 1.2e-3)))
    many, few = (solve_modes(one, SILICA, 2, tolerance=1e-4)[0].frequency for one in (stepped, step))
    assert many == pytest.approx(few, rel=1e-9)


def test_the_fit_keeps_the_volume_and_scales() -> None:
    resonator = measured(300, 1e-3)
    fitted, rest = fit_profile(resonator)
    assert fitted.pieces
    assert rest is not None
    assert rest.weight @ rest.relative == pytest.approx(0.0, abs=1e-6)
    s = np.linspace(0, fitted.length, 57)
    for other, factor in ((fitted.scaled(1.1), 1.1), (fitted.thickened(1.1), 1.0)):
        assert np.allclose(other.at(factor * s).thickness, 1.1 * fitted.at(s).thickness, rtol=1e-13)
    step = 1e-6 * fitted.length
    numeric = (fitted.at(s[1:-1] + step).thickness - fitted.at(s[1:-1] - step).thickness) / (2 * step)
    assert np.allclose(numeric, fitted.at(s[1:-1]).thickness_slope, atol=1e-8)
