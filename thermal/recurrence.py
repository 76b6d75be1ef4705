"""Recurrences of first order, one for each mode."""

from __future__ import annotations

import numpy as np
import scipy

from thermal.network import Array

GONE = 1e-17
"""Part that is nothing beside what was added since, to double precision."""


def scan(decay: Array, forced: Array, start: Array) -> Array:
    """Run x_{k+1} = decay_k x_k + forced_k from `start`, banded triangular systems; (N, m), (N, …, m), (…, m) give (N + 1, …, m); of what is gone after every row nothing is carried on."""
    states = np.concatenate([start[None], forced])
    band = np.ones((2, len(states)), order="F")
    for m in np.flatnonzero(decay.max(axis=0, initial=0.0) > GONE):
        band[1, :-1] = -decay[:, m]
        columns = states[..., m].reshape(len(states), -1)
        states[..., m] = scipy.linalg.lapack.dtbtrs(band, columns, uplo="L", diag="U")[0].reshape(states.shape[:-1])
    return states
