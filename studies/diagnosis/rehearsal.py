"""Rehearse a diagnosis: hide every effect in a campaign that has none, and see what would be said.

The hidden effect and the noise are drawn row by row on the grid of the campaign. All cases of a response are scanned at
once, each under the kind of slow noise that suits it best. Where the scan leaves a choice, the contenders of a sample of
the cases are fitted as on real data. Where nothing is named, the generic witness is asked.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.baseline import Problem, Term, restricted, span_of
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.discrepancy import LEVEL, generic_bases, leftover_evidence
from studies.diagnosis.effects import Effect, Parameter, Span, find_effect
from studies.diagnosis.fit import Fit, fit_terms
from studies.diagnosis.likelihood import KERNELS, SHARES, NoiseBasis, orthonormal
from studies.diagnosis.null import shipped_levels
from studies.diagnosis.scan import Bank, Candidate, Dictionary, applicable, build_dictionary, scan_bank
from studies.diagnosis.selection import Found, polish_contenders, scan_model
from studies.diagnosis.states import FloatArray
from studies.diagnosis.thermometer import corrected
from studies.diagnosis.verdict import equivalent_to

NOTHING, UNEXPLAINED = "nothing", "unexplained"
SLOW_NOISE = (0.1, 1.0)
"""Range of the slow noise's rms over that of the white noise of one row; four cases in five have some."""
VISIBLE = 3e-3
"""Part of a signature's rms that must survive the baseline for an effect to be hidden at an SNR at all."""
PREFERRED = 1.0
"""How much likelier another kind of slow noise must be than the first."""
WORTH_FITTING, WITHIN_REACH, REACH = 0.6, 0.5, 8.0
"""From this part of the threshold the diagnosis fits a candidate, and its rivals from this part of its evidence."""

Answer = tuple[str, ...]
"""The members of the set that is named, the strongest first; or `nothing`, or `unexplained`."""


@dataclass(frozen=True)
class Side:
    """One response under one kind of slow noise: its plain fit and the rotated signatures."""

    fit: Fit
    model: FloatArray
    dictionary: Dictionary


@dataclass(frozen=True)
class Stage:
    """One response of a campaign without effects.

    Attributes
    ----------
    problem : Problem
    span : Span
    effects : tuple of Effect
        Those that can act on the response here.
    plain : (M,) array
        The fitted baseline.
    absorbs : (M, p) array
        Orthonormal columns of what the baseline can absorb, its lag included.
    white : float
        Variance of the white noise of a step of the grid.
    rows : float
        Rows of the record in a step.
    threshold : float
        Evidence that a cause needs.
    sides : mapping from kind of slow noise to Side
    """

    problem: Problem
    span: Span
    effects: tuple[Effect, ...]
    plain: FloatArray
    absorbs: FloatArray
    white: float
    rows: float
    threshold: float
    sides: Mapping[str, Side]


@dataclass(frozen=True)
class Hidden:
    """Cases that hide one effect: the whole signal, what the baseline leaves of it, and the noise, (M, B) each."""

    effect: Effect
    signals: FloatArray
    left: FloatArray
    noise: FloatArray
    survives: float


def set_stage(campaign: Campaign, fit: Fit, threshold: float, span_tau: float) -> Stage:
    """Prepare one response of a campaign.

    Parameters
    ----------
    campaign : Campaign
    fit : Fit
        Baseline alone.
    threshold : float
        Evidence that a cause needs.
    span_tau : float
        Time constant from which shapes are drawn, s.
    """
    problem = fit.problem
    span = span_of(campaign, span_tau)
    effects = tuple(e for e in applicable(problem) if e.name != "calibration")
    sides = {}
    for kernel in KERNELS:
        own = fit_terms(restricted(problem, kernel=kernel), (), rounds=0)
        sides[kernel] = Side(own, scan_model(own), build_dictionary(own.problem, span, effects))
    columns = fit.columns()
    plain = columns @ fit.linear.coefficients
    if problem.delay_row is not None:
        plain[-1] = 0.0  # the prior of the delay, which every case has
    lag = problem.lag_column(problem.tau, (), fit.linear.coefficients)
    steps = sum(int(mask.sum()) for mask in problem.present)
    rows = sum(int(np.isfinite(run.row_responses[problem.response]).sum()) for run in campaign.runs)
    return Stage(
        problem,
        span,
        effects,
        plain,
        orthonormal(np.concatenate([columns, lag], axis=1)),
        fit.linear.variance,
        max(rows / steps, 1.0),
        threshold,
        sides,
    )


