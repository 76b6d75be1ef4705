"""Covariances of noise that wanders, and the rows in which white noise beside it is independent.

Noise that remembers is a sum of few kinds, each of one covariance between the times t_i, t_j of a run:

    random walk   (min(t_i, t_j) − t₀) / 1 h                     variance 1 after an hour
    flicker       mean over τ = 1 min, 4 min, … 68 h of exp(−|t_i − t_j| / τ), whose spectrum is 1/f between
    Gauss–Markov  exp(−|t_i − t_j| / τ)                          one correlation time

(IEEE Std 952, annex C; IEEE Std 1139). `correlated` estimates their levels for rows of any weight; where white noise is equal
in all rows and K is one wander, σ² (1 + q K) has the same eigenvectors for every share q: `Eigenbasis`. It is the batch
form of the filter (1 − L)/(1 − θL) of `coloured`, exact at the start of each run and across missing rows.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Covariance = Callable[[Array], Array]
"""Covariance (n, n) of a wander of unit level at times (n,)."""
HOUR = 3600.0
FLICKER_TIMES = 60.0 * 4.0 ** np.arange(7)
BRIEF = 300.0
"""What changes within so many seconds is noise of a row as much as white noise is: loops and filters have a memory."""
AT_ONCE = np.zeros(1)
"""A row that is no mean."""


def white_noise(*series: Array) -> float:
    """Return the white noise of series that change slowly, from the median size of their second differences; 0 of none."""
    second = np.concatenate([np.diff(values, 2) for values in series])
    second = second[np.isfinite(second)]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0)) if second.size else 0.0


def random_walk(t: Array) -> Array:
    """Covariance of a random walk that begins with the run and has variance 1 after an hour."""
    return np.asarray((np.minimum(t[:, None], t[None, :]) - t[0]) / HOUR)


def flicker(t: Array) -> Array:
    """Covariance of flicker noise, 1/f between 1 min and 68 h, of variance 1."""
    return np.asarray(np.mean([gauss_markov(t, tau) for tau in FLICKER_TIMES], axis=0))


def gauss_markov(t: Array, tau: float) -> Array:
    """Covariance of exponentially correlated noise of correlation time `tau`, s, and variance 1."""
    return np.asarray(np.exp(-np.abs(t[:, None] - t[None, :]) / tau))


@dataclass(frozen=True)
class Eigenbasis:
    """Rotation of the present rows of all runs into independent ones, for one kind of wander.

    Attributes
    ----------
    vectors : sequence of (n_r, n_r) arrays
        Eigenvectors of K, run by run.
    eigenvalues : (M,) array
        Of K, stacked: the variance of row i is σ² (1 + q λ_i).
    within : float
        Mean square of the wander about its mean over the run for σ² q = 1.
    brief : float
        Half the mean square of its change within five minutes.
    """

    vectors: tuple[Array, ...]
    eigenvalues: Array
    within: float
    brief: float

    @classmethod
    def of(cls, times: Sequence[Array], covariance: Covariance, moments: Array = AT_ONCE) -> "Eigenbasis":
        """Build the basis from the times of the present rows, one array a run, and the wander's covariance.

        A row that is a mean over `moments` about its time has less variance than the wander at that time, and next to the
        same covariance with the other rows: a random walk Δ/6 less, over Δ s.
        """
        parts = [_KEPT.solve(t, covariance) for t in times]
        rows = np.array([t.size for t in times])
        within, brief = (float(np.average([part[k] for part in parts], weights=rows)) for k in (2, 3))
        within_row = covariance(np.append(moments, 0.0))
        less = within_row[-1, -1] - within_row[:-1, :-1].mean()
        eigenvalues = np.clip(np.concatenate([part.eigenvalues for part in parts]) - less, 0.0, None)
        return cls(tuple(part.vectors for part in parts), eigenvalues, within, brief)

    def rotate(self, stacked: Array) -> Array:
        """Rotate columns of stacked rows, (M,) or (M, k)."""
        return self._turned(stacked, [vectors.T for vectors in self.vectors])

    def unrotate(self, rotated: Array) -> Array:
        """Return stacked rows from rotated ones: the inverse of `rotate`."""
        return self._turned(rotated, self.vectors)

    def _turned(self, rows: Array, turns: Sequence[Array]) -> Array:
        out = np.empty_like(rows)
        begin = 0
        for turn in turns:
            end = begin + turn.shape[0]
            out[begin:end] = turn.astype(rows.dtype, copy=False) @ rows[begin:end]
            begin = end
        return out


class _Run(NamedTuple):
    """Eigenvalues and eigenvectors of the wander of one run, and its mean squares `within` and `brief`."""

    eigenvalues: Array
    vectors: Array
    within: float
    brief: float


def _decompose(t: Array, covariance: Covariance) -> _Run:
    K = covariance(t)
    values, vectors = np.linalg.eigh(K)
    within = float(np.trace(K) / t.size - K.mean())
    own = np.diag(K)
    near = np.minimum(np.searchsorted(t, t + BRIEF), t.size - 1)
    change = own + own[near] - 2.0 * K[np.arange(t.size), near]
    brief = 0.5 * float(np.median(change * np.minimum(BRIEF / np.maximum(t[near] - t, 1.0), 1.0)))
    return _Run(np.clip(values, 0.0, None), vectors, within, brief)


class _Kept:
    """Decompositions that were asked for last, as many as fit into `most` bytes: runs of one programme share their times."""

    def __init__(self, most: int) -> None:
        self.most, self.lock = most, Lock()
        self.found: OrderedDict[tuple[bytes, Covariance], _Run] = OrderedDict()

    def solve(self, times: Array, covariance: Covariance) -> _Run:
        t = np.round(times - times[0], 3)
        key = (t.tobytes(), covariance)
        with self.lock:
            if key in self.found:
                self.found.move_to_end(key)
                return self.found[key]
        run = _decompose(t, covariance)
        with self.lock:
            self.found[key] = run
            while len(self.found) > 1 and sum(one.vectors.nbytes for one in self.found.values()) > self.most:
                self.found.popitem(last=False)
        return run


_KEPT = _Kept(256 * 2**20)
