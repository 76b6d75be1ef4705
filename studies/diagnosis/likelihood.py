"""Coloured noise: white noise and slow noise of unknown share, in the basis where both are independent.

The noise of one run has the covariance σ² (1 + q K), K_ij = (min(t_i, t_j) + c t₈) / t₈ with t₈ = 8 h: white noise and a
random walk that has already wandered when the run starts. K has the same eigenvectors for every q, so one
rotation makes the rows independent and the share q is profiled by weights alone. It is the batch form of the
steady-state Kalman filter (1 − L)/(1 − θL), exact at the start of each run and across missing rows. Other kinds of
slow noise (1/f, a relaxation) have another K and the same one parameter; the likelihood of the data chooses.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from studies.diagnosis.states import FloatArray

WALK_TIME = 8 * 3600.0
WALKED_BEFORE = 0.5
SHARES = np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 400.0, 2000.0, 2e4])


KERNELS = ("walk", "flicker", "relaxing", "slowly relaxing")
"""Kinds of coloured noise: random walk; 1/f; one relaxation of 10 min; one of 45 min."""


@lru_cache(maxsize=256)
def _eigenbasis(times: bytes, kernel: str) -> tuple[FloatArray, FloatArray]:
    t = np.frombuffer(times)
    apart = np.abs(t[:, None] - t[None, :])
    if kernel == "walk":
        colour = (np.minimum(t[:, None], t[None, :]) - t[0]) / WALK_TIME + WALKED_BEFORE
    elif kernel == "flicker":
        colour = np.mean([np.exp(-apart / (60.0 * 4.0**k)) for k in range(7)], axis=0)
    else:
        colour = np.exp(-apart / (600.0 if kernel == "relaxing" else 2700.0))
    values, vectors = np.linalg.eigh(colour)
    return np.clip(values, 0.0, None), vectors


@dataclass(frozen=True)
class NoiseBasis:
    """Rotation of the present rows of all runs into independent ones.

    Attributes
    ----------
    vectors : sequence of (n_r, n_r) arrays
        Eigenvectors of K, run by run.
    walk : (M,) array
        Eigenvalues of K, stacked: the variance of row i is σ² (1 + q walk_i).
    """

    vectors: tuple[FloatArray, ...]
    walk: FloatArray

    @classmethod
    def of(cls, times: Sequence[FloatArray], kernel: str = "walk") -> "NoiseBasis":
        """Build the basis from the times of the present rows, one array a run, and the kind of noise."""
        parts = [_eigenbasis(np.round(t - t[0], 3).tobytes(), kernel) for t in times]
        return cls(tuple(vectors for _, vectors in parts), np.concatenate([values for values, _ in parts]))

    def with_row(self) -> "NoiseBasis":
        """Return the basis with one white row more, for a prior."""
        return NoiseBasis((*self.vectors, np.ones((1, 1))), np.append(self.walk, 0.0))

    def rotate(self, stacked: FloatArray) -> FloatArray:
        """Rotate columns of stacked rows, (M,) or (M, k)."""
        out = np.empty_like(stacked)
        begin = 0
        for vectors in self.vectors:
            end = begin + vectors.shape[0]
            out[begin:end] = vectors.T @ stacked[begin:end]
            begin = end
        return out

    def unrotate(self, rotated: FloatArray) -> FloatArray:
        """Return stacked rows from rotated ones: the inverse of `rotate`."""
        out = np.empty_like(rotated)
        begin = 0
        for vectors in self.vectors:
            end = begin + vectors.shape[0]
            out[begin:end] = vectors @ rotated[begin:end]
            begin = end
        return out

    def steps(self, run: int) -> FloatArray:
        """Rotated unit steps of one run: column k is 0 up to row k and 1 after it."""
        vectors = self.vectors[run]
        return np.asarray((np.cumsum(vectors[::-1], axis=0)[::-1])[1:].T)

    def weights(self, share: float) -> FloatArray:
        """Inverse variances over σ², (M,)."""
        return np.asarray(1.0 / (1.0 + share * self.walk))

    def log_determinant(self, share: float) -> float:
        """Sum of log(1 + q walk)."""
        return float(np.log1p(share * self.walk).sum())


@dataclass(frozen=True)
class LinearFit:
    """A linear model fitted by generalised least squares at the most likely share.

    Attributes
    ----------
    score : float
        Minus twice the log-likelihood, up to a constant.
    share, variance : float
        q and σ².
    coefficients : (p,) array
    covariance : (p, p) array
    """

    score: float
    share: float
    variance: float
    coefficients: FloatArray
    covariance: FloatArray


def fit_linear(
    basis: NoiseBasis, target: FloatArray, columns: FloatArray, shares: Sequence[float] | FloatArray = SHARES
) -> LinearFit:
    """Fit rotated `target` by rotated `columns`, the share of the slow noise profiled over `shares`.

    One singular value decomposition makes the columns orthonormal; every share then costs a small Cholesky solve of
    the residual, which is free of the large constant parts and so keeps its digits.
    """
    rows = columns.shape[0]
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    u, s, vt = np.linalg.svd(columns / scale, full_matrices=False)
    kept = s > 1e-10 * s[0]
    u, back = u[:, kept], (vt[kept].T / s[kept]) / scale[:, None]
    first = u.T @ target
    rest = target - u @ first
    best: tuple[float, float, float, FloatArray, FloatArray] | None = None
    for share in shares:
        weights = basis.weights(share)
        weighted = u * weights[:, None]
        gram, moment = weighted.T @ u, weighted.T @ rest
        part = np.linalg.solve(gram, moment)
        rss = max(float(weights @ rest**2 - moment @ part), 1e-300)
        score = rows * np.log(rss) + basis.log_determinant(share)
        if best is None or score < best[0]:
            best = (float(score), float(share), rss, part, gram)
    assert best is not None
    score, share, rss, part, gram = best
    variance = rss / max(rows - int(kept.sum()), 1)
    covariance = variance * (back @ np.linalg.solve(gram, back.T))
    return LinearFit(score, share, variance, np.asarray(back @ (first + part)), np.asarray(covariance))


def unit(columns: FloatArray) -> FloatArray:
    """Return columns of unit length; empty ones stay empty."""
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(columns / np.where(size > 0, size, 1.0))


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the columns; those that the earlier ones already span are dropped."""
    q, r = np.linalg.qr(columns)
    size = np.abs(np.diag(r))
    return np.asarray(q[:, size > 1e-9 * max(float(size.max()), 1e-300)])
