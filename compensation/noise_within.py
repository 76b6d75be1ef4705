"""What rows say of noise within the coarse rows that they are averaged to: differences of neighbours, which the means have lost.

Of G groups of k even rows the k − 1 contrasts d of each are normal with C = Σ θ² QᵀAQ of the covariances A of every kind, Q the orthonormal contrasts:

    −2 ln L = G ln|C| + tr C⁻¹S,   S = Σ d dᵀ,

groups taken as independent of each other and of their means, as what is slow hardly differs within them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import Noise, flicker, gauss_markov_and_slope, random_walk
from compensation.noise_rows import KINDS, NoiseRows, level_slopes

EVEN = 1e-3
"""Part of a span by which rows may be uneven."""


@dataclass(frozen=True)
class Within:
    """Groups of as many even rows of a span (s): how many, the products S of their contrasts, and the covariance of these by a level of 1 of each of `KINDS` but correlated noise."""

    count: int
    span: float
    products: Array
    by_level: Array

    def deviance(self, noise: Noise) -> tuple[float, Array, Array, Array]:
        """Return −2 ln L (see the module), what is expected less what is seen for its slopes by ln θ of the `UNKNOWNS`, and their expected curvature."""
        squares = np.array([getattr(noise, kind) for kind in KINDS]) ** 2
        correlated = _correlated(len(self.products) + 1, self.span, noise.markov_time)
        by_level = np.concatenate([self.by_level, correlated])
        inverse = np.linalg.inv(np.tensordot(squares, by_level[:-1], 1))
        ways = level_slopes(noise)[:, None, None] * (inverse @ by_level)  # C⁻¹ ∂C/∂ln θ
        told = inverse @ self.products
        expected, seen = self.count * np.trace(ways, axis1=1, axis2=2), np.einsum("aij,ji->a", ways, told)
        curvature = self.count * np.einsum("aij,bji->ab", ways, ways)
        value = float(np.trace(told) - self.count * np.linalg.slogdet(inverse)[1])
        return value, expected, seen, curvature


def within(rows: NoiseRows, target: Array, columns: Array) -> list[Within]:
    """Return what a target (M,) says within the coarse rows beside columns (M, p), by groups of equal rows; outliers and gaps are left out."""
    if max(rows.together) == 1:
        return []
    rest, found = _left(rows, target, columns), dict[tuple[int, float], Array]()
    for own, t, spans, stretch, k in zip(rows.slices, rows.times, rows.spans, rows.stretch, rows.together, strict=True):
        if k == 1:
            continue
        whole = len(t) // k * k
        T, wide, more, y = (one[:whole].reshape(-1, k) for one in (t, spans, stretch, rest[own]))
        usual = float(np.median(wide))
        even = (np.abs(np.diff(T) - usual).max(1) < EVEN * usual) & (np.abs(wide - usual).max(1) < EVEN * usual)
        kept = y[even & (more == 1.0).all(1)]
        key = k, round(usual, 3)
        found[key] = np.vstack([found[key], kept]) if key in found else kept
    return [_within(kept, span) for (_, span), kept in found.items() if len(kept)]


def _left(rows: NoiseRows, target: Array, columns: Array) -> Array:
    """What columns and a level of each run leave of all rows: of a jump within a coarse row its mean knows nothing."""
    weight = 1.0 / np.sqrt(np.concatenate(rows.stretch))
    runs = np.repeat(np.eye(len(rows.times)), [len(t) for t in rows.times], axis=0)
    design = np.column_stack([columns, runs])
    best = scipy.linalg.lstsq(weight[:, None] * design, weight * target, lapack_driver="gelsy", check_finite=False)[0]
    return np.asarray(target - design @ best)


def _within(groups: Array, span: float) -> Within:
    k = groups.shape[1]
    Q, (at, wide) = _contrasts(k), _even(k, span)
    by_level: Sequence[Array] = (np.eye(k) / span, flicker(at, wide), random_walk(at, wide), np.zeros((k, k)))
    products = Q.T @ groups.T @ groups @ Q
    return Within(len(groups), span, products, np.array([Q.T @ own @ Q for own in by_level]))


def _correlated(k: int, span: float, tau: float) -> Array:
    """Covariance of the contrasts of k rows of a Gauss–Markov process of variance 1, and its slope by ln τ; 0 of none."""
    if not tau:
        return np.zeros((2, k - 1, k - 1))
    Q, rows = _contrasts(k), (*_even(k, span), tau)
    return np.array([Q.T @ own @ Q for own in gauss_markov_and_slope(*rows)])


def _contrasts(k: int) -> Array:
    return np.asarray(scipy.linalg.helmert(k).T)


def _even(k: int, span: float) -> tuple[Array, Array]:
    """Return times and spans of k even rows."""
    return span * np.arange(k, dtype=np.float64), np.full(k, span, np.float64)
