"""Linearity of a rate output: measured against applied rate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.samples import read_columns

PLATEAU = 1e-3  # part of the largest applied rate within which two rates are the same


def same_rate(rate: ArrayLike) -> Array:
    """Return the applied rates rounded to a thousandth of the largest, so that jitter of a rate table does not split a rate."""
    x = np.asarray(rate, dtype=float)
    grain = PLATEAU * float(np.max(np.abs(x), initial=0.0)) or 1.0
    return np.asarray(np.round(x / grain) * grain, dtype=float)


@dataclass(frozen=True)
class Linearity:
    """The line through measured over applied rate, and the largest departure from it."""

    slope: float  # slope, intercept: of the line (1, rad/s)
    intercept: float
    # largest deviation from the line over full scale (1), full scale being the largest applied rate
    nonlinearity: float


def measure_linearity(applied: ArrayLike, measured: ArrayLike) -> Linearity:
    """Judge measured against applied rate (rad/s) by the means of each applied rate, as the BVG paper does."""
    x, y = read_columns(applied=applied, measured=measured)
    _, kind = np.unique(same_rate(x), return_inverse=True)
    rates = np.bincount(kind, x) / np.bincount(kind)
    if len(rates) < 3:
        raise CompensationError(f"nonlinearity needs three applied rates or more, not {len(rates)}.")
    means = np.bincount(kind, y) / np.bincount(kind)
    slope, intercept = np.polynomial.polynomial.polyfit(rates, means, 1)[::-1]
    worst = np.max(np.abs(means - slope * rates - intercept))
    return Linearity(float(slope), float(intercept), float(worst / np.max(np.abs(rates))))
