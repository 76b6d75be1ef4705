"""Least squares when the errors remember: white noise plus a random walk, estimated from the same rows.

Errors of a gyro's averaged output are εₜ = wₜ + Σ vₛ. Their innovations are (1 − L)/(1 − θ L) applied to ε,
L the step back, with θ = 1 for white noise alone and θ = 0 for a random walk alone; filtering y and every column
so makes ordinary least squares and its F-tests valid again. θ comes from restricted maximum likelihood.

Newey–West covariances, even prewhitened, do not do here: on records of noise alone, regressed on a smooth
temperature, they call a term significant at 5 % in 60 to 85 % of the cases once a random walk or flicker noise
is present; with this filter the rate stays near 5 %.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize, signal

from compensation.regression import LinearFit, fit_linear

Array = NDArray[np.float64]
Runs = Sequence[slice]
GAP = 1.5
"""A step of more than this many usual ones is a gap: what the noise remembers is not carried over it."""
ROUNDING = 1e-12
"""Residuals below this part of the observations are rounding, which remembers nothing."""


@dataclass(frozen=True)
class ColouredFit:
    """Generalised least squares: `regression` of the whitened rows, the noise's `theta`, the rows' `residuals`.

    `regression.covariance` is the covariance of the coefficients that respects the autocorrelation.
    """

    regression: LinearFit
    theta: float
    residuals: Array

    @property
    def white_deviation(self) -> float:
        """Standard deviation of the innovations, one row each."""
        return float(np.sqrt(self.regression.variance))


def whiten(Z: Array, theta: float, runs: Runs) -> Array:
    """Filter the columns of Z (m, k), or the vector Z, with (1 − L)/(1 − θ L), starting anew with every run."""
    if theta == 1.0:
        return Z
    return np.concatenate([signal.lfilter([1.0, -1.0], [1.0, -theta], Z[run], axis=0) for run in runs])


def estimate_theta(X: Array, y: Array, runs: Runs, caution: float = 0.0) -> float:
    """Return the θ of highest restricted likelihood for y = X b + ε; rows of a run must be equally spaced.

    With `caution`, the smallest θ, that is the strongest random walk, whose deviance (−2 ln L) is no more than that
    above the least: one run seldom tells a weak random walk from none, and tests must not profit from that.
    """

    def deviance(theta: float) -> float:
        R = linalg.qr(np.column_stack([whiten(X, theta, runs), whiten(y, theta, runs)]), mode="r")[0]
        p = X.shape[1]
        diagonal = np.abs(np.diag(R)[:p])
        return float((y.size - p) * 2 * np.log(abs(R[p, p])) + 2 * np.sum(np.log(np.maximum(diagonal, 1e-300))))

    scale = np.linalg.norm(X, axis=0)
    X = X / np.where(scale > 0, scale, 1.0)
    # Averages over blocks of a pure random walk have θ = √3 − 2, just below zero.
    grid = 1.0 - np.concatenate([[0.0], np.geomspace(1e-3, 3.0 - np.sqrt(3.0), 19)])
    values = np.array([deviance(theta) for theta in grid])
    best = int(np.argmin(values))
    theta, least = grid[best], values[best]
    if 0 < best < grid.size - 1:
        found = optimize.minimize_scalar(
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
            return float(optimize.brentq(lambda t: deviance(t) - least - caution, grid[edge], upper, xtol=1e-4))
    return float(theta)


def fit_coloured(X: Array, y: Array, names: Sequence[str], runs: Runs, theta: float | None = None) -> ColouredFit:
    """Fit y = X b by generalised least squares under white noise plus a random walk.

    Parameters
    ----------
    X : array, shape (m, k)
        One column per coefficient, the constants among them.
    y : array, shape (m,)
    names : sequence of k names
    runs : sequence of slices
        The rows of each run; within one the rows are equally spaced in time.
    theta : float, optional
        The noise, if it is known; else it is estimated with these columns.
    """
    theta = estimate_theta(X, y, runs) if theta is None else theta
    fit = fit_linear(whiten(X, theta, runs), whiten(y, theta, runs), names, constant=False)
    return ColouredFit(fit, theta, y - X @ fit.coefficients)


def coloured_covariance(fit: LinearFit, coloured: ColouredFit, runs: Runs) -> Array:
    """Return the covariance of ordinary least-squares coefficients when the errors are those of `coloured`.

    (XᵀX)⁻¹ Xᵀ Σ X (XᵀX)⁻¹ with Σ = σ² L Lᵀ and L the filter (1 − θ L)/(1 − L).
    """
    theta = coloured.theta
    if theta == 1.0:
        half = fit.design
    else:
        half = np.concatenate(
            [signal.lfilter([1.0, -theta], [1.0, -1.0], fit.design[run][::-1], axis=0) for run in runs]
        )
    root = half @ fit.bread
    return np.asarray(coloured.white_deviation**2 * root.T @ root)


def correlated_covariance(fit: LinearFit, time: Array | None = None) -> Array:
    """Return the covariance (p, p) of the coefficients for errors that are white noise plus a random walk.

    The mixture is estimated from the same rows (see the module); with white errors this is the usual σ² (XᵀX)⁻¹.
    Counted over seeds, 95 % intervals of the bell chain hold the truth in 95 % of records with white errors, in 86 to
    93 % with a plain random walk added, and in 70 to 90 % with one so weak that 600 rows do not show it: repeat a
    calibration to know how much a bias wanders from run to run.

    Parameters
    ----------
    fit : LinearFit
        Its rows in order of time.
    time : array (N,), optional
        Times of the rows, to find gaps and where a next run starts; without it the rows are evenly spaced.
    """
    y = fit.fitted + fit.residuals
    if np.linalg.norm(fit.residuals) <= ROUNDING * np.linalg.norm(y):
        return fit.covariance
    gaps: list[int] = []
    if time is not None:
        steps = np.diff(time)
        gaps = [int(row) + 1 for row in np.flatnonzero((steps > GAP * np.median(steps)) | (steps <= 0))]
    edges = [0, *gaps, len(y)]
    runs = [slice(begin, end) for begin, end in itertools.pairwise(edges)]
    return coloured_covariance(fit, fit_coloured(fit.design, y, fit.names, runs), runs)
