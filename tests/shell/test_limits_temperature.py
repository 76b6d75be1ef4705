"""Exact limits of the temperature slope: in the thin limit f measures G, and the parts add up to the whole."""

import numpy as np
import pytest

from shell.elastic import Elastic
from shell.materials import constant_material, find_material
from shell.meridian import hemisphere
from shell.temperature import (
    frequency_over_temperature,
    mode_model,
    over_poisson_ratio,
    temperature_coefficients,
)

MODEL = mode_model(hemisphere(15e-3, 0.9e-3), theory="rayleigh")


@pytest.mark.parametrize("law", ["spinner", "gwinc", "drawn-fibre"])
def test_inextensional_slope_is_half_that_of_g_plus_half_alpha(law):
    """Theory of HRG paper eq. (15) with free isotropic expansion: TCF = ½ G'/G + ½ alpha."""
    material = find_material("fused-silica", law)
    for c in temperature_coefficients(MODEL, material, 293.15, np.array([263.15, 293.15, 313.15])):
        expected = 0.5 * material.log_slope("shear_modulus", c.temperature) + 0.5 * float(
            material.value("expansion", c.temperature)
        )
        assert c.total == pytest.approx(expected, rel=1e-7)


def test_parts_add_up_to_the_slope_of_the_frequency_itself():
    material = find_material("fused-silica")
    c = temperature_coefficients(MODEL, material, 293.15, 298.15)[0]
    low, middle, high = frequency_over_temperature(MODEL, material, 293.15, np.array([297.65, 298.15, 298.65]))
    assert c.total == pytest.approx((high - low) / middle, rel=1e-6)
    assert c.frequency == pytest.approx(middle, rel=1e-14)


def test_constant_material_has_no_slope_and_no_uncertainty():
    c = temperature_coefficients(MODEL, constant_material("m", 70e9, 0.3, 2700.0), 293.15, 300.0)[0]
    assert c.total == 0
    assert c.uncertainty == 0


def test_uncertainty_agrees_with_a_monte_carlo_over_the_law():
    material = find_material("fused-silica")
    c = temperature_coefficients(MODEL, material, 293.15, 293.15)[0]
    rng = np.random.default_rng(11)
    slopes = []
    for _ in range(400):
        drawn = material
        for name, number, u in material.uncertain_numbers():
            if name in ("conductivity", "heat_capacity"):
                continue
            value = material.properties[name].numbers[number]
            drawn = drawn.with_number(name, number, value + u * rng.normal())
        slopes.append(0.5 * drawn.log_slope("shear_modulus", 293.15) + 0.5 * float(drawn.value("expansion", 293.15)))
    assert np.std(slopes) == pytest.approx(c.uncertainty, rel=0.12)


@pytest.mark.parametrize("model", [MODEL, mode_model(hemisphere(15e-3, 0.9e-3))], ids=["rayleigh", "solid"])
def test_interpolation_over_poisson_ratio_equals_direct_solves(model):
    table = over_poisson_ratio(model, 0.163, 0.171)
    for nu in (0.163, 0.1642, 0.169, 0.171):
        direct, quick = model(Elastic(72e9, nu, 2203.0)), table(Elastic(72e9, nu, 2203.0))
        assert quick.frequency == pytest.approx(direct.frequency, rel=1e-7)
        assert (quick.nu, quick.h) == pytest.approx((direct.nu, direct.h), abs=1e-5)


def test_a_constant_poisson_ratio_needs_one_solve():
    material = constant_material("m", 72e9, 0.17, 2203.0)
    solves = []

    def model(elastic):
        solves.append(elastic)
        return MODEL(elastic)

    found = frequency_over_temperature(model, material, 293.15, np.linspace(260.0, 320.0, 9))
    np.testing.assert_allclose(found, MODEL(material.elastic(293.15)).frequency, rtol=1e-12)
    assert len(solves) == 1
