"""Marginal likelihood of a linear model in coloured noise, for every noise model and every size of its effects.

y = F φ + G γ + noise, φ with a flat prior (the static law), γ ~ N(0, D²) (initial states, delays, the members of an effect's
family). With σ² integrated out under its scale prior 1/σ² and D counted in the white noise that each noise model leaves in a row,

    log p(y | q) = −½ log|A| − ½ Σ log(1 + q walk) − ½ (M − p_F) log r,   A = [F GD]ᵀ W [F GD] + diag(0, 1)

where W are the weights of the noise model and r is what A leaves of yᵀWy. All noise models share one rotation a kind of
wander, and one Cholesky factor of the bordered matrix [A, b; bᵀ, c] gives determinant and remainder at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from studies.diagnosis.noise import KERNELS, SHARES, NoiseModels
from studies.effects.states import FloatArray

SCALES = 10.0 ** np.arange(-4.0, 0.51, 0.5)
"""Sizes of an effect, in parts of its strong cases: every half decade as likely as the next."""

START = -2
"""Owner of a column of what effects with memory had at the start of the first run."""


@dataclass(frozen=True)
class Linear:
    """A linear model of stacked rows.

    Attributes
    ----------
    target : (M,) array
    columns : (M, p) array
    prior : (p,) array
        Standard deviations of the coefficients; inf where the prior is flat (these come first). Those of an effect are
        for its strong cases.
    owner : (p,) int array
        −1 for the baseline, `START` − k for what effects with memory had at the start of run k, else the number of the term that a
        column belongs to.
    noise : NoiseModels
    sigma : float
        White noise of a row of the grid, for the scale of the priors.
    """

    target: FloatArray
    columns: FloatArray
    prior: FloatArray
    owner: "np.ndarray"
    noise: NoiseModels
    sigma: float

    @property
    def flat(self) -> int:
        """Number of columns with a flat prior."""
        return int(np.isinf(self.prior).sum())

    def sizes(self, scales: FloatArray) -> FloatArray:
        """Return the size of every column: that of its term, 1 for the baseline and for starts, (p,)."""
        return np.asarray(np.append(scales, 1.0)[np.maximum(self.owner, -1)])

    @property
    def scaled(self) -> FloatArray:
        """Columns in units of their prior over the noise."""
        return self.columns * np.where(np.isinf(self.prior), 1.0, self.prior / self.sigma)


@dataclass(frozen=True)
class Solved:
    """The linear model at its most likely noise and sizes.

    Attributes
    ----------
    log_evidence : float
        Over sizes, at the most likely noise, its prior included.
    kind, share : int
        Which wander and which share of it.
    scales : (terms,) array
        Size of every term, in parts of its strong cases.
    coefficients, covariance : (p,), (p, p) arrays
        Posterior mean and covariance.
    variance : float
        σ², of the white noise of a row of the grid.
    by_noise : (K, S) array
        Log evidence under every noise model, at these sizes.
    units : (K, S) array
        The usual white noise over that which each noise model leaves.
    """

    log_evidence: float
    kind: int
    share: int
    scales: FloatArray
    coefficients: FloatArray
    covariance: FloatArray
    variance: float
    by_noise: FloatArray = field(repr=False)
    units: FloatArray = field(repr=False)


class Grams:
    """The bordered matrices [F GD y]ᵀ W [F GD y] of a linear model under every noise model."""

    def __init__(self, model: Linear, scales: FloatArray, kinds: Sequence[int] | None = None) -> None:
        """Rotate the model once a kind of wander; only `kinds` where they are named."""
        self.model = model
        p, free = model.prior.size, model.columns[:, : model.flat]
        # squared, a level of 10⁷ would hide what is left of it: the flat columns take it first, at no change of the evidence
        self.taken = np.linalg.lstsq(free, model.target, rcond=None)[0]
        table = np.concatenate([model.scaled, (model.target - free @ self.taken)[:, None]], axis=1)
        self.kinds = tuple(range(len(KERNELS))) if kinds is None else tuple(kinds)
        live = np.flatnonzero(table.any(axis=0))
        self.grams = np.zeros((len(self.kinds), SHARES.size, p + 1, p + 1))
        self.constant = np.empty((len(self.kinds), SHARES.size))
        for k, kind in enumerate(self.kinds):
            basis = model.noise.bases[kind]
            rotated = basis.rotate(table[:, live])
            weights = model.noise.weights(kind)
            for s, w in enumerate(weights):
                self.grams[k, s, live[:, None], live] = (rotated * w[:, None]).T @ rotated
            self.constant[k] = 0.5 * np.log(weights).sum(axis=1) + model.noise.prior(kind)
        # sizes are known in units of the response: less white noise beside more wander makes no coefficient smaller
        self.units = np.ones(self.constant.shape)
        for _ in range(2 if scales.size or model.flat < p else 0):
            rest = self.factor(self.grams, scales, self.units)[..., p, p]
            self.units = model.sigma * np.sqrt(max(model.target.size - model.flat, 1)) / np.maximum(rest, 1e-150)

    def scaling(self, scales: FloatArray, units: FloatArray) -> FloatArray:
        """Return the factor of every column, and 1 for the target, (..., p + 1)."""
        own = np.append(self.model.sizes(scales), 1.0)
        return np.where(np.append(np.isinf(self.model.prior), True), own, own * np.asarray(units)[..., None])

    def log_evidence(self, scales: FloatArray, at: tuple[int, int] | None = None) -> FloatArray:
        """Return the log evidence at given sizes, under every noise model (K, S) or under one of them ()."""
        grams, units = (self.grams, self.units) if at is None else (self.grams[at], self.units[at])
        factor = self.factor(grams, scales, units)
        flat, p = self.model.flat, self.model.prior.size
        diagonal = np.diagonal(factor, axis1=-2, axis2=-1)
        rest = np.maximum(diagonal[..., p], 1e-150)
        freedom = self.model.target.size - flat
        constant = self.constant if at is None else self.constant[at]
        return np.asarray(constant - np.log(diagonal[..., :p]).sum(axis=-1) - freedom * np.log(rest))

    def factor(self, grams: FloatArray, scales: FloatArray, units: FloatArray) -> FloatArray:
        """Cholesky factor of the bordered matrix with the prior."""
        own = self.scaling(scales, units)
        bordered = grams * own[..., :, None] * own[..., None, :]
        flat, p = self.model.flat, self.model.prior.size
        places = np.arange(flat, p)
        bordered[..., places, places] += 1.0
        nowhere = np.flatnonzero(~self.model.columns[:, :flat].any(axis=0))  # the offset of a run that is left out
        bordered[..., nowhere, nowhere] += 1.0
        every = np.arange(p + 1)
        bordered[..., every, every] *= 1.0 + 1e-12
        return np.asarray(np.linalg.cholesky(bordered), dtype=float)


def solve(model: Linear, terms: int, scales: FloatArray | None = None, kinds: Sequence[int] | None = None) -> Solved:
    """Find the most likely noise and sizes, and the coefficients there.

    Parameters
    ----------
    model : Linear
    terms : int
        Number of effects in it whose size is looked for; with 0 the sizes are `scales`.
    scales : (terms,) array, optional
        Sizes to start from.
    kinds : sequence of int, optional
        Kinds of wander to look at; all unless given.
    """
    live = np.isinf(model.prior) | model.columns.any(axis=0)
    if not live.all():
        return _beside_nothing(model, live, terms, scales, kinds)
    sizes = np.full(terms, 0.1) if scales is None else np.array(scales, dtype=float)
    grams = Grams(model, sizes, kinds)
    marginal = 0.0
    by_noise = grams.log_evidence(sizes)
    for _ in range(2 if terms else 0):
        k, s = _largest(by_noise)
        marginal = 0.0
        for term in range(terms):
            tried = np.array([float(grams.log_evidence(_with(sizes, term, v), (k, s))) for v in SCALES])
            sizes[term] = SCALES[int(np.argmax(tried))]
            marginal += float(np.log(np.mean(np.exp(tried - tried.max()))))
        by_noise = grams.log_evidence(sizes)
    k, s = _largest(by_noise)
    factor = grams.factor(grams.grams[k, s], sizes, grams.units[k, s])
    p = model.prior.size
    lower, border = factor[:p, :p], factor[p, :p]
    mean = np.linalg.solve(lower.T, border)
    inverse = np.linalg.inv(lower)
    freedom = model.target.size - model.flat
    variance = float(factor[p, p] ** 2 / max(freedom, 1))
    units = grams.scaling(sizes, grams.units[k, s])[:-1] * np.where(
        np.isinf(model.prior), 1.0, model.prior / model.sigma
    )
    covariance = variance * (inverse.T @ inverse) * units[:, None] * units
    best = float(by_noise[k, s]) + marginal
    coefficients = mean * units
    coefficients[: model.flat] += grams.taken
    return Solved(best, grams.kinds[k], s, sizes, coefficients, covariance, variance, by_noise, grams.units)


def _beside_nothing(
    model: Linear, live: "np.ndarray", terms: int, scales: FloatArray | None, kinds: Sequence[int] | None
) -> Solved:
    """Solve without the columns that no row shows: their coefficients are what they were before, 0 ± prior."""
    seen = replace(model, columns=model.columns[:, live], prior=model.prior[live], owner=model.owner[live])
    found = solve(seen, terms, scales, kinds)
    unseen = model.sizes(found.scales) * np.where(live, 0.0, model.prior)
    covariance = np.diag(unseen**2)
    covariance[np.ix_(live, live)] = found.covariance
    coefficients = np.zeros(model.owner.size)
    coefficients[live] = found.coefficients
    return replace(found, coefficients=coefficients, covariance=covariance)


def _largest(table: FloatArray) -> tuple[int, int]:
    """Return row and column of the largest entry."""
    row, column = divmod(int(np.argmax(table)), table.shape[1])
    return row, column


def _with(values: FloatArray, place: int, value: float) -> FloatArray:
    out = values.copy()
    out[place] = value
    return out
