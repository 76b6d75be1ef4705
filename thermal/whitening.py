"""Noise with a memory: white noise plus a wandering level, as one filter that makes residuals white.

White noise plus a first-order wander x' = ρ x + … is in its steady state the process (1 − ρB) r = (1 − θB) e with
white e, B the shift by one row and 0 ≤ θ ≤ ρ ≤ 1: θ = ρ is white noise, θ = 0 the wander alone, ρ = 1 a random
walk. The pair is estimated by restricted likelihood, which does not take the freedom of the fit for quietness.
A record can rarely tell a slow wander from a random walk, and a wander that is taken for too fast makes intervals
too short; so the slowest wander that the record does not contradict is used.
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
SLACK = 2.71  # 90 % quantile of χ² with one degree of freedom
HALVINGS = 9


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
    noise = _unpack(_slowest_wander(criterion, best.x, float(best.fun) + SLACK))
    innovation = float(_diagonal(whiten(columns, breaks, noise))[-1]) / np.sqrt(free)
    return Noise(noise.wander, noise.smoothing, max(innovation, 1e-12))


def _slowest_wander(criterion: Callable[[Array], float], best: Array, allowed: float) -> Array:
    """Move from the best logits to the slowest wander whose criterion is still allowed."""

    def refine(wander: float) -> tuple[float, Array]:
        found = minimize_scalar(
            lambda share: criterion(np.array([wander, share])), bounds=ENDS, method="bounded", options={"xatol": 0.02}
        )
        return float(found.fun), np.array([wander, found.x])

    value, slowest = refine(ENDS[1])
    if value <= allowed:
        return slowest
    beyond = ENDS[1]
    for _ in range(HALVINGS):
        value, trial = refine((best[0] + beyond) / 2)
        if value <= allowed:
            best = trial
        else:
            beyond = trial[0]
    return best


def _diagonal(columns: Array) -> Array:
    diagonal: Array = np.abs(np.diag(np.asarray(np.linalg.qr(columns, mode="r"))))
    return diagonal


def _unpack(logits: Array) -> Noise:
    wander, share = 1 / (1 + np.exp(-np.asarray(logits)))
    return Noise(float(wander), float(wander * share), 1.0)
