"""Stress of the wall under piezo elements against bending of a thin tube without stretching."""

import pytest

from shell import Elastic, solve_modes
from shell.errors import ShellError
from shell.meridian import cylinder
from shell.wall_stress import find_wall_stress


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_thin_tube_bends_around_and_pulls_along_by_poisson(nu):
    """κ = (n² − 1) w/R², straight along: σ_θθ = ± E h κ/(2 (1 − ν²)), σ_φφ = ν σ_θθ, which is ν/(1 + ν) of the sum."""
    R, h, E, n = 12.5e-3, 0.1e-3, 190e9, 2
    (mode,) = solve_modes(cylinder(R, h, 40e-3), Elastic(E=E, nu=nu, rho=8000.0), n)
    outer, inner = (find_wall_stress(mode, 0.4, 0.6, face) for face in ("outer", "inner"))
    expected = E * h * (n**2 - 1) / (2 * (1 - nu**2) * R**2)
    for face in (outer, inner):
        assert abs(face.around) == pytest.approx(expected, rel=0.02)
        assert face.along == pytest.approx(nu * face.around, abs=0.01 * expected)
        assert face.along / face.total == pytest.approx(nu / (1 + nu), abs=0.01)
    assert outer.around * inner.around < 0


def test_no_wall_no_stress():
    (mode,) = solve_modes(cylinder(12.5e-3, 0.1e-3, 40e-3), Elastic(E=190e9, nu=0.3, rho=8000.0))
    with pytest.raises(ShellError, match="between the positions 2 and 3"):
        find_wall_stress(mode, 2.0, 3.0)
