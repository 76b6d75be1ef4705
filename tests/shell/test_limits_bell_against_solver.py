"""The bell's assumed pattern (BVG paper eq. (19)) and a true inextensional one, held against the shell solver."""

from math import sqrt

import pytest

from shell.bell_theory import inextensional_functions, rayleigh_functions, two_pattern_model
from shell.elastic import Elastic
from shell.meridian import bell
from shell.modes import solve_modes

ALLOY = Elastic(E=190e9, nu=0.3, rho=8000.0)


def bell_of(thickness):
    return bell(radius=12.5e-3, thickness=thickness, cylinder_height=10e-3, hyperbola_height=6e-3, mouth_radius=15e-3)


def test_on_the_bell_19_is_wrong_by_two_orders_in_frequency_and_half_in_precession():
    """(19) folds the bell at both ends of the cylinder, so it is no bound there; the inextensional pattern is one."""
    shell = bell_of(0.8e-3)
    (mode,) = solve_modes(shell, ALLOY, harmonic=2, theory="shell")
    inextensional = two_pattern_model(shell, ALLOY, inextensional_functions)
    assert mode.frequency < inextensional.frequency < 1.3 * mode.frequency
    assert inextensional.bryan_factor == pytest.approx(mode.bryan_factor, rel=0.02)
    assert two_pattern_model(shell, ALLOY, rayleigh_functions).frequency > 100 * mode.frequency
    assert two_pattern_model(shell, ALLOY, rayleigh_functions).bryan_factor < 0.5 * mode.bryan_factor


def test_inextensional_pattern_of_the_bell_closes_on_the_solver_like_the_root_of_the_thickness():
    """The free edge costs √(h/R) with a coefficient near 0.27, as on the hemisphere; precession agrees much sooner."""
    excess = []
    for thickness in (0.05e-3, 0.0125e-3):
        shell = bell_of(thickness)
        (mode,) = solve_modes(shell, ALLOY, harmonic=2, theory="shell")
        model = two_pattern_model(shell, ALLOY, inextensional_functions)
        excess.append((model.frequency / mode.frequency - 1) / sqrt(thickness / 12.5e-3))
        assert model.bryan_factor == pytest.approx(mode.bryan_factor, abs=2e-5)
    assert 0.2 < excess[1] < excess[0] < 0.35
