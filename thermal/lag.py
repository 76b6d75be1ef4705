"""First-order lags, exact for drives that are linear between their rows."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from thermal.errors import ThermalError
from thermal.network import Array

GONE = 1e-17
"""Part that is nothing beside what was added since, to double precision."""


def lag(time: ArrayLike, temperature: ArrayLike, time_constant: float, initial: float | None = None) -> Array:
    """Follow a temperature (K) with one lag from `initial`, or its first value: τ dT_r/dt = T − T_r, exactly."""
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
    """Run x_{k+1} = decay_k x_k + forced_k from `start`, banded triangular systems; (N, m), (N, …, m), (…, m) give (N + 1, …, m); of what is gone after every row nothing is carried on."""
    states = np.concatenate([start[None], forced])
    band = np.ones((2, len(states)), order="F")
    for m in np.flatnonzero(decay.max(axis=0, initial=0.0) > GONE):
        band[1, :-1] = -decay[:, m]
        columns = states[..., m].reshape(len(states), -1)
        states[..., m] = scipy.linalg.lapack.dtbtrs(band, columns, uplo="L", diag="U")[0].reshape(states.shape[:-1])
    return states
