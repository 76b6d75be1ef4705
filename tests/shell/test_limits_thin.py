"""Shells so thin that double precision loses digits of the frequency: the stated error knows how many."""

import warnings
from math import pi, sqrt

import numpy as np
import pytest

from shell.layout import Theory
from shell.meridian import cylinder
from shell.modes import TheoryRangeWarning, solve_modes
from tests.shell.samples import SILICA

RADII = 15e-3 * (1 + 0.137 * np.arange(6))  # the same problem with other rounding errors


def over_limit(ratio: float, radius: float, theory: Theory, tolerance: float = 1e-5) -> tuple[float, float]:
    """Frequency of the free tube of length 2 R over its inextensional limit, and its stated error.

    The ovalling of a ring in plane strain (Rayleigh 1894, § 233), n = 2: ω² = E h² n² (n² - 1)² / (12 (1 - ν²) ρ R⁴ (n² + 1)).
    """
    elastic = SILICA
    limit = sqrt(elastic.E / elastic.rho * 36 / 5 / (12 * (1 - elastic.nu**2))) * ratio / radius / (2 * pi)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TheoryRangeWarning)  # the tolerance is out of reach
        (mode,) = solve_modes(cylinder(radius, ratio * radius, 2 * radius), elastic, theory=theory, tolerance=tolerance)
    return mode.frequency / limit, mode.relative_error_estimate


@pytest.mark.parametrize("theory", ["solid", "shell"])
def test_stated_error_tells_the_digits_that_rounding_takes(theory: Theory) -> None:
    """The layers at the edges take off a share c √(h/R); c follows from h/R where nothing is lost."""
    (thick, _), (thin, stated) = (over_limit(ratio, RADII[0], theory, 1e-8) for ratio in (1e-3, 1e-4))
    assert stated < 1e-8  # nothing is lost at 1e-4
    c = (1 - thin) / sqrt(1e-4)
    assert (1 - thick) / sqrt(1e-3) == pytest.approx(c, rel=2e-3)  # so the limit and the power are these
    worst = []
    for ratio in (1e-6, 6.7e-7, 3e-7):
        found, stated_errors = np.array([over_limit(ratio, radius, theory) for radius in RADII]).T
        errors = abs(found / (1 - c * sqrt(ratio)) - 1)
        assert np.all(stated_errors < 10 * errors + 1e-6)
        assert np.all(stated_errors > 0.1 * errors - 1e-7)
        worst.append(errors.max())
    assert worst[0] > 1e-6  # digits are lost here
    assert worst[-1] > 1e-4
