"""Linearity of a rate output: measured against applied rate."""

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.samples import read_columns

PLATEAU = 1e-3  # part of the largest applied rate within which two rates are the same
PASSED = 0.05  # part of the rows of the longest rate below which one is only passed on the way to the next


def same_rate(rate: ArrayLike) -> Array:
    """Return the applied rates rounded to a thousandth of the largest, so that jitter of a rate table does not split a rate."""
    x = np.asarray(rate, dtype=float)
    grain = PLATEAU * float(np.max(np.abs(x), initial=0.0)) or 1.0
    return np.asarray(np.round(x / grain) * grain, dtype=float)


def measure_nonlinearity(applied: ArrayLike, measured: ArrayLike) -> float:
    """Return the largest departure of the means of held rates from the line over them, over the largest rate (BVG paper, IEEE 952).

    Where most rows pass, as of a rate that swings, or fewer than three rates are held, every rate counts.
    """
    x, y = read_columns(applied=applied, measured=measured)
    _, kind = np.unique(same_rate(x), return_inverse=True)
    rows = np.bincount(kind)
    passed = rows < PASSED * rows.max()
    held = ~passed | (rows[passed].sum() > 0.5 * rows.sum() or np.count_nonzero(~passed) < 3)
    rates, means = (np.bincount(kind, values)[held] / rows[held] for values in (x, y))
    if len(rates) < 3:
        raise CompensationError(f"nonlinearity needs three applied rates or more, not {len(rates)}.")
    slope, intercept = np.polynomial.polynomial.polyfit(rates, means, 1)[::-1]
    return float(np.max(np.abs(means - slope * rates - intercept)) / np.max(np.abs(rates)))
