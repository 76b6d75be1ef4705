"""Memory of a gyro for its temperature: a lag behind the thermometer, and a play (hysteresis).

Lag: τ ẏ + y = x, exact for an x that is linear between its samples. Play (backlash): y follows x at a distance of no more
than w, yₖ = min(max(yₖ₋₁, xₖ − w), xₖ + w); the elementary hysteresis of Prandtl and Ishlinskii. Both have settled on the
first value at the start.
"""

from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.transfer import TransferFunction


@dataclass(frozen=True)
class Memory:
    """Lag τ (s) and half-width w of the play (in the unit of what is followed); 0 is none."""

    lag: float = 0.0
    play: float = 0.0


NO_MEMORY = Memory()


def follow_lag(time: Array, values: Array, lag: float) -> Array:
    """Return the values (m,) behind a first-order lag (s), settled at the start."""
    if lag == 0 or values.size < 2:
        return values
    return np.asarray(TransferFunction((1.0,), (lag, 1.0)).simulate(time, values, settled=True))


def follow_play(values: Array, width: float) -> Array:
    """Return the backlash of half-width `width` that follows the values (m,)."""
    if width == 0:
        return values
    followed = np.empty_like(values)
    last = float(values[0])
    for k, x in enumerate(values.tolist()):
        last = min(max(last, x - width), x + width)
        followed[k] = last
    return followed
