"""The offset between two loggers' clocks, from what their columns share.

The first column is a straight line in the second, read d later: y₁(t) = a + b y₂(t − d), b = 1 for two columns of one
unit, both smoothed by one kernel. The best d leaves the least sum of squares S; its 90 % interval ends where n′
ln(S/S_min) = 2.71, n′ = n (1 − ρ)/(1 + ρ) independent rows.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array

MOST_ROWS = 4000
SMOOTHED = 2.0  # rows, standard deviation of the kernel
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


def estimate_offset(t1: Array, y1: Array, t2: Array, y2: Array, same_unit: bool = False) -> Offset | None:
    """Return what must be added to the times t2 so that y2 follows y1 (`same_unit`: of one quantity); None where the two share too little."""
    t1, y1, t2, y2 = *_known(t1, y1), *_known(t2, y2)
    if min(t1.size, t2.size) < 20 or np.ptp(y1) == 0 or np.ptp(y2) == 0:
        return None
    span = min(float(np.ptp(t1)), float(np.ptp(t2)))
    step = max(float(np.median(np.diff(t1))), float(np.median(np.diff(t2))), span / MOST_ROWS)
    t1, y1, t2, y2 = *_smooth(t1, y1, step), *_smooth(t2, y2, step)
    reach = min(FARTHEST, 0.4 * span)
    found = _search(t1, y1, t2, y2, reach, step, same_unit)
    if found is None:
        return None
    # Once more with all rows that the found neighbourhood allows: what happened at the start of a run tells most.
    near = max(abs(found.value), abs(found.low), abs(found.high)) + 20 * step
    return (_search(t1, y1, t2, y2, near, step, same_unit) or found) if near < reach else found


def _search(t1: Array, y1: Array, t2: Array, y2: Array, reach: float, step: float, same_unit: bool) -> Offset | None:
    # The same rows for every offset, so that their sums of squares compare.
    inside = (t1 >= t2[0] + reach) & (t1 <= t2[-1] - reach)
    if np.count_nonzero(inside) < 20:
        return None
    t, y, second = t1[inside], y1[inside] - y1[inside].mean(), scipy.interpolate.CubicSpline(t2, y2)

    def left(d: float) -> Array:
        x = np.asarray(second(t - d))
        x = x - x.mean()
        size = float(x @ x)
        slope = 1.0 if same_unit else float(x @ y) / size if size > 0 else 0.0
        return np.asarray(y - slope * x)

    def misfit(d: float) -> float:
        return math.log(max(float(np.sum(left(d) ** 2)), 1e-300))

    count = int(reach / step)
    grid = step * np.arange(-count, count + 1)
    values = np.array([misfit(float(d)) for d in grid])
    best = int(np.argmin(values))
    if best in (0, len(grid) - 1):
        return None
    found = scipy.optimize.minimize_scalar(
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
    return Offset(d, low, high, correlation) if max(-low, high) < reach else None


def _edge(misfit: Callable[[float], float], d: float, sign: float, limit: float, step: float, reach: float) -> float:
    """Go from d until the misfit passes the limit."""
    while abs(d) < reach and misfit(d) < limit:
        d += sign * step
        step *= 1.3
    return d


def _known(t: Array, y: Array) -> tuple[Array, Array]:
    known = np.isfinite(y)
    return t[known], y[known]


def _smooth(t: Array, y: Array, step: float) -> tuple[Array, Array]:
    """Put a series on a regular grid and smooth it there."""
    grid = np.arange(t[0], t[-1] + step / 2, step)
    return grid, np.asarray(scipy.ndimage.gaussian_filter1d(np.interp(grid, t, y), SMOOTHED, mode="nearest"))
