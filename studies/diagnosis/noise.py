"""Noise of a response: white noise and a wander of unknown kind and share, in the bases where both are independent.

The noise of one run has the covariance σ² (1 + q K), K one of `KERNELS`, q one of `SHARES`: the same eigenvectors for every q.
What is noise is a matter of belief: a wander whose rms over a run is many times the white noise of one row is structure
that nobody has explained, not noise. `NoiseModels.prior` says how many.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from threading import Lock
from typing import NamedTuple

import numpy as np

from compensation.noise import SLOW_TIMES, Noise, gauss_markov
from studies.diagnosis.constants import CONSTANTS
from studies.effects.states import FloatArray

SHARES = np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 400.0, 2000.0, 6000.0, 2e4, 6e4, 2e5])


Covariance = Callable[[FloatArray, float], FloatArray]
"""Covariance (n, n) of a wander of about unit variance in rows that are means over a span, s, about times (n,)."""
WALK = Noise(walk=(8.0 * 3600.0) ** -0.5, offset=0.5**0.5)
"""A random walk of variance 1 after 8 h that has walked for 4 h when the run starts."""
FLICKER = Noise(flicker=SLOW_TIMES**-0.5)
KERNELS: Mapping[str, Covariance] = {
    "random walk": WALK.covariance,
    "flicker": FLICKER.covariance,
    "Gauss–Markov, 10 min": partial(gauss_markov, tau=600.0),
    "Gauss–Markov, 45 min": partial(gauss_markov, tau=2700.0),
    "flicker and random walk": replace(
        WALK, flicker=FLICKER.flicker
    ).covariance,  # every oscillator has both (IEEE Std 1139)
}
"""Kinds of wander."""
BRIEF = 300.0
"""What changes within so many seconds is noise of a row as much as white noise is: loops and filters have a memory."""


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

    vectors: tuple[FloatArray, ...]
    eigenvalues: FloatArray
    within: float
    brief: float

    @classmethod
    def of(cls, times: Sequence[FloatArray], covariance: Covariance, span: float) -> "Eigenbasis":
        """Build the basis from the times of the present rows, each a mean over a span (s), one array a run, and the covariance."""
        parts = [_KEPT.solve(t, covariance, span) for t in times]
        rows = np.array([t.size for t in times])
        within, brief = (float(np.average([part[k] for part in parts], weights=rows)) for k in (2, 3))
        eigenvalues = np.concatenate([part.eigenvalues for part in parts])
        return cls(tuple(part.vectors for part in parts), eigenvalues, within, brief)

    def rotate(self, stacked: FloatArray) -> FloatArray:
        """Rotate columns of stacked rows, (M,) or (M, k)."""
        return self._turned(stacked, [vectors.T for vectors in self.vectors])

    def unrotate(self, rotated: FloatArray) -> FloatArray:
        """Return stacked rows from rotated ones: the inverse of `rotate`."""
        return self._turned(rotated, self.vectors)

    def _turned(self, rows: FloatArray, turns: Sequence[FloatArray]) -> FloatArray:
        out = np.empty_like(rows)
        begin = 0
        for turn in turns:
            end = begin + turn.shape[0]
            out[begin:end] = turn.astype(rows.dtype, copy=False) @ rows[begin:end]
            begin = end
        return out


class _Run(NamedTuple):
    """Eigenvalues and eigenvectors of the wander of one run, and its mean squares `within` and `brief`."""

    eigenvalues: FloatArray
    vectors: FloatArray
    within: float
    brief: float


def _decompose(t: FloatArray, covariance: Covariance, span: float) -> _Run:
    K = covariance(t, span)
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
        self.found: OrderedDict[tuple[bytes, Covariance, float], _Run] = OrderedDict()

    def solve(self, times: FloatArray, covariance: Covariance, span: float) -> _Run:
        t = np.round(times - times[0], 3)
        key = (t.tobytes(), covariance, span)
        with self.lock:
            if key in self.found:
                self.found.move_to_end(key)
                return self.found[key]
        run = _decompose(t, covariance, span)
        with self.lock:
            self.found[key] = run
            while len(self.found) > 1 and sum(one.vectors.nbytes for one in self.found.values()) > self.most:
                self.found.popitem(last=False)
        return run


_KEPT = _Kept(256 * 2**20)


@dataclass(frozen=True)
class NoiseModels:
    """Every noise model that a response is tried with: each kind of wander with each share.

    Attributes
    ----------
    bases : tuple of Eigenbasis
        One a kind, in the order of `KERNELS`.
    rows : float
        Rows of the record to a row of the grid.
    floor : float
        Variance of a row of the record beyond that, over the white variance of a row of the grid: what the thermometer's reading
        brings into it, and what is white from row to row although the means of many rows are not.
    tails : float
        Degrees of freedom of Student's law of the noise of a row.
    """

    bases: tuple[Eigenbasis, ...]
    rows: float
    floor: float = 0.0
    tails: float = np.inf

    @classmethod
    def of(cls, times: Sequence[FloatArray], rows: float, step: float) -> "NoiseModels":
        """Build every basis from the times of the present rows, one array a run, each the mean of `rows` over a step (s)."""
        return cls(tuple(Eigenbasis.of(times, kernel, step) for kernel in KERNELS.values()), rows)

    def weights(self, kind: int) -> FloatArray:
        """Inverse variances over σ² for every share, (S, M)."""
        return np.asarray(1.0 / (1.0 + SHARES[:, None] * self.bases[kind].eigenvalues))

    def ratio(self, kind: int) -> FloatArray:
        """Return rms of the wander within a run over the noise of one row of the record within minutes, for every share."""
        own = self.bases[kind]
        return np.sqrt(SHARES * own.within / (self.rows + self.floor + SHARES * own.brief))

    def prior(self, kind: int) -> FloatArray:
        """Log prior of every share: a wander far above the white noise of a row is not believed to be noise.

        Beyond the usual ratio it falls as a normal law of the ratio's logarithm, but never below that of unexplained
        structure: then it is that.
        """
        usual, fall, least = CONSTANTS["wander_usual"], CONSTANTS["wander_fall"], CONSTANTS["log_prior_unknown"]
        excess = np.log(np.maximum(self.ratio(kind) / usual, 1.0)) / fall
        return np.asarray(np.maximum(-0.5 * excess**2, least))

    def believed(self, kind: int, share: int) -> bool:
        """Whether a wander is believed to be noise."""
        return bool(self.prior(kind)[share] > CONSTANTS["log_prior_unknown"])
