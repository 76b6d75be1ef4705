"""Covariance of ordinary least-squares coefficients whose errors are correlated in time."""

import itertools

import numpy as np
from numpy.typing import NDArray

from compensation.coloured import coloured_covariance, fit_coloured
from compensation.regression import LinearFit

Real = NDArray[np.float64]
GAP = 1.5
"""A step of more than this many usual ones is a gap: what the noise remembers is not carried over it."""
ROUNDING = 1e-12
"""Residuals below this part of the observations are rounding, which remembers nothing."""


def correlated_covariance(fit: LinearFit, time: Real | None = None) -> Real:
    """Return the covariance (p, p) of the coefficients for errors that are white noise plus a random walk.

    The mixture is estimated from the same rows (see `coloured`); with white errors this is the usual σ² (XᵀX)⁻¹.
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
