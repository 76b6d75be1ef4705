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

from studies.diagnosis.constants import CONSTANTS
from studies.effects.states import FloatArray

WALK_TIME = 8 * 3600.0
WALKED_BEFORE = 0.5
SHARES = np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 400.0, 2000.0, 6000.0, 2e4])
KERNELS = ("walk", "flicker", "relaxing", "slowly relaxing")
"""Kinds of wander: random walk; 1/f; one relaxation of 10 min; one of 45 min."""


@lru_cache(maxsize=256)
def _eigenbasis(times: bytes, kernel: str) -> tuple[FloatArray, FloatArray, float]:
    t = np.frombuffer(times)
    apart = np.abs(t[:, None] - t[None, :])
    if kernel == "walk":
        colour = (np.minimum(t[:, None], t[None, :]) - t[0]) / WALK_TIME + WALKED_BEFORE
    elif kernel == "flicker":
        colour = np.mean([np.exp(-apart / (60.0 * 4.0**k)) for k in range(7)], axis=0)
    else:
        colour = np.exp(-apart / (600.0 if kernel == "relaxing" else 2700.0))
    values, vectors = np.linalg.eigh(colour)
    # mean square of the wander about its mean over the run
    within = float(np.trace(colour) / t.size - colour.mean())
    return np.clip(values, 0.0, None), vectors, within


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
    """

    vectors: tuple[FloatArray, ...]
    walk: FloatArray
    within: float

    @classmethod
    def of(cls, times: Sequence[FloatArray], kernel: str) -> "Basis":
        """Build the basis from the times of the present rows, one array a run, and the kind of wander."""
        parts = [_eigenbasis(np.round(t - t[0], 3).tobytes(), kernel) for t in times]
        rows = np.array([t.size for t in times])
        within = float(np.average([part[2] for part in parts], weights=rows))
        return cls(tuple(part[1] for part in parts), np.concatenate([part[0] for part in parts]), within)

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
    """

    bases: tuple[Basis, ...]
    rows: float
    floor: float = 0.0

    @classmethod
    def of(cls, times: Sequence[FloatArray], rows: float) -> "Noise":
        """Build every basis from the times of the present rows, one array a run."""
        return cls(tuple(Basis.of(times, kernel) for kernel in KERNELS), rows)

    def weights(self, kind: int) -> FloatArray:
        """Inverse variances over σ² for every share, (S, M)."""
        return np.asarray(1.0 / (1.0 + SHARES[:, None] * self.bases[kind].walk))

    def ratio(self, kind: int) -> FloatArray:
        """Return rms of the wander within a run over the noise of one row of the record, for every share."""
        return np.sqrt(SHARES * self.bases[kind].within / (self.rows + self.floor))

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
