"""Stress of the wall under piezo elements against bending of a thin tube without stretching."""

import pytest

from shell import Elastic, solve_modes
from shell.damping.faces import shell_faces
from shell.errors import ShellError
from shell.meridian import cylinder


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_thin_tube_bends_around_and_pulls_along_by_poisson(nu):
    """κ = (n² − 1) w/R², straight along: σ_θθ = ± E h κ/(2 (1 − ν²)), σ_φφ = ν σ_θθ, which is ν/(1 + ν) of the sum."""
    R, h, E, n = 12.5e-3, 0.1e-3, 190e9, 2
    (mode,) = solve_modes(cylinder(R, h, 40e-3), Elastic(E=E, nu=nu, rho=8000.0), n)
    stresses = [face.mean_stress(0.4, 0.6) for face in shell_faces(mode.solution, mode.resonator)]
    expected = E * h * (n**2 - 1) / (2 * (1 - nu**2) * R**2)
    for along, around in stresses:
        assert abs(around) / mode.largest_displacement == pytest.approx(expected, rel=0.02)
        assert along == pytest.approx(nu * around, abs=0.01 * abs(around))
    assert stresses[0][1] * stresses[1][1] < 0


def test_no_wall_no_stress():
    (mode,) = solve_modes(cylinder(12.5e-3, 0.1e-3, 40e-3), Elastic(E=190e9, nu=0.3, rho=8000.0))
    with pytest.raises(ShellError, match="between the positions 2 and 3"):
        shell_faces(mode.solution, mode.resonator)[0].mean_stress(2.0, 3.0)
