"""The offset between two loggers' clocks, from what their columns share.

For every offset d the first column is compared with a straight line in the second, read d later: y₁(t) = a + b y₂(t − d). The
best d leaves the least sum of squares S; its 90 % interval ends where n′ ln(S/S_min) = 2.71, n′ the number of rows that the
memory of the residual leaves independent, n (1 − ρ)/(1 + ρ).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]
MOST_ROWS = 2000
FARTHEST = 3600.0  # s
LEAST_CORRELATION = 0.8
CHI2_90 = 2.71


@dataclass(frozen=True)
class Offset:
    """Seconds to add to the second clock, their 90 % interval, and the correlation of the two columns then."""

    value: float
    low: float
    high: float
    correlation: float


def estimate_offset(t1: Array, y1: Array, t2: Array, y2: Array) -> Offset | None:
    """Return what must be added to the times t2 so that y2 follows y1; None where the two share too little.

    Parameters
    ----------
    t1, y1, t2, y2 : arrays
        Two series with times (s) by their own clocks; NaN marks missing values.
    """
    t1, y1 = _thin(t1, y1)
    t2, y2 = _known(t2, y2)
    if min(t1.size, t2.size) < 20 or np.ptp(y1) == 0 or np.ptp(y2) == 0:
        return None
    step = max(float(np.median(np.diff(t1))), float(np.median(np.diff(t2))))
    reach = min(FARTHEST, 0.4 * min(float(np.ptp(t1)), float(np.ptp(t2))))
    # The same rows for every offset, so that their sums of squares compare.
    inside = (t1 >= t2[0] + reach) & (t1 <= t2[-1] - reach)
    if np.count_nonzero(inside) < 20:
        return None
    t, y = t1[inside], y1[inside] - y1[inside].mean()

    def left(d: float) -> Array:
        x = np.interp(t - d, t2, y2)
        x = x - x.mean()
        size = float(x @ x)
        return np.asarray(y - x * float(x @ y) / size) if size > 0 else y

    def misfit(d: float) -> float:
        return math.log(max(float(np.sum(left(d) ** 2)), 1e-300))

    count = int(reach / step)
    grid = step * np.arange(-count, count + 1)
    values = np.array([misfit(float(d)) for d in grid])
    best = int(np.argmin(values))
    if best in (0, len(grid) - 1):
        return None
    found = minimize_scalar(
        misfit, bounds=(grid[best - 1], grid[best + 1]), method="bounded", options={"xatol": step / 1e4}
    )
    d = float(found.x)
    residual = left(d)
    correlation = float(np.sqrt(max(1 - float(np.sum(residual**2) / np.sum(y**2)), 0.0)))
    if correlation < LEAST_CORRELATION:
        return None
    power = max(float(np.sum(residual**2)), 1e-300)
    memory = min(max(float(np.sum(residual[1:] * residual[:-1])) / power, 0.0), 0.99)
    worth = CHI2_90 / max(y.size * (1 - memory) / (1 + memory), 1.0)
    low, high = (_edge(misfit, d, sign, float(found.fun) + worth, step / 50, reach) for sign in (-1.0, 1.0))
    return Offset(d, low, high, correlation)


def _edge(misfit: Callable[[float], float], d: float, sign: float, limit: float, step: float, reach: float) -> float:
    """Go from d until the misfit passes the limit."""
    while abs(d) < 2 * reach and misfit(d) < limit:
        d += sign * step
        step *= 1.3
    return d


def _known(t: Array, y: Array) -> tuple[Array, Array]:
    known = np.isfinite(y)
    return t[known], y[known]


def _thin(t: Array, y: Array) -> tuple[Array, Array]:
    t, y = _known(t, y)
    rows = np.unique(np.linspace(0, t.size - 1, MOST_ROWS).astype(int)) if t.size else np.zeros(0, int)
    return t[rows], y[rows]
