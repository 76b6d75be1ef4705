"""All effects in all shapes at once: what each would add to the evidence of a fitted model, its leading columns alone."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from studies.diagnosis.evidence import SCALES
from studies.diagnosis.model import Fit
from studies.diagnosis.noise import KERNELS, NoiseModels
from studies.diagnosis.problem import Problem
from studies.diagnosis.terms import Term, term_columns
from studies.effects import Effect, library
from studies.effects.states import FloatArray

FEW = 40
"""An effect with no more shapes than this is scanned with its whole family."""
LEADING, WIDTH = 0.4, 4
"""Of others the columns whose prior is at least this part of the widest, and at most so many beside the widest."""
BLOCK = 500
HILLS, NEARLY = 0.2, 5.0
"""Part of the best evidence, and log evidence beside it, by which another hill of shapes may seem lower before it is climbed."""
VARIES = 1e-3
"""Relative change from which on a drive varies."""


@dataclass(frozen=True)
class Group:
    """Shapes with the same number of columns: their places in the bank, (H,), those of their columns and priors, (H, w)."""

    terms: "np.ndarray"
    columns: "np.ndarray"
    prior: FloatArray


@dataclass(frozen=True)
class Bank:
    """Every shape of every effect.

    Attributes
    ----------
    terms : tuple of Term
    groups : tuple of Group
    table : (M, C) float32 array
    noise : NoiseModels
    turned : dict
        The table in the rotated rows of the kinds of wander that were asked for.
    """

    terms: tuple[Term, ...]
    groups: tuple[Group, ...]
    table: "np.ndarray" = field(repr=False)
    noise: NoiseModels = field(repr=False)
    turned: dict[int, "np.ndarray"] = field(default_factory=dict, repr=False)

    def rotated(self, kind: int) -> "np.ndarray":
        """Return the table in the rotated rows of one kind of wander."""
        if kind not in self.turned:
            self.turned[kind] = self.noise.bases[kind].rotate(self.table)
        return self.turned[kind]


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


def leading(effect: Effect, shapes: int) -> tuple[list[int], int]:
    """Return the columns with which an effect of so many shapes is scanned, the widest first, and how many of them at most."""
    spread = effect.spread
    least = 0.0 if shapes <= FEW else LEADING * float(spread.max())
    first = [int(k) for k in np.argsort(-spread, kind="stable") if spread[k] >= least and spread[k] > 0]
    return first, len(first) if shapes <= FEW else max(WIDTH, int(np.sum(spread == spread.max())))


def build_bank(model: Fit, effects: Sequence[Effect]) -> Bank:
    """Compute the leading columns of every shape, with the states that a fitted model sees."""
    problem, column = model.problem, model.problem.response.column
    terms: list[Term] = []
    parts: list[FloatArray] = []
    found: dict[int, list[tuple[int, list[int], FloatArray]]] = {}
    count = 0
    for effect in effects:
        spread, shapes = effect.spread, effect.grid(problem.span, column)
        first, most = leading(effect, len(shapes))
        size = problem.size(effect)
        for shape in shapes:
            term = Term(effect, tuple(shape))
            own = problem.stack([term_columns(term, view, problem.group, column) for view in model.tangent.views])
            there = np.any(own, axis=0).tolist()
            kept = [k for k in first if there[k]][:most]
            if not kept:
                continue
            places = list(range(count, count + len(kept)))
            found.setdefault(len(kept), []).append((len(terms), places, size * spread[kept]))
            terms.append(term)
            parts.append(own[:, kept].astype(np.float32))
            count += len(kept)
    table: FloatArray = np.concatenate([part.T for part in parts]).T if parts else np.zeros((problem.values.size, 1))
    groups = tuple(
        Group(np.array([f[0] for f in own]), np.array([f[1] for f in own]), np.array([f[2] for f in own]))
        for own in found.values()
    )
    return Bank(tuple(terms), groups, table, problem.noise)


@dataclass(frozen=True)
class Seen:
    """What a scan sees of one effect: its log evidence over all shapes, the best shape, and what the choice costs.

    `shapes` is how many were tried; `other` is the best of them that lies apart in every parameter, where its evidence is
    near: the top of another hill.
    """

    term: Term
    gain: float
    best: float
    shapes: int
    other: Term | None = None

    @property
    def narrow(self) -> bool:
        """Whether it may lie between its many shapes and be seen as much less than it is."""
        return self.shapes > FEW

    @property
    def choice(self) -> float:
        """Log evidence over all shapes less that of the best one: never positive."""
        return min(self.gain - self.best, 0.0)


def scan(model: Fit, bank: Bank, models: int = 5, like: Fit | None = None) -> list[Seen]:
    """Return what every effect would add to a model, the strongest first; in the noise of another model if one is given."""
    if not bank.terms:
        return []
    by_noise = model.solved.by_noise
    picked = _noise_models(by_noise, models) if like is None else [(like.solved.kind, like.solved.share)]
    top = float(by_noise.max())
    gains = [_gains(model, bank, kind, share) + (float(by_noise[kind, share]) - top) for kind, share in picked]
    gain = np.max(np.stack(gains), axis=0)
    out = []
    names = np.array([term.name for term in bank.terms])
    for name in dict.fromkeys(names.tolist()):
        own = np.flatnonzero(names == name)
        best = own[int(np.argmax(gain[own]))]
        if not np.isfinite(gain[best]):
            continue  # of the wrong sign in every shape
        total = float(scipy.special.logsumexp(gain[own]) - np.log(own.size))
        out.append(Seen(bank.terms[best], total, float(gain[best]), own.size, _other_hill(bank, gain, own, int(best))))
    return sorted(out, key=lambda seen: -seen.gain)


def _other_hill(bank: Bank, gain: FloatArray, own: "np.ndarray", best: int) -> Term | None:
    """Return the best of the shapes that differ from the best one in every one of several free parameters; None if far below.

    One lag of an effect on the temperature moves with the baseline's own: then a shape beyond the next ones.
    """
    effect = bank.terms[best].effect
    free = [k for k, parameter in enumerate(effect.shape) if not parameter.steady]
    shapes = np.array([bank.terms[k].shape for k in own])[:, free]
    if len(free) == 1 and effect.thermal:
        place = np.argsort(np.argsort(shapes[:, 0]))
        apart = own[np.abs(place - place[own == best]) > 1]
    elif len(free) > 1:
        apart = own[np.all(shapes != np.array(bank.terms[best].shape)[free], axis=1)]
    else:
        return None
    if not apart.size or gain[apart].max() < (1.0 - HILLS) * gain[best] - NEARLY:
        return None
    return bank.terms[int(apart[np.argmax(gain[apart])])]


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
    problem, linear, sigma = model.problem, model.linear, model.linear.sigma / model.solved.units[kind, share]
    basis = problem.noise.bases[kind]
    root = np.sqrt(problem.noise.weights(kind)[share])
    scales = linear.sizes(model.solved.scales)
    scales[np.isfinite(linear.prior)] *= linear.sigma / sigma
    # columns in units of their prior, with one row more for each prior: least squares is then the posterior
    own = basis.rotate(linear.scaled) * root[:, None] * scales
    rows = np.concatenate([own, np.diag(np.where(np.isinf(linear.prior), 0.0, 1.0))])
    span = np.linalg.qr(rows)[0]
    top = own.shape[0]
    target = np.append(basis.rotate(linear.target) * root, np.zeros(rows.shape[0] - top))
    rest = target - span @ (span.T @ target)
    least = max(float(rest @ rest), 1e-300)
    freedom = linear.target.size - linear.flat
    turn, narrow = root.astype(np.float32)[:, None], span.astype(np.float32)
    table = bank.rotated(kind)
    beside = np.empty((rows.shape[0], table.shape[1]), dtype=np.float32, order="F")
    for begin in range(0, table.shape[1], BLOCK):
        # what is left of a column may be a thousandth of it: projected before it is squared, in single precision
        part = table[:, begin : begin + BLOCK] * turn
        inside = part.T @ narrow[:top]
        beside[:top, begin : begin + BLOCK] = part - (inside @ narrow[:top].T).T
        beside[top:, begin : begin + BLOCK] = -(inside @ narrow[top:].T).T
    moment = beside.T @ rest.astype(np.float32)
    out = np.empty(len(bank.terms))
    for group in bank.groups:
        for begin in range(0, group.terms.size, BLOCK):
            place = slice(begin, begin + BLOCK)
            chosen = group.columns[place]
            unit = group.prior[place] / sigma
            columns, own = beside.T[chosen], moment[chosen]
            if (
                chosen.shape[1] > WIDTH
            ):  # many columns are nearly of one plane: single precision would find more than is there
                columns = columns.astype(float)
                own = columns @ rest
            gram = (columns @ columns.transpose(0, 2, 1)).astype(float) * unit[:, :, None] * unit[:, None, :]
            values, vectors = np.linalg.eigh(gram)
            along = np.einsum("hij,hi->hj", vectors, own * unit)
            values = np.maximum(values, 0.0)[None]
            size = (SCALES**2)[:, None, None]
            determinant = 0.5 * np.log1p(size * values).sum(axis=-1)
            explained = (size * along[None] ** 2 / (1.0 + size * values)).sum(axis=-1)
            gains = -determinant - 0.5 * freedom * np.log(np.maximum(1.0 - explained / least, 1e-12))
            # what it does along its first column
            first = (vectors[:, 0] * values[0] * along / (1.0 + values[0])).sum(axis=-1)
            wrong = np.array([bank.terms[k].effect.positive for k in group.terms[place]]) & (first < 0.0)
            out[group.terms[place]] = np.where(
                wrong, -np.inf, scipy.special.logsumexp(gains, axis=0) - np.log(SCALES.size)
            )
    return out