def hide(stage: Stage, effect: Effect, snr: float, cases: int, rng: np.random.Generator) -> Hidden:
    """Hide an effect of random shape under noise of random kind, `cases` times."""
    signals, shares = [], []
    grid = list(effect.grid(stage.span, stage.problem.response))
    views = stage.problem.views(stage.problem.tau)
    for _ in range(cases):
        shape = list(grid[int(rng.integers(len(grid)))])
        for k, parameter in enumerate(effect.shape):
            if not parameter.steady and effect.name != "jump":
                shape[k] = _jitter(shape[k], parameter, rng)
        columns = stage.problem.term(Term(effect, tuple(shape), 2), views)
        used = columns[:, :1] if effect.nested and rng.random() < 0.5 else columns
        scale = np.linalg.norm(used, axis=0)
        signal = used / np.where(scale > 0, scale, 1.0) @ rng.standard_normal(used.shape[1])
        left = signal - stage.absorbs @ (stage.absorbs.T @ signal)
        share = float(np.linalg.norm(left)) / max(float(np.linalg.norm(signal)), 1e-300)
        shares.append(share)
        if share > VISIBLE:
            signals.append(signal / np.linalg.norm(left))
    survives = float(np.median(shares)) if shares else 0.0
    size = stage.problem.values.size
    if not signals:
        return Hidden(effect, *(np.empty((size, 0)),) * 3, survives)
    noise, level = draw_noise(stage, len(signals), rng)
    stacked = np.stack(signals, axis=1) * (snr * level * np.sqrt(size))
    return Hidden(effect, stacked, stacked - stage.absorbs @ (stage.absorbs.T @ stacked), noise, survives)


def _jitter(value: float, parameter: Parameter, rng: np.random.Generator) -> float:
    moved = (
        value * float(np.exp(0.2 * rng.standard_normal()))
        if parameter.logarithmic
        else value + 0.02 * (parameter.high - parameter.low) * float(rng.uniform(-0.1, 0.1))
    )
    return float(np.clip(moved, parameter.low, parameter.high))


