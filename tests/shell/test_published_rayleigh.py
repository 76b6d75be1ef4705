"""The numeric closed form against published values, the symbolic derivation and finite differences."""

import csv
from functools import partial
from math import inf, log, nan, pi, radians
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from shell.derivation import coriolis, frequency
from shell.errors import ShellError
from shell.rayleigh import rayleigh_bryan_factor, rayleigh_frequency, rayleigh_integrals, rayleigh_log_derivatives

REFERENCE = Path(__file__).parents[1] / "reference" / "rayleigh_integrals_exact.csv"
ROWS = list(csv.DictReader(line for line in REFERENCE.read_text().splitlines() if not line.startswith("#")))
SILICA = {"E": 72.7e9, "nu": 0.17, "rho": 2203.0, "h": 0.9e-3, "R": 15e-3}


def test_silica_hemisphere_has_the_published_frequency():
    assert rayleigh_frequency(2, **SILICA) == pytest.approx(5114.35, abs=0.005)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"n={row['n']}")
def test_integrals_and_coefficients_are_the_published_ones(row):
    n = int(row["n"])
    shape = rayleigh_integrals(n)
    assert pytest.approx(float(row["I"]), rel=1e-13) == shape.I
    assert pytest.approx(float(row["J"]), rel=1e-13) == shape.J
    omega = 2 * pi * rayleigh_frequency(n, E=3.0, nu=0.25, rho=1.2, h=0.5, R=2.0)
    assert omega == pytest.approx(float(row["coeff_E"]) * 0.5 / 2**2 * (3.0 / (1.25 * 1.2)) ** 0.5, rel=1e-12)
    if row["bryan_k"]:
        assert rayleigh_bryan_factor(n) == pytest.approx(float(row["bryan_k"]), abs=1e-8)


@pytest.mark.parametrize(("n", "start", "end"), [(2, 0, 60), (3, 10, 90), (4, 0, 130), (6, 25, 100), (2, 0, 5)])
def test_quadrature_agrees_with_the_symbolic_closed_forms(n, start, end):
    exact = [sp.pi * angle / 180 for angle in (start, end)]
    shape = rayleigh_integrals(n, radians(start), radians(end))
    assert pytest.approx(float(frequency.bending_integral(n, *exact).evalf(20)), rel=1e-12) == shape.I
    assert pytest.approx(float(frequency.mass_integral(n, *exact).evalf(20)), rel=1e-12) == shape.J
    K = rayleigh_bryan_factor(n, radians(start), radians(end))
    assert pytest.approx(float(coriolis.bryan_factor(n, *exact).evalf(20)), rel=1e-12) == K


def test_frequency_broadcasts_over_designs():
    thickness = np.linspace(0.5e-3, 1.5e-3, 5)[:, None]
    radius = np.array([10e-3, 15e-3, 20e-3])
    table = rayleigh_frequency(3, SILICA["E"], SILICA["nu"], SILICA["rho"], thickness, radius)
    assert table.shape == (5, 3)
    assert np.allclose(table * radius**2 / thickness, table[0, 0] * radius[0] ** 2 / thickness[0], rtol=1e-14)


@pytest.mark.parametrize(("n", "rim"), [(2, 90.0), (3, 70.0), (5, 110.0)])
def test_log_derivatives_agree_with_finite_differences(n, rim):
    rim = radians(rim)
    analytic = rayleigh_log_derivatives(n, SILICA["nu"], 0.1, rim)

    def log_frequency(**change):
        angles = {"phi_1": 0.1, "phi_2": rim}
        return log(rayleigh_frequency(n, **(SILICA | angles | change)).item())

    step = 1e-4
    for name in ("E", "rho", "h", "R"):
        up, down = (log_frequency(**{name: SILICA[name] * (1 + sign * step)}) for sign in (1, -1))
        assert getattr(analytic, name) == pytest.approx((up - down) / (2 * step), abs=1e-7)
    for name, value in (("nu", SILICA["nu"]), ("phi_2", rim)):
        up, down = (log_frequency(**{name: value + sign * step}) for sign in (1, -1))
        assert getattr(analytic, name) == pytest.approx((up - down) / (2 * step), rel=1e-6)


def test_rim_derivative_agrees_with_the_symbolic_one():
    shape = rayleigh_integrals(4, 0.0, 1.3)
    values = {"I": shape.I, "J": shape.J, "n": 4, "phi_2": 1.3}
    rim = frequency.log_derivatives().phi_2
    symbolic = float(rim.subs({symbol: values[symbol.name] for symbol in rim.free_symbols}))
    assert rayleigh_log_derivatives(4, 0.2, 0.0, 1.3).phi_2 == pytest.approx(symbolic, rel=1e-13)


def test_thermal_expansion_alone_leaves_half_alpha():
    """Free isotropic expansion: h and R grow by α, ρ falls by 3α, so f rises by α/2 (HRG paper eq. (15))."""
    derivative = rayleigh_log_derivatives(2, 0.17)
    assert derivative.h + derivative.R - 3 * derivative.rho == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        *((partial(rayleigh_frequency, n, **SILICA), "harmonic") for n in (0, 1, -2, 2.5)),
        *((partial(rayleigh_bryan_factor, 2, a, b), "phi") for a, b in ((-0.1, 1), (1, 1), (0, pi), (0, nan))),
        (partial(rayleigh_frequency, 2, **SILICA | {"E": 0.0}), "modulus must be positive"),
        (partial(rayleigh_frequency, 2, **SILICA | {"nu": 0.5}), "ratio must lie between"),
        (partial(rayleigh_frequency, 2, **SILICA | {"rho": -1.0}), "density must be positive"),
        (partial(rayleigh_frequency, 2, **SILICA | {"h": nan}), "thickness must be positive and finite"),
        (partial(rayleigh_frequency, 2, **SILICA | {"R": inf}), "radius must be positive and finite"),
        (partial(rayleigh_integrals, 30, 0.0, 1e-9), "too small"),
    ],
)
def test_what_has_no_closed_form_is_refused(call, words):
    with pytest.raises(ShellError, match=words):
        call()
