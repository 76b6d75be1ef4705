"""Least squares in white noise and a walk, against the dense covariance of the one noise."""

import numpy as np
import pytest

from compensation.noise import Noise
from compensation.noise_regression import coloured_covariance, fit_coloured, restricted_deviance, whiten
from compensation.regression import fit_linear

RUNS = [slice(0, 70), slice(70, 120)]
TIMES = [30.0 * np.arange(70), 30.0 * np.arange(50)]
THETAS = (0.999, 0.8, 0.3, 0.0, -0.2)


def noise_of(theta, step=1.0):
    """Levels of the noise of a θ with innovations of 1 in rows of one step (s): N² = Δ (θ + (1 − θ)²/6), K² = (1 − θ)²/Δ."""
    white = max(theta + (1.0 - theta) ** 2 / 6.0, 0.0)
    return Noise(white=float(np.sqrt(white * step)), walk=(1.0 - theta) / float(np.sqrt(step)))


def dense(theta):
    """Covariance of both runs, of rows that are means over 30 s, for innovations of 1."""
    total = np.zeros((120, 120))
    for run, t in zip(RUNS, TIMES, strict=True):
        total[run, run] = noise_of(theta, 30.0).covariance(t, 30.0)
    return total


def columns():
    t = np.concatenate(TIMES)
    return np.column_stack([np.repeat([1.0, 0.0], [70, 50]), np.repeat([0.0, 1.0], [70, 50]), np.sin(t / 500.0)])


@pytest.mark.parametrize("theta", THETAS)
def test_whitened_rows_have_the_unit_matrix_as_covariance(theta):
    W = whiten(np.eye(120), theta, RUNS)
    assert W @ dense(theta) @ W.T == pytest.approx(np.eye(120), abs=1e-9)


@pytest.mark.parametrize("theta", THETAS)
def test_the_restricted_likelihood_is_the_dense_one(theta):
    """ln det Σ + ln det XᵀΣ⁻¹X + (m − k) ln RSS, and that of white noise where θ = 1."""
    X, y = columns(), np.random.default_rng(2).standard_normal(120).cumsum()
    S = np.linalg.inv(dense(theta))
    rest = y - X @ np.linalg.solve(X.T @ S @ X, X.T @ S @ y)
    exact = np.linalg.slogdet(dense(theta))[1] + np.linalg.slogdet(X.T @ S @ X)[1] + 117 * np.log(rest @ S @ rest)
    assert restricted_deviance(X, y, theta, RUNS) == pytest.approx(exact, abs=1e-7)


def test_ordinary_coefficients_have_the_sandwich_of_the_covariance():
    X, y = columns(), np.random.default_rng(3).standard_normal(120).cumsum()
    fit, theta = fit_linear(X, y, ["a", "b", "c"], constant=False), 0.4
    coloured = fit_coloured(X, y, ["a", "b", "c"], RUNS, theta)
    P = np.linalg.pinv(X)
    exact = coloured.white_deviation**2 * P @ dense(theta) @ P.T
    assert coloured_covariance(fit, coloured, RUNS) == pytest.approx(exact, rel=1e-9)


def test_rows_of_white_noise_and_of_a_walk_alone_are_its_ends():
    assert noise_of(1.0).walk == 0.0
    assert noise_of(np.sqrt(3.0) - 2.0).white == pytest.approx(0.0, abs=1e-8)
