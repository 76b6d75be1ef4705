"""Noise of a response: white noise and a wander of unknown kind and share, in the bases where both are independent.

The noise of one run has the covariance σ² (1 + q K): white noise and a wander K (a random walk that has already walked
when the run starts, 1/f noise, a relaxation). K has the same eigenvectors for every share q, so one rotation a kind
makes the rows independent. It is the batch form of the steady-state Kalman filter (1 − L)/(1 − θL), exact at the start of
each run and across missing rows.

What is noise is a matter of belief: a wander whose rms over a run is many times the white noise of one row is structure
that nobody has explained, not noise. `Noise.prior` says how many.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.stats import t as student

from studies.diagnosis.constants import CONSTANTS
from studies.effects.states import FloatArray

WALK_TIME = 8 * 3600.0
WALKED_BEFORE = 0.5
SHARES = np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 400.0, 2000.0, 6000.0, 2e4])
KERNELS = ("walk", "flicker", "relaxing", "slowly relaxing", "flicker and walk")
"""Kinds of wander: random walk; 1/f; one relaxation of 10 min; one of 45 min; 1/f and walk, as every oscillator has both
(IEEE Std 1139)."""
RELAXATION = {"relaxing": 600.0, "slowly relaxing": 2700.0}
BRIEF = 300.0
"""What changes within so many seconds is noise of a row as much as white noise is: loops and filters have a memory."""


def student_log(square: FloatArray, freedom: float) -> float:
    """Return the log likelihood of Student's law at its likeliest scale, from squares."""
    scale = max(float(np.mean(square)), 1e-300)
    for _ in range(30):
        scale = float(np.mean((freedom + 1.0) * square / (freedom + square / scale)))
    return float(student.logpdf(np.sqrt(square / scale), freedom).sum() - 0.5 * square.size * np.log(scale))


def tails_of(values: FloatArray) -> float:
    """Return the likeliest degrees of freedom of Student's law for a sample about 0."""
    square = values[values != 0.0] ** 2
    return max(TAILS, key=lambda freedom: student_log(square, freedom)) if square.size else TAILS[-1]


TAILS = (3.0, 4.0, 6.0, 9.0, 15.0, 30.0, 1e3)


@lru_cache(maxsize=256)
def _eigenbasis(times: bytes, kernel: str) -> tuple[FloatArray, FloatArray, float, float]:
    t = np.frombuffer(times)
    apart = np.abs(t[:, None] - t[None, :])
    colour = np.zeros_like(apart)
    if "walk" in kernel:
        colour += (np.minimum(t[:, None], t[None, :]) - t[0]) / WALK_TIME + WALKED_BEFORE
    if "flicker" in kernel:
        colour += np.mean([np.exp(-apart / (60.0 * 4.0**k)) for k in range(7)], axis=0)
    if kernel in RELAXATION:
        colour += np.exp(-apart / RELAXATION[kernel])
    values, vectors = np.linalg.eigh(colour)
    # mean square of the wander about its mean over the run
    within = float(np.trace(colour) / t.size - colour.mean())
    own = np.diag(colour)
    near = np.minimum(np.searchsorted(t, t + BRIEF), t.size - 1)
    change = own + own[near] - 2.0 * colour[np.arange(t.size), near]
    brief = 0.5 * float(np.median(change * np.minimum(BRIEF / np.maximum(t[near] - t, 1.0), 1.0)))
    return np.clip(values, 0.0, None), vectors, within, brief


@dataclass(frozen=True)
class Basis:
    """Rotation of the present rows of all runs into independent ones, for one kind of wander.

    Attributes
    ----------
    vectors : sequence of (n_r, n_r) arrays
        Eigenvectors of K, run by run.
    walk : (M,) array
        Eigenvalues of K, stacked: the variance of row i is σ² (1 + q walk_i).
    within : float
        Mean square of the wander within a run for σ² q = 1.
    brief : float
        Half the mean square of its change within five minutes.
    """

    vectors: tuple[FloatArray, ...]
    walk: FloatArray
    within: float
    brief: float

    @classmethod
    def of(cls, times: Sequence[FloatArray], kernel: str) -> "Basis":
        """Build the basis from the times of the present rows, one array a run, and the kind of wander."""
        parts = [_eigenbasis(np.round(t - t[0], 3).tobytes(), kernel) for t in times]
        rows = np.array([t.size for t in times])
        within, brief = (float(np.average([part[k] for part in parts], weights=rows)) for k in (2, 3))
        return cls(tuple(part[1] for part in parts), np.concatenate([part[0] for part in parts]), within, brief)

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


@dataclass(frozen=True)
class Noise:
    """Every noise model that a response is tried with: each kind of wander with each share.

    Attributes
    ----------
    bases : tuple of Basis
        One a kind, in the order of `KERNELS`.
    rows : float
        Rows of the record to a row of the grid.
    floor : float
        Variance of a row of the record beyond that, over the white variance of a row of the grid: what the thermometer's reading
        brings into it, and what is white from row to row although the means of many rows are not.
    tails : float
        Degrees of freedom of Student's law of the noise of a row.
    """

    bases: tuple[Basis, ...]
    rows: float
    floor: float = 0.0
    tails: float = np.inf

    @classmethod
    def of(cls, times: Sequence[FloatArray], rows: float) -> "Noise":
        """Build every basis from the times of the present rows, one array a run."""
        return cls(tuple(Basis.of(times, kernel) for kernel in KERNELS), rows)

    def weights(self, kind: int) -> FloatArray:
        """Inverse variances over σ² for every share, (S, M)."""
        return np.asarray(1.0 / (1.0 + SHARES[:, None] * self.bases[kind].walk))

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
