"""A wandering level beside white noise, estimated with care from the rows of a fit.

White noise plus a first-order wander x' = ρ x + … is in its steady state (1 − ρL) ε = (1 − θL) e with white e, L the step
back and θ ≤ ρ ≤ 1: θ = ρ is white noise alone, θ = 0 the wander alone. Filtering with (1 − ρL)/(1 − θL) makes least squares valid.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.noise_regression import Runs
from compensation.recursion import recur

Array = NDArray[np.float64]
STARTS = ((7.0, 3.0), (3.0, 0.0))  # logits of ρ and of θ/ρ
ENDS = (-14.0, 14.0)  # bounds of both logits
SLOWER = 2.71  # growth of −2 ln L that is allowed for a slower wander: 90 % quantile of χ², one degree of freedom
STRONGER = 1.0  # the same for a stronger one: one standard deviation
HALVINGS = 8
RIDGE = 1e-6  # keeps columns that the record cannot tell apart from deciding about the noise


@dataclass(frozen=True)
class Wander:
    """Noise (1 − ρL) ε = (1 − θL) e: `smoothing` θ, `memory` ρ and the standard deviation of e, the innovation."""

    smoothing: float
    memory: float = 1.0
    innovation: float = 1.0


def whiten(Z: Array, noise: Wander, runs: Runs) -> Array:
    """Filter the columns of Z (m, k), or the vector Z, with (1 − ρL)/(1 − θL)/σ, starting anew with every run."""
    forced = (np.concatenate([part[:1], part[1:] - noise.memory * part[:-1]]) for part in (Z[run] for run in runs))
    return np.concatenate([recur(noise.smoothing, part) for part in forced]) / noise.innovation


def _deviance(X: Array, y: Array, noise: Wander, runs: Runs) -> float:
    """−2 ln L = (m − k) ln RSS + ln det XᵀX of the whitened rows; columns of X are of length one."""
    R = _diagonal(np.column_stack([whiten(X, noise, runs), whiten(y, noise, runs)]))
    rest, determinant = np.maximum(R[-1], 1e-300), R[:-1] + RIDGE
    return float(2 * (y.size - X.shape[1]) * np.log(rest) + 2 * np.sum(np.log(determinant)))


def estimate_wander(X: Array, y: Array, runs: Runs) -> Wander:
    """Return the slowest, and then the strongest, wander that y = X b + ε does not contradict, X (m, k).

    A record says little about the slowest part of its noise, and a wander that is taken for too fast or too weak makes
    intervals too short.
    """
    scale = np.linalg.norm(X, axis=0)
    X, free = X / np.where(scale > 0, scale, 1.0), y.size - X.shape[1]

    def criterion(memory: float, share: float) -> float:
        return _deviance(X, y, _of_logits(memory, share), runs)

    def at_memory(memory: float) -> tuple[float, float]:
        found = scipy.optimize.minimize_scalar(
            lambda share: criterion(memory, share), bounds=ENDS, method="bounded", options={"xatol": 0.1}
        )
        return float(found.fun), float(found.x)

    def both(logits: Array) -> float:
        return criterion(float(logits[0]), float(logits[1]))

    best = min(
        (scipy.optimize.minimize(both, np.array(start), method="L-BFGS-B", bounds=[ENDS, ENDS]) for start in STARTS),
        key=lambda result: float(result.fun),
    )
    memory = _farthest(lambda memory: at_memory(memory)[0], float(best.x[0]), ENDS[1], float(best.fun) + SLOWER)
    value, share = at_memory(memory)
    share = _farthest(lambda share: criterion(memory, share), share, ENDS[0], value + STRONGER)
    noise = _of_logits(memory, share)
    rest = _diagonal(np.column_stack([whiten(X, noise, runs), whiten(y, noise, runs)]))[-1]
    return Wander(noise.smoothing, noise.memory, max(float(rest) / np.sqrt(free), 1e-12))


def _farthest(criterion: Callable[[float], float], start: float, end: float, allowed: float) -> float:
    """Go from `start` towards `end` as far as the criterion is allowed."""
    if criterion(end) <= allowed:
        return end
    for _ in range(HALVINGS):
        middle = (start + end) / 2
        start, end = (middle, end) if criterion(middle) <= allowed else (start, middle)
    return start


def _diagonal(columns: Array) -> Array:
    return np.asarray(np.abs(np.diag(scipy.linalg.qr(columns, mode="r", check_finite=False)[0])))


def _of_logits(memory: float, share: float) -> Wander:
    rho, part = 1 / (1 + np.exp(-memory)), 1 / (1 + np.exp(-share))
    return Wander(float(rho * part), float(rho))
