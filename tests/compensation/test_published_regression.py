"""NIST's certified linear regressions, through the least squares that every model here uses."""

import re
from pathlib import Path

import numpy as np
import pytest

from compensation.polynomial import fit_polynomial
from compensation.regression import fit_linear

REFERENCE = Path(__file__).parents[1] / "reference"
DIGITS = 9


def read(name):
    lines = (REFERENCE / name).read_text().splitlines()
    comments = [line[1:] for line in lines if line.startswith("#")]
    rows = [line for line in lines if not line.startswith("#")]
    return comments, rows[0].split(","), np.array([[float(v) for v in row.split(",")] for row in rows[1:]])


def correct_digits(values, certified):
    certified = np.asarray(certified)
    return np.min(-np.log10(np.maximum(np.abs(values - certified) / np.abs(certified), 1e-17)))


def test_longley():
    comments, header, data = read("nist_longley.csv")
    certified, deviations = ([float(v) for v in comments[k].split()] for k in (2, 4))
    fit = fit_linear(data[:, 1:], data[:, 0], header[1:])
    assert correct_digits(fit.coefficients, certified) > DIGITS
    assert correct_digits(fit.standard_errors, deviations) > DIGITS
    assert correct_digits(fit.r_squared, 0.995479004577296) > DIGITS


def test_filip():
    """Degree 10 over −9…−3: the scaled variable keeps the digits that powers of x lose."""
    comments, _, data = read("nist_filip.csv")
    certified = np.array([re.findall(r"= (\S+), standard deviation (\S+)", c)[0] for c in comments[1:]], float)
    coefficients, covariance = fit_polynomial(data[:, 1], data[:, 0], 10).about(0.0)
    assert correct_digits(coefficients, certified[:, 0]) > DIGITS
    assert correct_digits(np.sqrt(np.diag(covariance)), certified[:, 1]) > DIGITS


@pytest.mark.parametrize(("column", "factor"), [(1, 1.0), (2, 100.0)], ids=["Wampler4", "Wampler5"])
def test_wampler(column, factor):
    comments, _, data = read("nist_wampler.csv")
    deviations = factor * np.array([float(v) for v in re.findall(r"\d+\.\d+", comments[1].split("Wampler4:")[1])])
    x, y = data[:, 0], data[:, column]
    coefficients, covariance = fit_polynomial(x, y, 5).about(0.0)
    assert correct_digits(coefficients, np.ones(6)) > DIGITS
    assert correct_digits(np.sqrt(np.diag(covariance)), deviations) > DIGITS
    # The same as a general regression on five columns.
    fit = fit_linear(np.column_stack([x**k for k in range(1, 6)]), y, [f"x{k}" for k in range(1, 6)])
    assert correct_digits(fit.coefficients, np.ones(6)) > DIGITS
    assert correct_digits(fit.standard_errors, deviations) > DIGITS
