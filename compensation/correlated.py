"""Covariance of least-squares coefficients when the residuals are correlated in time."""

import numpy as np
from numpy.typing import NDArray

from compensation.regression import LinearFit

Real = NDArray[np.float64]
STRONGEST = 0.97
"""Largest autoregression that is believed: beyond it a record of this kind holds hardly one independent value."""


def correlated_covariance(fit: LinearFit) -> Real:
    """Return the covariance (p, p) of the coefficients of rows in order of time, correlated errors allowed.

    (XᵀX)⁻¹ S (XᵀX)⁻¹ with S the long-run variance of the scores xₜ eₜ: each score is whitened by its own
    autoregression of order one, its autocovariances are summed with Bartlett weights over Andrews' automatic
    bandwidth (Andrews & Monahan, Econometrica 60 (1992) 953; Andrews, Econometrica 59 (1991) 817), and the
    autoregression is put back.
    """
    # Score in the scaled coordinates of the design, so that columns of very different size do not lose digits.
    scale = np.sqrt(np.mean(fit.design**2, axis=0))
    scores = fit.design / scale * fit.residuals[:, None]
    m, p = scores.shape
    before, after = scores[:-1], scores[1:]
    energy = np.sum(before**2, axis=0)
    rho = np.clip(np.sum(before * after, axis=0) / np.where(energy > 0, energy, 1.0), -STRONGEST, STRONGEST)
    white = after - rho * before
    bandwidth = min(_choose_bandwidth(white), (m - 1) // 2)
    S = white.T @ white
    for lag in range(1, bandwidth + 1):
        gamma = white[lag:].T @ white[:-lag]
        S = S + (1 - lag / (bandwidth + 1)) * (gamma + gamma.T)
    colour = 1 / (1 - rho)
    long_run = colour[:, None] * S * colour * m / (m - p)
    bread = fit.bread * np.outer(scale, scale)
    return np.asarray(bread @ long_run @ bread / np.outer(scale, scale), dtype=float)


def _choose_bandwidth(scores: Real) -> int:
    """Andrews' bandwidth for Bartlett weights, 1.1447 (α m)^(1/3), from first autocorrelations of the scores."""
    energy = np.sum(scores[:-1] ** 2, axis=0)
    usable = energy > 0
    rho = np.sum(scores[1:, usable] * scores[:-1, usable], axis=0) / energy[usable]
    rho = np.clip(rho, -STRONGEST, STRONGEST)
    size = energy[usable] ** 2
    alpha = np.sum(size * 4 * rho**2 / ((1 - rho) ** 6 * (1 + rho) ** 2)) / max(
        float(np.sum(size / (1 - rho) ** 4)), np.finfo(float).tiny
    )
    return int(np.ceil(1.1447 * (alpha * len(scores)) ** (1 / 3)))
