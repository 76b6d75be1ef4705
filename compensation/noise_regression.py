"""Least squares with correlated errors: white noise and a random walk, estimated from the same rows.

Differences of means over equal steps remember one step: 1 + θ² on the diagonal of their covariance and −θ beside it, θ
= 1 for white noise, √3 − 2 for a walk; N²/Δ = θ + (1 − θ)²/6, K² Δ = (1 − θ)². Its factor whitens y and every column in
O(rows), so that ordinary F-tests hold (5 % of noise alone is called significant; Newey–West: 60 to 85 %); θ by
restricted likelihood (Patterson & Thompson 1971, Biometrika 58, 545). Uneven rows, flicker, offsets: `noise_rows`.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.regression import LinearFit, fit_linear

Runs = Sequence[slice]
GAP = 1.5  # a step of more than this many usual ones is a gap: the memory of the noise is not carried across it
ROUNDING = 1e-12  # residuals below this part of the observations are rounding, which remembers nothing


@dataclass(frozen=True)
class ColouredFit:
    """Generalised least squares: `regression` of the whitened rows with its covariance, the noise's `theta`, the rows' residuals."""

    regression: LinearFit
    theta: float
    residuals: Array

    @property
    def white_deviation(self) -> float:
        """Standard deviation of the innovations, one row each."""
        return float(np.sqrt(self.regression.variance))


def whiten(Z: Array, theta: float, runs: Runs) -> Array:
    """Return the columns of Z (m, k), or the vector Z, in rows whose noise is white of one innovation, run by run."""
    if theta == 1.0:
        return Z
    columns = Z.reshape(len(Z), -1)
    parts = [np.diff(columns[run], axis=0, prepend=np.zeros((1, columns.shape[1]))) for run in runs]
    solved = [scipy.linalg.lapack.dtbtrs(_factor(theta, len(part)), part, uplo="L")[0] for part in parts]
    return np.concatenate(solved).reshape(Z.shape)


@lru_cache(maxsize=64)
def _factor(theta: float, rows: int) -> Array:
    """Triangular factor, in two bands, of the covariance of a first row and the differences after it."""
    bands = np.empty((2, rows))
    bands[0], bands[1] = 1.0 + theta**2, -theta
    bands[0, 0] = (1.0 + theta**2) / 2.0
    return np.asarray(scipy.linalg.cholesky_banded(bands, lower=True))


def restricted_deviance(X: Array, y: Array, theta: float, runs: Runs) -> float:
    """Return −2 ln L = (m − k) ln RSS + ln det XᵀX + ln det Σ of the whitened rows; columns of X should be of length one."""
    # The triangle R of [X, y]: its last corner is the root of RSS, the rest the determinant.
    both = whiten(np.column_stack([X, y]), theta, runs)
    R = np.maximum(np.abs(np.diag(scipy.linalg.qr(both, mode="r", check_finite=False)[0])), 1e-300)
    total = 2 * (y.size - X.shape[1]) * np.log(R[-1]) + 2 * np.sum(np.log(R[:-1]))
    if theta != 1.0:
        total += 2 * sum(float(np.sum(np.log(_factor(theta, run.stop - run.start)[0]))) for run in runs)
    return float(total)


def estimate_theta(X: Array, y: Array, runs: Runs, caution: float = 0.0) -> float:
    """Return the θ of highest restricted likelihood for y = X b + ε, ρ = 1, on equal steps.

    With `caution`, the smallest θ (strongest walk) within that deviance of it: one run seldom tells a weak walk from none.
    """
    X = _unit(X)

    def deviance(theta: float) -> float:
        return restricted_deviance(X, y, theta, runs)

    # Averages over blocks of a pure random walk have θ = √3 − 2, just below zero.
    grid = 1.0 - np.concatenate([[0.0], np.geomspace(1e-3, 3.0 - np.sqrt(3.0), 19)])
    values = np.array([deviance(theta) for theta in grid])
    best = int(np.argmin(values))
    theta, least = grid[best], values[best]
    if 0 < best < grid.size - 1:
        found = scipy.optimize.minimize_scalar(
            deviance, bounds=(grid[best + 1], grid[best - 1]), method="bounded", options={"xatol": 1e-4}
        )
        theta, least = found.x, found.fun
    if caution:
        above = np.flatnonzero(values[best:] > least + caution)
        edge = best + int(above[0]) if above.size else grid.size
        if edge == grid.size:
            return float(grid[-1])
        if edge > best:
            upper = theta if edge == best + 1 else grid[edge - 1]
            return float(scipy.optimize.brentq(lambda t: deviance(t) - least - caution, grid[edge], upper, xtol=1e-4))
    return float(theta)


def fit_coloured(X: Array, y: Array, names: Sequence[str], runs: Runs, theta: float | None = None) -> ColouredFit:
    """Fit y = X b, X (m, p), by generalised least squares under white noise plus a walk on equal steps, of θ given or estimated."""
    theta = estimate_theta(X, y, runs) if theta is None else theta
    fit = fit_linear(whiten(X, theta, runs), whiten(y, theta, runs), names, constant=False)
    return ColouredFit(fit, theta, y - X @ fit.coefficients)


def coloured_covariance(fit: LinearFit, coloured: ColouredFit, runs: Runs) -> Array:
    """Return the covariance of ordinary least squares in such noise: (XᵀX)⁻¹ Xᵀ Σ X (XᵀX)⁻¹, Σ = σ² S F Fᵀ Sᵀ."""
    half = fit.design
    if coloured.theta != 1.0:
        parts = []
        for run in runs:
            summed = np.cumsum(fit.design[run][::-1], axis=0)[::-1]
            diagonal, below = _factor(coloured.theta, len(summed))
            part = diagonal[:, None] * summed
            part[:-1] += below[:-1, None] * summed[1:]
            parts.append(part)
        half = np.concatenate(parts)
    root = half @ fit.bread
    return np.asarray(coloured.white_deviation**2 * root.T @ root)


def correlated_covariance(fit: LinearFit, time: Array | None = None) -> Array:
    """Return the covariance (p, p) of the coefficients for errors that are white noise plus a random walk, estimated from the rows.

    Counted over seeds, 95 % intervals of the bell chain hold the truth in 95 % of records with white errors, 86 to 93 %
    with a walk, 70 to 90 % with one that 600 rows do not show: repeat a calibration. Times (N,) show gaps and runs.
    """
    y = fit.fitted + fit.residuals
    if np.linalg.norm(fit.residuals) <= ROUNDING * np.linalg.norm(y):
        return fit.covariance
    gaps: list[int] = []
    if time is not None:
        steps = np.diff(time)
        gaps = [int(row) + 1 for row in np.flatnonzero((steps > GAP * np.median(steps)) | (steps <= 0))]
    runs = runs_between(gaps, len(y))
    return coloured_covariance(fit, fit_coloured(fit.design, y, fit.names, runs), runs)


def runs_between(breaks: Sequence[int], count: int) -> Runs:
    """Return the rows of each run, from the rows at which a new one begins and the number of all."""
    return [slice(begin, end) for begin, end in itertools.pairwise([0, *breaks, count])]


def _unit(X: Array) -> Array:
    scale = np.linalg.norm(X, axis=0)
    return np.asarray(X / np.where(scale > 0, scale, 1.0))
