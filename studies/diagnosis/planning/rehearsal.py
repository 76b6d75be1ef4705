"""Rehearsal of a diagnosis: effects hidden in planned runs, scanned and weighed by the same evidence as recorded ones.

Under a known noise model the baseline's posterior predictive is Gaussian, so that all cases go through the scan at once: one
projection, one eigenvalue problem a shape, and the gain of every shape in every case from them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.evidence import SCALES
from studies.diagnosis.model import Fit
from studies.diagnosis.noise import SHARES
from studies.diagnosis.scan import Bank, build_bank, leading
from studies.diagnosis.terms import Term, term_columns
from studies.diagnosis.verdict import weigh
from studies.effects import Effect, Parameter
from studies.effects.states import FloatArray

NOTHING = "nothing"
NOISES = {"white": (0, 0), "slow": (0, 5)}
"""White noise alone, and with a random walk besides: kind and place of its share."""
VISIBLE = 1e-4
"""Part of a signature that must survive the baseline for it to be seen at all."""
Answer = tuple[str, ...]
"""What is said, the likeliest first, with its equals."""


@dataclass(frozen=True)
class Stage:
    """One response of a campaign without effects, ready for hidden ones."""

    model: Fit
    bank: Bank
    effects: tuple[Effect, ...]
    noises: tuple["AssumedNoise", ...]


@dataclass(frozen=True)
class AssumedNoise:
    """One noise model: what the baseline takes away, and every shape beside it."""

    kind: int
    share: int
    root: FloatArray
    span: FloatArray
    moments: FloatArray
    eigen: tuple[tuple[FloatArray, FloatArray], ...]


@dataclass(frozen=True)
class Hidden:
    """Cases of one hidden effect at SNR 1 on rows of the grid, with their noise: (M, B) both, one assumed noise each."""

    effect: Effect
    left: FloatArray
    noise: FloatArray
    assumed: "np.ndarray"
    survives: float


def set_stage(model: Fit, effects: Sequence[Effect]) -> Stage:
    """Prepare the baseline of one response for the effects that can act on it."""
    bank = build_bank(model, effects)
    return Stage(model, bank, tuple(effects), tuple(_assume(model, bank, *noise) for noise in NOISES.values()))


def _assume(model: Fit, bank: Bank, kind: int, share: int) -> AssumedNoise:
    linear, problem = model.linear, model.problem
    basis, root = problem.noise.bases[kind], np.sqrt(problem.noise.weights(kind)[share])
    own = basis.rotate(linear.scaled) * root[:, None]
    rows = np.concatenate([own, np.diag(np.where(np.isinf(linear.prior), 0.0, 1.0))])
    span = np.linalg.qr(rows)[0][: own.shape[0]]
    table = bank.rotated(kind).astype(float) * root[:, None]
    inner = span.T @ table
    eigen = []
    for group in bank.groups:
        unit = group.prior / problem.sigma
        part, below = table.T[group.columns], inner.T[group.columns]
        gram = part @ part.transpose(0, 2, 1) - below @ below.transpose(0, 2, 1)
        values, vectors = np.linalg.eigh(gram * unit[:, :, None] * unit[:, None, :])
        eigen.append((np.maximum(values, 0.0), vectors))
    return AssumedNoise(kind, share, root, span, table - span @ inner, tuple(eigen))


def hide(stage: Stage, effect: Effect, cases: int, rng: np.random.Generator) -> Hidden:
    """Hide an effect of random shape `cases` times at SNR 1, under white and slow noise by turns."""
    problem, linear = stage.model.problem, stage.model.linear
    # the SNR counts what the law, the lag and the initial state cannot absorb; tolerated delays are not among them
    taken = [k for k, name in enumerate(stage.model.tangent.names) if not name.startswith(("delay", "missed"))]
    columns = linear.columns[:, taken]
    absorbs = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
    grid = list(effect.grid(problem.span, problem.response.column))
    places = np.sort(leading(effect, len(grid))[0])  # what a scan does not see it cannot rehearse
    signals, shares = [], []
    for _ in range(cases):
        shape = list(grid[int(rng.integers(len(grid)))])
        for k, parameter in enumerate(effect.shape):
            if parameter.moves(shape[k]) and not effect.once:
                ends = [own[k] for own in grid]  # a line faster than the grid of time shows is none that a run can have
                shape[k] = float(np.clip(_jitter(shape[k], parameter, rng), min(ends), max(ends)))
        term = Term(effect, tuple(shape))
        own = [
            term_columns(term, view, problem.group, problem.response.column)[:, places]
            for view in stage.model.tangent.views
        ]
        columns = problem.stack(own)
        sizes = rng.standard_normal(places.size) * effect.spread[places]
        if effect.positive:
            sizes[0] = abs(sizes[0])
        signal = columns @ sizes
        left = signal - absorbs @ (absorbs.T @ signal)
        share = float(np.linalg.norm(left)) / max(float(np.linalg.norm(signal)), 1e-300)
        shares.append(share)
        if share > VISIBLE:
            signals.append(left / np.linalg.norm(left) * np.sqrt(left.size))
    rows = problem.values.size
    survives = float(np.median(shares)) if shares else 0.0
    if not signals:
        return Hidden(effect, *(np.empty((rows, 0)),) * 2, np.empty(0, dtype=int), survives)
    which = np.arange(len(signals)) % len(stage.noises)
    noise, level = np.empty((rows, len(signals))), np.empty(len(signals))
    for n, assumed in enumerate(stage.noises):
        mine = np.flatnonzero(which == n)
        basis = problem.noise.bases[assumed.kind]
        drawn = rng.standard_normal((rows, mine.size)) / assumed.root[:, None] * problem.sigma
        noise[:, mine] = basis.unrotate(drawn)
        white = problem.sigma**2 * problem.noise.rows
        wander = problem.sigma**2 * SHARES[assumed.share] * basis.within
        level[mine] = np.sqrt(white + wander)
    return Hidden(effect, np.stack(signals, axis=1) * level, noise, which, survives)


def _jitter(value: float, parameter: Parameter, rng: np.random.Generator) -> float:
    moved = (
        value * float(np.exp(0.2 * rng.standard_normal()))
        if parameter.logarithmic
        else value + 0.02 * (parameter.high - parameter.low) * float(rng.uniform(-0.1, 0.1))
    )
    return float(np.clip(moved, parameter.low, parameter.high))


def rehearse(stage: Stage, hidden: Hidden, snr: float) -> list[Answer]:
    """Return the answer to every case of a hidden effect at one SNR."""
    answers: list[Answer] = [(NOTHING,)] * hidden.noise.shape[1]
    names = np.array([term.name for term in stage.bank.terms])
    distinct = list(dict.fromkeys(names.tolist()))
    column = stage.model.problem.response.column
    for n, assumed in enumerate(stage.noises):
        mine = np.flatnonzero(hidden.assumed == n)
        if not mine.size:
            continue
        gains = _gains(stage, assumed, snr * hidden.left[:, mine] + hidden.noise[:, mine])
        total = np.stack([logsumexp(gains[names == name], axis=0) - np.log((names == name).sum()) for name in distinct])
        for b, case in enumerate(mine):
            scores = total[:, b] + CONSTANTS["log_prior_effect"]
            if scores.max() < CONSTANTS["margin"]:
                continue
            members, _ = weigh(distinct, scores.tolist(), 0.0)
            best = next(e for e in stage.effects if e.name == distinct[int(np.argmax(scores))])
            exact = best.equivalents.get(column, ())
            answers[case] = tuple(dict.fromkeys([best.name, *members, *exact]))
    return answers


def _gains(stage: Stage, assumed: AssumedNoise, data: FloatArray) -> FloatArray:
    """Log evidence of every shape in every case, (H, B)."""
    linear, problem = stage.model.linear, stage.model.problem
    target = problem.noise.bases[assumed.kind].rotate(data) * assumed.root[:, None]
    inside = assumed.span.T @ target
    least = np.maximum((target**2).sum(axis=0) - (inside**2).sum(axis=0), 1e-300)
    moments = assumed.moments.T @ target
    freedom = linear.target.size - linear.flat
    out = np.empty((len(stage.bank.terms), data.shape[1]))
    for group, (values, vectors) in zip(stage.bank.groups, assumed.eigen, strict=True):
        moment = moments[group.columns] * (group.prior / problem.sigma)[:, :, None]
        along = np.einsum("hij,hib->hjb", vectors, moment)
        parts = []
        for scale in SCALES**2:
            explained = np.einsum("hj,hjb->hb", scale / (1.0 + scale * values), along**2)
            determinant = 0.5 * np.log1p(scale * values).sum(axis=1)
            parts.append(-determinant[:, None] - 0.5 * freedom * np.log(np.maximum(1.0 - explained / least, 1e-12)))
        out[group.terms] = logsumexp(np.stack(parts), axis=0) - np.log(SCALES.size)
    return out
