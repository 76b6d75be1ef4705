"""A smoothing derivative with a stated lag: the slope of the line fitted to the samples in a sliding window."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.samples import check_time


@dataclass(frozen=True)
class SmoothDerivative:
    """dx/dt at the sample times (m,), that of t − `lag` (s); `complete` (m,): the window holds 80 % of its samples or more."""

    slope: Array
    lag: float
    complete: NDArray[np.bool_]


def differentiate(time: ArrayLike, values: ArrayLike, window: float, *, causal: bool = False) -> SmoothDerivative:
    """Return the slope Σ (tᵢ − t̄)(xᵢ − x̄) / Σ (tᵢ − t̄)² within a sliding window (s), centred or `causal` (lag window/2).

    White noise of standard deviation σ on m samples in the window w makes an error of about √12 σ / (w √m).
    """
    t, x = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    check_time(t)
    if x.shape != t.shape or not np.all(np.isfinite(x)):
        raise CompensationError("a derivative needs one finite value for each time; remove missing values first.")
    step = float(np.median(np.diff(t)))
    if t.size < 3 or window < 2 * step * (1 - 1e-9):
        raise CompensationError(f"a derivative window of {window:g} s holds fewer than three samples at {step:g} s apart; take at least {2 * step:g} s, or record longer.")  # fmt: skip
    before, after = (window, 0.0) if causal else (window / 2, window / 2)
    slack = 1e-6 * step
    first = np.searchsorted(t, t - before - slack)
    last = np.searchsorted(t, t + after + slack)
    complete = last - first >= 0.8 * window / step
    # At the ends of the record and in gaps the nearest three samples must do.
    first = np.minimum(first, np.clip(np.arange(t.size) - 1, 0, t.size - 3))
    last = np.maximum(last, first + 3)
    count = last - first
    u, y = t - t.mean(), x - x.mean()
    n, tu, ty = count, _sums(u, first, last), _sums(y, first, last)
    slope = (_sums(u * y, first, last) - tu * ty / n) / (_sums(u * u, first, last) - tu * tu / n)
    return SmoothDerivative(slope, window / 2 if causal else 0.0, complete)


def _sums(values: Array, first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[last] - total[first])
