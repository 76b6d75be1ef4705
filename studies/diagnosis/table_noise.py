"""How well a form describes a table of soaked readings, averaged over what its noise and its size may be."""

from dataclasses import dataclass

import numpy as np
import scipy

from studies.effects.states import FloatArray

WANDERS = (0.0, 3.0, 30.0, 300.0, 3e3, 3e4)
"""Variance of a random walk along the whole table over that of the white noise."""
FEWEST_WANDERING = 24
MOST_WALK = 10.0
"""Largest random walk over the whole table, in what the readings leave of their parabola: a walk leaves about a sixth of itself."""


@dataclass(frozen=True)
class TableBaseline:
    """What settled readings do without any effect: columns of free size, and columns whose size has the prior 0 ± 1.

    Attributes
    ----------
    target : (N,) array
        Readings, Hz; beside a card, less what the card predicts as shipped.
    free : (N, k) array
        Without a card 1, the law and x²; none with one: the level and the slope are values of the card.
    known : (N, p) array
        ∂f/∂u of the card's uncertain values, Hz.
    """

    target: FloatArray
    free: FloatArray
    known: FloatArray

    def solve(self, columns: FloatArray, noise: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return residuals and leave-one-out residuals beside free columns in white noise (Hz), and the u with their covariance."""
        p = self.known.shape[1]
        beside = np.concatenate([self.free, columns], axis=1)
        size = np.linalg.norm(beside, axis=0)
        own = np.concatenate([beside / np.where(size > 0, size, 1.0), self.known], axis=1)
        prior = np.concatenate([np.zeros((p, beside.shape[1])), noise * np.eye(p)], axis=1)
        inverse = np.linalg.pinv(np.concatenate([own, prior]), rcond=1e-14)
        found = inverse[:, : self.target.size] @ self.target
        rest = self.target - own @ found
        lever = np.clip(np.sum(own * inverse[:, : self.target.size].T, axis=1), 0.0, 1.0 - 1e-9)
        sizes = inverse[beside.shape[1] :]
        return rest, rest / (1.0 - lever), found[beside.shape[1] :], noise**2 * sizes @ sizes.T

    def made_by(self, columns: FloatArray, noise: float) -> FloatArray:
        """Return what columns of free size make of the readings beside the baseline, Hz."""
        rest, _, u, _ = self.solve(columns, noise)
        whole = self.target - rest - self.known @ u
        own = np.concatenate([self.free, columns], axis=1)
        size = np.linalg.norm(own, axis=0)
        sizes = np.linalg.lstsq(own / np.where(size > 0, size, 1.0), whole, rcond=None)[0]
        k = self.free.shape[1]
        return np.asarray(columns / np.where(size[k:] > 0, size[k:], 1.0) @ sizes[k:])

    def beside(self, columns: FloatArray) -> FloatArray:
        """Return columns without what the free ones take."""
        size = np.linalg.norm(self.free, axis=0)
        unit = self.free / np.where(size > 0, size, 1.0)
        return np.asarray(columns - unit @ np.linalg.lstsq(unit, columns, rcond=None)[0])


@dataclass(frozen=True)
class Scale:
    """Weighs forms beside one baseline: white noise from rounding upwards, a wander along the rows, sizes of the effect.

    The covariance of the readings, without what the free columns take, is σ² (1 + w W) + B Bᵀ + s² C Cᵀ, with W of a random walk of
    variance 1 over the table, B the columns of the card's values and C those of an effect. Each frame whitens it but for C.
    """

    free: FloatArray
    target: FloatArray
    frames: tuple[tuple[float, FloatArray, float], ...]
    sizes: FloatArray

    def log_evidence(self, columns: FloatArray) -> float:
        """Log of the mean likelihood of the readings over noise and size."""
        values = self._likelihoods(columns)
        return float(scipy.special.logsumexp(values) - np.log(values.size))

    def white(self) -> float:
        """The white part of the noise, Hz, where nothing is there but noise."""
        values = self._likelihoods(np.empty((self.target.size, 0)))[:, 0]
        weight = np.exp(values - values.max())
        whites = np.array([white for white, _, _ in self.frames])
        return float(np.exp(np.sum(weight * np.log(whites)) / np.sum(weight)))

    def _likelihoods(self, columns: FloatArray) -> FloatArray:
        """(frame, size)."""
        y = self.free.T @ self.target
        own = self.free.T @ (columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300))
        sizes = self.sizes if columns.shape[1] else np.zeros(1)
        found = []
        for _, factor, logarithm in self.frames:
            white = scipy.linalg.solve_triangular(factor, np.column_stack([y, own]), lower=True)
            z = white[:, 0]
            along, strength, _ = np.linalg.svd(white[:, 1:], full_matrices=False)
            grown = (sizes[:, None] * strength) ** 2
            misfit = z @ z - np.sum((along.T @ z) ** 2 * grown / (1 + grown), axis=-1)
            found.append(-0.5 * (misfit + np.sum(np.log1p(grown), axis=-1)) - logarithm)
        return np.array(found)


def make_scale(base: TableBaseline, rounding: float, scatter: float, swing: float) -> Scale:
    """Lay out noise and sizes of readings beside a baseline.

    Parameters
    ----------
    base : TableBaseline
    rounding, scatter : float
        Least and largest white noise, Hz.
    swing : float
        Largest less smallest reading, Hz: an effect makes a tenth of it at most.
    """
    rows = np.arange(base.target.size) / base.target.size
    free = np.eye(base.target.size)
    if base.free.shape[1]:
        unit = base.free / np.linalg.norm(base.free, axis=0)
        free = np.linalg.qr(unit, mode="complete")[0][:, base.free.shape[1] :]
    walk = free.T @ np.minimum(rows[:, None], rows[None, :]) @ free
    known = free.T @ base.known
    most = max(scatter, 2.0 * rounding)
    frames = []
    for white in np.geomspace(rounding, most, 8):
        for wander in WANDERS if rows.size >= FEWEST_WANDERING else WANDERS[:1]:
            if np.sqrt(wander) * white <= MOST_WALK * most:
                factor = np.linalg.cholesky(white**2 * (np.eye(len(walk)) + wander * walk) + known @ known.T)
                frames.append((float(white), factor, float(np.log(np.diag(factor)).sum())))
    strong = max(0.1 * swing, 10.0 * rounding)
    return Scale(free, base.target, tuple(frames), np.geomspace(rounding, strong, 9))
