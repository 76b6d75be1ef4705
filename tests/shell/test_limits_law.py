"""The frequency law in its exact limits: f measures G in thin shells, parts add up, derivatives are those of the law itself."""

import numpy as np
import pytest

from shell import law as law_module
from shell.errors import ShellError
from shell.law import build_law
from shell.material import constant_material
from shell.materials import find_material
from shell.modes import solve_modes
from tests.shell.samples import DOME

SILICA = find_material("fused-silica")
LAWS = ("spinner", "gwinc", "drawn-fibre")
T0 = 293.15


@pytest.fixture(scope="module")
def silica():
    return build_law(DOME, SILICA, T0, 243.15, 333.15)


def thin(material, lowest=263.15, highest=313.15):
    return build_law(DOME, material, T0, lowest, highest, theory="rayleigh")


@pytest.mark.parametrize("name", LAWS)
def test_inextensional_slope_is_half_that_of_g_plus_half_alpha(name):
    """Theory of HRG paper eq. (15) with free isotropic expansion: TCF = ½ G'/G + ½ alpha."""
    material = find_material("fused-silica", name)
    T = np.array([263.15, 293.15, 313.15])
    expected = 0.5 * material.log_slope("shear_modulus", T) + 0.5 * material.value("expansion", T)
    assert thin(material).parts(T).total == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("harmonic", [2, 3])
def test_the_law_is_the_solver_at_temperatures_that_it_has_not_seen(harmonic):
    law = build_law(DOME, SILICA, T0, 243.15, 333.15, harmonic=harmonic)
    for T in (244.0, 281.0, 331.0):
        growth = float(SILICA.growth(T, T0))
        (mode,) = solve_modes(DOME.scaled(growth), SILICA.elastic(T), harmonic)
        assert law.frequency(T) == pytest.approx(mode.frequency, rel=max(law.interpolation_error, 1e-10))
    assert law.interpolation_error < 2e-9
    assert law.solver_error < 1e-5


def test_parts_add_up_to_the_slope_of_the_frequency_itself(silica):
    T = np.array([250.0, 298.15, 330.0])
    by_frequency = np.log(silica.frequency(T + 0.5) / silica.frequency(T - 0.5))
    assert silica.parts(T).total == pytest.approx(by_frequency, rel=1e-6)
    assert silica.slope(T) == pytest.approx(silica.parts(T).total, rel=1e-8)
    assert silica.sensitivity().sum() == pytest.approx(float(silica.slope(T0)), rel=1e-7)


def test_a_single_temperature_takes_a_single_solve(silica, monkeypatch):
    solves = []
    monkeypatch.setattr(law_module, "solve_modes", lambda *a, **k: solves.append(a) or solve_modes(*a, **k))
    point = build_law(DOME, SILICA, T0, 310.0, 310.0)
    assert len(solves) == 1
    assert point.frequency(310.0) == pytest.approx(silica.frequency(310.0), rel=1e-8)
    assert point.parts(310.0).total == pytest.approx(silica.parts(310.0).total, rel=1e-7)
    rigid = constant_material("m", 72e9, 0.17, 2203.0)
    found = build_law(DOME, rigid, T0, 260.0, 320.0)
    assert len(solves) == 2
    assert np.ptp(found.frequency(np.linspace(260.0, 320.0, 9))) < 1e-8
    assert found.slope_uncertainty(300.0) == 0


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_by_coefficients_are_those_of_the_moved_law(name):
    """Every coefficient of every law, by central differences of a law with the moved material; no new solve."""
    material = find_material("fused-silica", name).rescaled(288.15)
    law = build_law(DOME, material, 288.15, 243.15, 333.15)
    T = np.array([255.0, 288.15, 330.0])
    derivatives = law.derivatives(T)
    assert {key for key in material.prior.names if key.split(".")[0] not in ("conductivity", "heat_capacity")} <= set(
        derivatives
    )
    for key, value in derivatives.items():
        step = 10.0 ** {"v": -3, "s": -6, "c": -8}[key.split(".")[1].removeprefix("log_")[0]]
        step *= 1e-4 if key.startswith("expansion") else 1.0
        up, down = (law.with_material(material.with_coefficients({key: s * step})).logarithm(T) for s in (1, -1))
        assert value == pytest.approx((up - down) / (2 * step), rel=1e-6, abs=1e-6 * float(abs(value).max()))


def test_a_moved_law_is_the_solver_with_the_moved_material(silica):
    moved = SILICA.with_coefficients(
        {"shear_modulus.log_slope_per_K": 2e-5, "poisson_ratio.value": 0.01, "expansion.slope_per_K": 2e-9}
    )
    (mode,) = solve_modes(DOME.scaled(float(moved.growth(320.0, T0))), moved.elastic(320.0))
    assert silica.with_material(moved).frequency(320.0) == pytest.approx(mode.frequency, rel=2e-9)
    with pytest.raises(ShellError, match="build the law anew"):
        silica.with_material(SILICA.with_coefficients({"poisson_ratio.value": 0.1}))


def test_uncertainties_agree_with_a_monte_carlo_over_the_prior(silica):
    """400 laws drawn from the prior: the spread of the thin-limit slope and of ln f at two temperatures."""
    law, T = thin(SILICA, 243.15, 333.15), np.array([253.15, 293.15, 323.15])
    prior, rng = SILICA.prior, np.random.default_rng(11)
    draws = rng.multivariate_normal(np.zeros(len(prior.names)), prior.covariance, 400)
    slopes, values = [], []
    for draw in draws:
        drawn = SILICA.with_coefficients(dict(zip(prior.names, draw, strict=True)))
        slopes.append(0.5 * drawn.log_slope("shear_modulus", T) + 0.5 * drawn.value("expansion", T))
        G, rho = drawn.value("shear_modulus", T), drawn.value("density", T)
        values.append(0.5 * np.log(G / rho) - np.log(drawn.growth(T, T0)))
    assert np.std(slopes, axis=0) == pytest.approx(law.slope_uncertainty(T), rel=0.12)
    assert np.std(values, axis=0) == pytest.approx(law.uncertainty(T), rel=0.12)


def test_a_temperature_outside_is_refused_and_continued_only_when_asked(silica):
    with pytest.raises(ShellError, match=r"reaches -40\.00 .* known from -30\.00 to 60\.00"):
        silica.frequency(np.array([233.15, 300.0]))
    beyond = silica.frequency(242.0, extrapolate=True)
    assert beyond == pytest.approx(build_law(DOME, SILICA, T0, 242.0, 242.0).frequency(242.0), rel=1e-8)
    with pytest.raises(ShellError, match="outside the range"):
        build_law(DOME, SILICA, T0, 500.0, 600.0)