def draw_noise(stage: Stage, cases: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw white and slow noise of the steps of the grid, (M, cases), and its rms per row of the record, (cases,).

    The rms is that of what the baseline does not absorb, as the definition of the SNR wants it.
    """
    noise = np.empty((stage.problem.values.size, cases))
    level = np.empty(cases)
    turn = np.arange(cases) % (len(KERNELS) + 1)
    for number in range(len(KERNELS) + 1):
        mine = np.flatnonzero(turn == number)
        basis = stage.sides[KERNELS[number - 1]].fit.problem.basis
        ratio = (
            np.exp(rng.uniform(np.log(SLOW_NOISE[0]), np.log(SLOW_NOISE[1]), mine.size))
            if number
            else np.zeros(mine.size)
        )
        share = ratio**2 * stage.rows / float(basis.walk.mean())
        variance = stage.white * (1.0 + share * basis.walk[:, None])
        kept = 1.0 - (basis.rotate(stage.absorbs) ** 2).sum(axis=1)
        noise[:, mine] = _rows_of(basis, np.sqrt(variance) * rng.standard_normal(variance.shape))
        # the mean over a step hides most of the white noise of its rows
        level[mine] = np.sqrt(kept @ variance / variance.shape[0] + stage.white * (stage.rows - 1.0))
    if stage.problem.delay_row is not None:
        noise[-1] = 0.0
    return noise, level


def _rows_of(basis: NoiseBasis, rotated: FloatArray) -> FloatArray:
    """Turn independent rows back into the rows of the runs."""
    parts = np.split(rotated, np.cumsum([vectors.shape[0] for vectors in basis.vectors])[:-1])
    return np.concatenate([vectors @ part for vectors, part in zip(basis.vectors, parts, strict=True)])


def rehearse(
    stage: Stage, hidden: Sequence[Hidden], polished: int, rng: np.random.Generator
) -> list[list[tuple[Answer, float]]]:
    """Return the answers to the cases of every hidden effect with their weights, which sum to the number of cases.

    Parameters
    ----------
    stage : Stage
    hidden : sequence of Hidden
    polished : int
        Most cases of each effect whose contenders are fitted; they stand for the others that need it.
    rng : numpy Generator
        Chooses which.
    """
    owner = np.repeat(np.arange(len(hidden)), [h.noise.shape[1] for h in hidden])
    data = np.concatenate([h.left + h.noise for h in hidden], axis=1)
    whole = np.concatenate([h.signals + h.noise for h in hidden], axis=1)
    answers: list[list[tuple[Answer, float]]] = [[] for _ in hidden]
    silent: list[tuple[int, float]] = []
    open_cases: dict[int, list[tuple[int, str, list[Candidate]]]] = {}
    kinds = _kinds(stage, data)
    names = stage.sides[KERNELS[0]].dictionary.effects
    levels = shipped_levels(names)
    offset = np.array([levels[name] for name in names])[:, None]
    sides = list(stage.sides.values())
    bank = Bank(tuple(side.fit.problem for side in sides), tuple(side.dictionary for side in sides))
    for kernel, _, members in _groups(kinds):
        side = stage.sides[kernel]
        gains, where, number, noises = scan_bank(
            bank,
            [side.model for side in sides],
            [side.fit.problem.basis.rotate(data[:, members]) for side in sides],
        )
        nets = gains - offset
        top = nets.max(axis=0)
        rivals = nets >= WITHIN_REACH * top - REACH
        for j, case in enumerate(members):
            if top[j] < WORTH_FITTING * stage.threshold:
                silent.append((int(case), 1.0))
            elif top[j] >= stage.threshold and rivals[:, j].sum() == 1:
                name = names[int(np.argmax(nets[:, j]))]
                exact = (find_effect(name).equivalents or {}).get(stage.problem.response, ())
                answers[owner[case]].append(((name, *exact), 1.0))
            else:
                candidates = [
                    Candidate(
                        Term(find_effect(names[k]), side.dictionary.shapes[where[k, j]], int(number[k, j])),
                        float(gains[k, j]),
                        bank.problems[noises[k, j]].kernel,
                    )
                    for k in np.argsort(-nets[:, j])
                ]
                open_cases.setdefault(int(owner[case]), []).append((int(case), kernel, candidates))
    for index, waiting in open_cases.items():
        chosen = rng.permutation(len(waiting))[:polished]
        for pick in chosen:
            case, kernel, candidates = waiting[pick]
            answer = _fitted(stage, stage.sides[kernel], whole[:, case], candidates, levels)
            weight = len(waiting) / len(chosen)
            if answer:
                answers[index].append((answer, weight))
            else:
                silent.append((case, weight))
    heard = _unexplained(stage, kinds, data, [case for case, _ in silent])
    for case, weight in silent:
        answers[owner[case]].append(((UNEXPLAINED if case in heard else NOTHING,), weight))
    return answers


def _kinds(stage: Stage, data: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """Return, for each case, the kind of slow noise that the baseline alone prefers, and the index of its share."""
    best = np.full(data.shape[1], np.inf)
    kind, share_of = np.zeros(data.shape[1], dtype=int), np.zeros(data.shape[1], dtype=int)
    for number, kernel in enumerate(KERNELS):
        side = stage.sides[kernel]
        basis = side.fit.problem.basis
        rotated = basis.rotate(data)
        scores = []
        for share in SHARES:
            root = np.sqrt(basis.weights(share))[:, None]
            ortho = orthonormal(side.model * root)
            rest = rotated * root
            rest -= ortho @ (ortho.T @ rest)
            scores.append(data.shape[0] * np.log((rest**2).sum(axis=0)) + basis.log_determinant(share))
        stacked = np.stack(scores)
        least = stacked.min(axis=0)
        better = least < best - (PREFERRED if number else 0.0)
        best = np.where(better, least, best)
        kind[better] = number
        share_of[better] = np.argmin(stacked, axis=0)[better]
    return kind, share_of


def _groups(kinds: tuple[np.ndarray, np.ndarray]) -> Iterator[tuple[str, float, np.ndarray]]:
    """Yield (kind of noise, share, cases) of cases that can be scanned together."""
    kind, share = kinds
    for number, kernel in enumerate(KERNELS):
        for pair in range(0, len(SHARES), 2):
            members = np.flatnonzero((kind == number) & (share // 2 == pair // 2))
            if members.size:
                yield kernel, float(SHARES[int(np.median(share[members]))]), members


def _fitted(
    stage: Stage, side: Side, values: FloatArray, candidates: Sequence[Candidate], levels: Mapping[str, float]
) -> Answer:
    """Return what the diagnosis says of one case after fitting the contenders; empty when it names nothing."""
    plain = corrected(fit_terms(replace(side.fit.problem, values=stage.plain + values), ()))
    rivals = polish_contenders(plain, candidates, levels)
    if not rivals or rivals[0].evidence < stage.threshold:
        return ()
    found = Found(0, rivals[0].name, rivals[0].evidence, tuple(rivals))
    return (rivals[0].name, *equivalent_to(found, stage.problem.response))


def _unexplained(
    stage: Stage, kinds: tuple[np.ndarray, np.ndarray], data: FloatArray, silent: Sequence[int]
) -> set[int]:
    """Return the cases in which the generic witness sees structure, out of those in which nothing is named."""
    out: set[int] = set()
    bases = generic_bases(stage.problem)
    for kernel, share, members in _groups(kinds):
        mine = np.array([case for case in members if case in set(silent)], dtype=int)
        if not mine.size:
            continue
        fit = stage.sides[kernel].fit
        fit = replace(fit, linear=replace(fit.linear, share=share))
        seen = leftover_evidence(fit, bases, fit.problem.basis.rotate(data[:, mine]))
        strongest = np.max(np.stack(list(seen.values())), axis=0) - LEVEL
        out |= {int(case) for case in mine[strongest > stage.threshold]}
    return out
