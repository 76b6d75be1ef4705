"""A model of effects at given noise, beside which one more is weighed by its own small Gram matrix (`studies.inference.linear`)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.noise import Noise
from compensation.noise_estimate import log_prior
from compensation.noise_rows import NoiseRows, Whitener
from studies.calibration.noise_levels import OUTLIER, estimate_levels, spare_outliers
from studies.effects import Effect
from studies.inference.linear import SCALES, Linear, Term, solve_posterior

AT_ONCE = 500_000
"""Numbers of columns that are weighed at once, in memory."""


@dataclass(frozen=True)
class Background:
    """A model at given noise, beside which one more effect is weighed."""

    linear: Linear
    terms: tuple[Term, ...]
    noise: Mapping[str, Noise]

    @cached_property
    def _bent(self) -> Linear:
        return self.linear.bent(self.terms)

    @cached_property
    def _solved(self) -> tuple[dict[str, Array], dict[str, Array], float, Array]:
        """Rows of the orthonormal base and what it leaves, by response; log likelihood; triangle R of [X; 1]."""
        X, r, determinant = self._bent.whitened(self.terms, self.noise)
        p = next(iter(X.values())).shape[1]
        Q, R = np.linalg.qr(np.vstack([*X.values(), np.eye(p)]))
        target = np.concatenate([*r.values(), np.zeros(p)])
        rest = target - Q @ (Q.T @ target)
        evidence = -0.5 * (determinant + 2 * np.log(np.abs(np.diag(R))).sum() + rest @ rest)
        base, left, at = {}, {}, 0
        for name, rows in X.items():
            base[name], left[name] = Q[at : at + len(rows)], rest[at : at + len(rows)]
            at += len(rows)
        return base, left, float(evidence), R

    @cached_property
    def _whiteners(self) -> dict[str, Whitener]:
        return {name: self.linear.rows[name].whitener(level) for name, level in self.noise.items()}

    @property
    def evidence(self) -> float:
        """Log marginal likelihood, all linear unknowns integrated out, and log prior of the noise."""
        return self._solved[2] + sum(
            log_prior(self.linear.rows[name], level, self.linear.stated(name)) for name, level in self.noise.items()
        )

    @cached_property
    def spared(self) -> dict[str, NoiseRows]:
        """Rows with what stands out of this model for outliers, whatever was taken for them before."""
        whole = self.linear.problem.rows
        return {n: spare_outliers(whole[n], self.residual(n), level)[0] for n, level in self.noise.items()}

    @property
    def fair(self) -> float:
        """Evidence in those rows: as any other model may be judged."""
        return replace(self, linear=replace(self.linear, rows=self.spared)).evidence

    @property
    def hides_outliers(self) -> bool:
        """Whether rows stand out of this model that are not spared, and may have made one of its effects."""
        pairs = ((own.stretch, self.linear.rows[n].stretch) for n, own in self.spared.items())
        return any(bool(np.any((a > 1) & (b == 1))) for new, old in pairs for a, b in zip(new, old, strict=True))

    def gains(self, columns: Mapping[str, NDArray[np.floating]], units: Array, effect: Effect) -> Array:
        """Return what effects of columns (M, H, k) and units (H, k) add to the evidence at SCALES, (S, H); −∞ against the first column."""
        some = max(1, AT_ONCE // (units.shape[1] * max(len(own) for own in columns.values())))
        if len(units) > some:
            parts = (slice(k, k + some) for k in range(0, len(units), some))
            each = [self.gains({n: own[:, h] for n, own in columns.items()}, units[h], effect) for h in parts]
            return np.concatenate(each, axis=1)
        values, ways, along = self.against(
            columns, units, {name: rest[:, None] for name, rest in self._solved[1].items()}
        )
        along = along[:, :, 0]
        size = (SCALES**2)[:, None, None]
        gain = -0.5 * np.log1p(size * values).sum(-1) + 0.5 * (size * along**2 / (1 + size * values)).sum(-1)
        best = SCALES[np.argmax(gain, axis=0)][:, None] ** 2
        coefficient = np.einsum("hij,hj->hi", ways, best * along / (1 + best * values))
        first = coefficient[:, 0] * units[:, 0]
        gain[:, (np.abs(first) > effect.coefficients[0].most) | ((first < 0) & effect.positive)] = -np.inf
        return np.asarray(gain)

    def against(
        self, columns: Mapping[str, NDArray[np.floating]], units: Array, left: Mapping[str, Array]
    ) -> tuple[Array, Array, Array]:
        """Return eigenvalues (H, k) and eigenvectors (H, k, k) of the Gram matrices of effects, and the moments of B
        residuals `left` along these.
        """
        base, (H, k) = self._solved[0], units.shape
        gram, moment = np.zeros((H, k, k)), np.zeros((H, k, next(iter(left.values())).shape[1]))
        beside = np.zeros((next(iter(base.values())).shape[1], H * k))
        for name, own in columns.items():
            white = self._whiteners[name](own.reshape(len(own), H * k))
            moment += (white.T @ left[name]).reshape(moment.shape)
            beside += base[name].T @ white
            stacked = white.reshape(len(own), H, k).transpose(1, 2, 0)
            gram += stacked @ stacked.transpose(0, 2, 1)
        shared = beside.reshape(-1, H, k).transpose(1, 2, 0)
        gram -= shared @ shared.transpose(0, 2, 1)
        values, ways = np.linalg.eigh(gram * units[:, :, None] * units[:, None, :])
        along = ways.transpose(0, 2, 1) @ (moment * units[:, :, None])
        return np.maximum(values, 0.0), ways, along

    def weighed(self, name: str) -> list[Array]:
        """Return Σ⁻¹ times what this model leaves of a response, of each run."""
        whitener, left = self._whiteners[name], self._solved[1][name]
        found = {run: K.T @ left[whitener.slices[run]] for K, runs in whitener.roots for run in runs}
        return [found[run] for run in sorted(found)]

    def left_of(self, signals: Mapping[str, Array]) -> tuple[dict[str, Array], Array, Array]:
        """Return what this model cannot absorb of signals, response -> (M, B): whitened rows, their energy (B,), and the coordinates (p, B) that absorb the rest."""
        base, _, _, R = self._solved
        white = {name: self._whiteners[name](own) for name, own in signals.items()}
        names = list(white)
        taken = np.vstack([base[name] for name in names]).T @ np.vstack([white[name] for name in names])
        energy = np.sum([(own**2).sum(axis=0) for own in white.values()], axis=0) - (taken**2).sum(axis=0)
        left = {name: white.get(name, 0.0) - base[name] @ taken for name in base}
        return left, np.maximum(energy, 0.0), np.asarray(scipy.linalg.solve_triangular(R, taken))

    def by_scale(self, term: Term) -> Array:
        """Log evidence that a term adds at each of `SCALES`."""
        beside = replace(self, linear=self.linear.bent([term])) if term.bend else self
        there = np.any([X.any(axis=0) for X in term.columns.values()], axis=0)
        there[0] = True  # it says which way the effect goes
        columns = {n: X[:, None, there] for n, X in term.columns.items()}
        own = beside.gains(columns, term.unit[None, there], term.effect)[:, 0]
        return np.asarray(beside.evidence - self.evidence + own)

    def with_term(self, term: Term) -> tuple[Term, float]:
        """Return a term at its likeliest scale, and the log evidence that it adds, its scales averaged."""
        gain = self.by_scale(term)
        total = float(scipy.special.logsumexp(gain) - np.log(len(gain)))
        return replace(term, scale=float(SCALES[int(np.argmax(gain))])), total

    @cached_property
    def posterior(self) -> tuple[Array, Array]:
        """Mean and covariance of all coordinates: the card's and starts, then coefficients in units of their priors."""
        return solve_posterior(*self._bent.stacked(self.terms, self.noise), self.linear.problem.ends)

    def coefficients(self, k: int) -> tuple[Array, Array]:
        """Return mean and covariance of the coefficients of one term, in its own units."""
        begin = self.linear.count + sum(len(term.unit) for term in self.terms[:k])
        own = slice(begin, begin + len(self.terms[k].unit))
        mean, covariance = self.posterior
        spread = self.terms[k].spread
        return mean[own] * spread, covariance[own, own] * np.outer(spread, spread)

    def peak_to_peak(self, k: int, response: str) -> tuple[float, float]:
        """Return how far the change of a response by one term reaches over the rows, and the standard deviation of that."""
        (mean, C), own = self.coefficients(k), self.terms[k].columns[response]
        change = own @ mean
        way = own[np.argmax(change)] - own[np.argmin(change)]
        return float(way @ mean), float(np.sqrt(way @ C @ way))

    def sized(self, k: int) -> bool:
        """Whether the definite coefficients of a term are not all 0, by 90 % of what is known of them together: cᵀC⁻¹c against χ²."""
        term = self.terms[k]
        firsts = np.cumsum([0, *(len(one.spread) for one in term.effect.coefficients[:-1])])
        own = [term.members.index(first) for first in firsts if first in term.members]
        mean, C = self.coefficients(k)
        c, own_C = mean[own], C[np.ix_(own, own)]
        return not own or bool(c @ np.linalg.pinv(own_C) @ c > scipy.special.chdtri(len(own), 0.1))

    def left_out(self, name: str) -> Array:
        """Return by how much each row of a response, left out, is missed: (P y)_i/P_ii of P = (Σ + X Xᵀ)⁻¹."""
        base, left, _, _ = self._solved
        root = self._whiteners[name](np.eye(len(left[name])))
        own = np.sum(root**2, axis=0) - np.sum((base[name].T @ root) ** 2, axis=0)
        return np.asarray(root.T @ left[name] / own)

    def size(self, name: str, left: Mapping[str, Array]) -> float:
        """Return the square of what is left of a response in this noise, of which no row decides alone."""
        return float(np.sum(np.minimum(self._whiteners[name](left[name]) ** 2, OUTLIER**2)))

    def residual(self, name: str) -> Array:
        """Return what the most probable model leaves of a response."""
        return np.asarray(self._bent.target[name] - self._bent.columns(self.terms, name) @ self.posterior[0])


def estimate_noise_of(
    linear: Linear, terms: Sequence[Term], noise: Mapping[str, Noise], names: Sequence[str] = ()
) -> dict[str, Noise]:
    """Return the levels of highest marginal likelihood of each response (or those named), given what the others say."""
    linear = linear.bent(terms)
    slopes, told = {name: linear.columns(terms, name) for name in linear.responses}, linear.told_beside(terms)
    there = np.any([own.any(axis=0) for own in slopes.values()], axis=0)  # what no row shows says nothing of noise
    if told is not None:
        there |= told[:, :-1].any(axis=0)
        told = told[:, np.append(there, True)]
    slopes = {name: own[:, there] for name, own in slopes.items()}
    return estimate_levels(linear.problem, linear.rows, linear.target, slopes, noise, names or linear.responses, told)
