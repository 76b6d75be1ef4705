"""First-order lags, exact for drives that are linear between their rows."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from thermal.errors import ThermalError
from thermal.network import Array


def lag(time: ArrayLike, temperature: ArrayLike, time_constant: float, initial: float | None = None) -> Array:
    """Follow a temperature, linear between its rows, with one lag: τ dT_r/dt = T − T_r, exactly.

    Parameters
    ----------
    time, temperature : arrays (N,), s and K
    time_constant : float, s
    initial : float, K, optional
        T_r at the first row; the first temperature when absent.

    Returns
    -------
    array (N,), K
    """
    time, temperature = np.asarray(time, dtype=float), np.asarray(temperature, dtype=float)
    if not time_constant > 0:
        raise ThermalError(f"a time constant must be positive, not {time_constant:g} s.")
    length = np.diff(time)
    if not (length > 0).all():
        raise ThermalError("the time of a record must increase from row to row.")
    decay = np.exp(-length / time_constant)
    trend = np.diff(temperature) / length * time_constant  # T_r follows a ramp, this far behind it
    forced = temperature[1:] - trend - decay * (temperature[:-1] - trend)
    start = temperature[0] if initial is None else initial
    return scan(decay[:, None], forced[:, None], np.array([start]))[:, 0]


def scan(decay: Array, forced: Array, start: Array) -> Array:
    """Run x_{k+1} = decay_k x_k + forced_k from `start`; shapes (N, m), (N, m), (m,) give (N + 1, m)."""
    states = np.empty((len(forced) + 1, len(start)))
    states[0] = start
    if len(decay) > 1 and np.ptp(decay, axis=0).max() <= 1e-12:
        for m, factor in enumerate(decay[0]):
            states[1:, m] = lfilter([1.0], [1.0, -factor], forced[:, m], zi=[factor * start[m]])[0]
        return states
    state = start
    for k in range(len(forced)):
        state = decay[k] * state + forced[k]
        states[k + 1] = state
    return states
