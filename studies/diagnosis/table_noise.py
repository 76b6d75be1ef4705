"""How well a form describes a table of soaked readings, averaged over what its noise and its size may be."""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from studies.effects.states import FloatArray

WANDERS = (0.0, 3.0, 30.0, 300.0, 3e3, 3e4)
"""Variance of a random walk along the whole table over that of the white noise."""
FEWEST_WANDERING = 24


@dataclass(frozen=True)
class Scale:
    """Weighs forms beside one baseline: white noise from rounding upwards, a wander along the rows, sizes of the effect.

    The covariance of f, without what the baseline takes, is σ² (1 + w W) + s² C Cᵀ, with W of a random walk of variance 1 over
    the table; in the frame where 1 + w W is unity, only the columns C cost anything.
    """

    free: FloatArray
    f: FloatArray
    whites: FloatArray
    frames: tuple[tuple[FloatArray, float], ...]
    sizes: FloatArray

    def log_evidence(self, columns: FloatArray) -> float:
        """Log of the mean likelihood of the readings over noise and size."""
        values = self._likelihoods(columns)
        return float(logsumexp(values) - np.log(values.size))

    def white(self) -> float:
        """The white part of the noise, Hz, where nothing is there but noise."""
        values = self._likelihoods(np.empty((self.f.size, 0)))[..., 0]
        weight = np.exp(values - values.max())
        return float(np.exp(np.sum(weight * np.log(self.whites)) / np.sum(weight)))

    def _likelihoods(self, columns: FloatArray) -> FloatArray:
        """(wander, white, size)."""
        y = self.free.T @ self.f
        own = self.free.T @ (columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300))
        sizes = self.sizes if columns.shape[1] else np.zeros(1)
        found = []
        for frame, logarithm in self.frames:
            z = frame @ y
            along, strength, _ = np.linalg.svd(frame @ own, full_matrices=False)
            part = (along.T @ z) ** 2
            grown = (sizes[:, None] * strength) ** 2 / self.whites[:, None, None] ** 2  # (white, size, column)
            misfit = (z @ z - np.sum(part * grown / (1 + grown), axis=-1)) / self.whites[:, None] ** 2
            width = 2 * y.size * np.log(self.whites)[:, None] + np.sum(np.log1p(grown), axis=-1)
            found.append(-0.5 * (misfit + width) - logarithm)
        return np.array(found)


def make_scale(base: FloatArray, f: FloatArray, rounding: float) -> Scale:
    """Lay out noise and sizes for readings f (Hz) beside the columns of a baseline; `rounding` is the least white noise, Hz."""
    free = np.linalg.qr(base / np.linalg.norm(base, axis=0), mode="complete")[0][:, base.shape[1] :]
    rows = np.arange(f.size) / f.size
    walk = free.T @ np.minimum(rows[:, None], rows[None, :]) @ free
    frames = []
    for wander in WANDERS if f.size >= FEWEST_WANDERING else WANDERS[:1]:
        factor = np.linalg.cholesky(np.eye(len(walk)) + wander * walk)
        frames.append((np.linalg.inv(factor), float(np.log(np.diag(factor)).sum())))
    most = max(float(np.std(free.T @ f)), 2.0 * rounding)
    strong = max(0.1 * float(np.ptp(f)), 10.0 * rounding)
    return Scale(free, f, np.geomspace(rounding, most, 8), tuple(frames), np.geomspace(rounding, strong, 9))
