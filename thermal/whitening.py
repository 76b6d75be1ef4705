"""Noise with a memory: white noise plus a wandering level, as one filter that makes residuals white.

White noise plus a first-order wander x' = ρ x + … is in its steady state the process (1 − ρB) r = (1 − θB) e with
white e, B the shift by one row and 0 ≤ θ ≤ ρ ≤ 1: θ = ρ is white noise, θ = 0 the wander alone, ρ = 1 a random
walk. The pair is estimated by restricted likelihood, which does not take the freedom of the fit for quietness.
A record says little about the slowest part of its noise, and a wander that is taken for too fast or too weak makes
intervals too short; so the slowest, and then the strongest, that the record does not contradict is used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.signal import lfilter

from thermal.network import Array
from thermal.run import Rows

STARTS = ((7.0, 3.0), (3.0, 0.0))  # logits of ρ and of θ/ρ
ENDS = (-14.0, 14.0)  # bounds of both logits
SLOWER = 2.71  # growth of −2 ln L that is allowed for a slower wander: 90 % quantile of χ², one degree of freedom
STRONGER = 1.0  # the same for a stronger one: one standard deviation
HALVINGS = 8


@dataclass(frozen=True)
class Noise:
    """Wander ρ, smoothing θ (see the module) and the standard deviation of the innovations."""

    wander: float
    smoothing: float
    innovation: float


def whiten(columns: Array, breaks: Rows, noise: Noise) -> Array:
    """Filter columns (N, p) with (1 − ρB)/(1 − θB), anew after every break, and divide by the innovation."""
    white = np.empty_like(columns)
    edges = [0, *breaks.tolist(), len(columns)]
    for start, end in pairwise(edges):
        white[start:end] = lfilter([1.0, -noise.wander], [1.0, -noise.smoothing], columns[start:end], axis=0)
    return white / noise.innovation


def estimate_noise(residual: Array, slope: Array, breaks: Rows) -> Noise:
    """Estimate ρ, θ and σ from residuals (N,) of a fit with Jacobian `slope` (N, p) by restricted likelihood.

    −2 ln L = (N − p) ln RSS + ln det JᵀJ of the whitened columns (Patterson & Thompson 1971, Biometrika 58, 545).
    """
    columns = np.column_stack([slope / np.maximum(np.linalg.norm(slope, axis=0), 1e-300), residual])
    free = len(columns) - slope.shape[1]

    def criterion(logits: Array) -> float:
        # R of the whitened [J, r]: its last corner is the root of RSS, the rest the determinant. The ridge keeps
        # columns that the record cannot tell apart from deciding about the noise.
        R = _diagonal(whiten(columns, breaks, _unpack(logits)))
        return float(2 * free * np.log(R[-1] + 1e-300) + 2 * np.log(R[:-1] + 1e-6).sum())

    best = min(
        (minimize(criterion, start, method="L-BFGS-B", bounds=[ENDS, ENDS]) for start in STARTS),
        key=lambda result: float(result.fun),
    )

    def at_wander(wander: float) -> tuple[float, float]:
        found = minimize_scalar(
            lambda share: criterion(np.array([wander, share])), bounds=ENDS, method="bounded", options={"xatol": 0.1}
        )
        return float(found.fun), float(found.x)

    wander = _farthest(lambda wander: at_wander(wander)[0], float(best.x[0]), ENDS[1], float(best.fun) + SLOWER)
    value, share = at_wander(wander)
    share = _farthest(lambda share: criterion(np.array([wander, share])), share, ENDS[0], value + STRONGER)
    noise = _unpack(np.array([wander, share]))
    innovation = float(_diagonal(whiten(columns, breaks, noise))[-1]) / np.sqrt(free)
    return Noise(noise.wander, noise.smoothing, max(innovation, 1e-12))


def _farthest(criterion: Callable[[float], float], start: float, end: float, allowed: float) -> float:
    """Go from `start` towards `end` as far as the criterion is allowed."""
    if criterion(end) <= allowed:
        return end
    for _ in range(HALVINGS):
        middle = (start + end) / 2
        start, end = (middle, end) if criterion(middle) <= allowed else (start, middle)
    return start


def _diagonal(columns: Array) -> Array:
    diagonal: Array = np.abs(np.diag(np.asarray(np.linalg.qr(columns, mode="r"))))
    return diagonal


def _unpack(logits: Array) -> Noise:
    wander, share = 1 / (1 + np.exp(-np.asarray(logits)))
    return Noise(float(wander), float(wander * share), 1.0)
