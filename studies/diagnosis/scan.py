"""All effects in all shapes at once: what each would add to the evidence of a fitted model, its leading columns alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from studies.diagnosis.evidence import SCALES
from studies.diagnosis.model import Fit, Problem, Term, term_columns
from studies.diagnosis.noise import KERNELS
from studies.effects import Effect, library
from studies.effects.states import FloatArray

LEADING, WIDTH = 0.4, 4
"""Columns that a scan looks at: those whose prior is at least this part of the widest, and at most so many."""
BLOCK = 4000
VARIES = 1e-3
"""Relative change from which on a drive varies."""


@dataclass(frozen=True)
class Bank:
    """Every shape of every effect, in the rotated rows of each kind of wander.

    Attributes
    ----------
    terms : tuple of Term
    columns : (H, WIDTH) int array
        Places of their leading columns; the last place holds zeros.
    prior : (H, WIDTH) array
    rotated : tuple of (M, C) float32 arrays
    """

    terms: tuple[Term, ...]
    columns: "np.ndarray"
    prior: FloatArray
    rotated: tuple["np.ndarray", ...]


def applicable(problem: Problem, model: Fit, effects: Sequence[Effect] | None = None) -> list[Effect]:
    """Return the effects that can act on this response: with drives that vary, a temperature to change, shapes that fit."""
    chosen = list(library().values()) if effects is None else list(effects)
    return [
        effect
        for effect in chosen
        if problem.response.column in effect.sizes
        and (model.baseline.lagged or not effect.thermal)
        and all(_varies(model, need) for need in effect.needs)
        and len(effect.grid(problem.span, problem.response.column))
    ]


def _varies(model: Fit, drive: str) -> bool:
    parts = [getattr(view.coarse, drive) for view in model.tangent.views]
    if any(part is None for part in parts):
        return False
    values = np.concatenate(parts)
    return bool(np.ptp(values) > VARIES * max(float(np.abs(values).max()), 1e-12))


def build_bank(model: Fit, effects: Sequence[Effect]) -> Bank:
    """Compute the leading columns of every shape, with the states that a fitted model sees."""
    problem, column = model.problem, model.problem.response.column
    terms, places, priors = [], [], []
    parts: list[FloatArray] = []
    count = 0
    for effect in effects:
        spread = effect.spread
        leading = [k for k in np.argsort(-spread, kind="stable") if spread[k] >= LEADING * spread.max()]
        size = problem.size(effect)
        for shape in effect.grid(problem.span, column):
            term = Term(effect, tuple(shape))
            own = problem.stack([term_columns(term, view, problem.group, column) for view in model.tangent.views])
            kept = [k for k in leading if np.any(own[:, k])][:WIDTH]
            if not kept:
                continue
            terms.append(term)
            parts.append(own[:, kept].astype(np.float32))
            places.append([*range(count, count + len(kept)), *[-1] * (WIDTH - len(kept))])
            priors.append([*(size * spread[kept]), *[0.0] * (WIDTH - len(kept))])
            count += len(kept)
    rows = problem.values.size
    table = np.concatenate([*parts, np.zeros((rows, 1), dtype=np.float32)], axis=1) if parts else np.zeros((rows, 1))
    rotated = tuple(basis.rotate(table.astype(np.float32)) for basis in problem.noise.bases)
    return Bank(
        tuple(terms),
        np.array(places, dtype=int).reshape(-1, WIDTH) % table.shape[1],
        np.array(priors, dtype=float).reshape(-1, WIDTH),
        rotated,
    )


@dataclass(frozen=True)
class Seen:
    """What a scan sees of one effect: its log evidence over all shapes, the best shape, and what the choice costs."""

    term: Term
    gain: float
    best: float

    @property
    def choice(self) -> float:
        """Log evidence over all shapes less that of the best one: never positive."""
        return min(self.gain - self.best, 0.0)


def scan(model: Fit, bank: Bank, models: int = 5) -> list[Seen]:
    """Return what every effect would add to a model, the strongest first."""
    if not bank.terms:
        return []
    by_noise = model.solved.by_noise
    picked = _noise_models(by_noise, models)
    top = float(by_noise.max())
    gains = [_gains(model, bank, kind, share) + (float(by_noise[kind, share]) - top) for kind, share in picked]
    gain = np.max(np.stack(gains), axis=0)
    out = []
    names = np.array([term.name for term in bank.terms])
    for name in dict.fromkeys(names.tolist()):
        own = np.flatnonzero(names == name)
        best = own[int(np.argmax(gain[own]))]
        total = float(logsumexp(gain[own]) - np.log(own.size))
        out.append(Seen(bank.terms[best], total, float(gain[best])))
    return sorted(out, key=lambda seen: -seen.gain)


def _noise_models(by_noise: FloatArray, count: int) -> list[tuple[int, int]]:
    """The likeliest share of each kind of wander, and the likeliest one with a tenth and with a hundredth of it.

    An effect that a model lacks has been taken for wander: with it there is less.
    """
    best = [(k, int(np.argmax(by_noise[k]))) for k in range(len(KERNELS))]
    best.sort(key=lambda pair: -by_noise[pair])
    kind, share = best[0]
    less = [(kind, max(share - 2, 0)), (kind, max(share - 4, 0))]
    return list(dict.fromkeys([best[0], *less, *best[1:]]))[:count]


def _gains(model: Fit, bank: Bank, kind: int, share: int) -> FloatArray:
    """Log evidence that every shape adds under one noise model, averaged over its size."""
    problem, linear = model.problem, model.linear
    basis = problem.noise.bases[kind]
    root = np.sqrt(problem.noise.weights(kind)[share])
    scales = np.ones(linear.owner.size)
    known = linear.owner >= 0
    scales[known] = model.solved.scales[linear.owner[known]]
    # columns in units of their prior, with one row more for each prior: least squares is then the posterior
    own = basis.rotate(linear.scaled) * root[:, None] * scales
    rows = np.concatenate([own, np.diag(np.where(np.isinf(linear.prior), 0.0, 1.0))])
    span = np.linalg.qr(rows)[0][: own.shape[0]]
    target = basis.rotate(linear.target) * root
    inside = span.T @ target
    rest = target - span @ inside
    least = max(float(target @ target - inside @ inside), 1e-300)
    freedom = linear.target.size - linear.flat
    left, turn = rest.astype(np.float32), root.astype(np.float32)[:, None]
    table = bank.rotated[kind]
    moment = np.empty(table.shape[1])
    weighted = np.empty_like(table)
    for begin in range(0, table.shape[1], BLOCK):
        part = table[:, begin : begin + BLOCK] * turn
        moment[begin : begin + BLOCK] = part.T @ left
        weighted[:, begin : begin + BLOCK] = part
    inner = span.T.astype(np.float32) @ weighted
    out = np.empty(len(bank.terms))
    for begin in range(0, out.size, BLOCK):
        chosen = bank.columns[begin : begin + BLOCK]
        unit = bank.prior[begin : begin + BLOCK] / linear.sigma
        part, below = weighted.T[chosen], inner.T[chosen]
        gram = np.einsum("him,hjm->hij", part, part) - np.einsum("him,hjm->hij", below, below)
        gram = gram.astype(float) * unit[:, :, None] * unit[:, None, :]
        values, vectors = np.linalg.eigh(gram)
        along = np.einsum("hij,hi->hj", vectors, moment[chosen] * unit)
        values = np.maximum(values, 0.0)[None]
        size = (SCALES**2)[:, None, None]
        determinant = 0.5 * np.log1p(size * values).sum(axis=-1)
        explained = (size * along[None] ** 2 / (1.0 + size * values)).sum(axis=-1)
        gains = -determinant - 0.5 * freedom * np.log(np.maximum(1.0 - explained / least, 1e-12))
        out[begin : begin + BLOCK] = logsumexp(gains, axis=0) - np.log(SCALES.size)
    return out
