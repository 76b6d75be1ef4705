"""Memory of a gyro for its temperature: a lag behind the thermometer, and a play (hysteresis).

Lag: τ ẏ + y = x, exact for an x that is linear between its samples. Play (backlash): y follows x at a distance of no more
than w, yₖ = min(max(yₖ₋₁, xₖ − w), xₖ + w); the elementary hysteresis of Prandtl and Ishlinskii. Both have settled on the
first value at the start, unless the play is told to start elsewhere within its width: what came before a record sets it.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.transfer import recur


@dataclass(frozen=True)
class Memory:
    """Lag τ (s), half-width w of the play (in the unit of what is followed), 0 is none; where in it each run starts, −1 … 1."""

    lag: float = 0.0
    play: float = 0.0
    starts: tuple[float, ...] = ()


NO_MEMORY = Memory()


def follow_lag(values: Array, step: ArrayLike, lag: float, start: float | None = None) -> Array:
    """Return the values (N,) or (N, m) behind a first-order lag (s), settled at first or from `start`; `step` (s) is one or (N − 1,)."""
    if lag == 0:
        return values
    ratio = np.maximum(np.asarray(step) / lag, 1e-12)
    decay = np.exp(-ratio)
    ramp = -np.expm1(-ratio) / ratio
    first = values[:1] if start is None else np.full_like(values[:1], start)
    return recur(decay, np.concatenate([first, ((1 - ramp) * values[1:].T + (ramp - decay) * values[:-1].T).T]))


def follow_play(values: Array, radius: float | Sequence[float], start: float = 0.0) -> Array:
    """Return the play of one half-width, or of several, (N, R), that follows the values (N,).

    p_k = min(u_k + r, max(u_k − r, p_{k−1})), with p_0 = u_0 + start · r: each rising or falling branch is done at once.
    """
    radii = np.atleast_1d(np.asarray(radius, dtype=float))
    out = np.empty((values.size, radii.size))
    state = values[0] + start * radii
    rising = np.diff(values) >= 0.0
    turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    out[0] = state
    for begin, end in itertools.pairwise([0, *turns.tolist(), rising.size]):
        if end > begin:
            branch = values[begin + 1 : end + 1, None]
            up = bool(rising[begin])
            out[begin + 1 : end + 1] = np.maximum(branch - radii, state) if up else np.minimum(branch + radii, state)
            state = out[end]
    return out[:, 0] if np.ndim(radius) == 0 else out
