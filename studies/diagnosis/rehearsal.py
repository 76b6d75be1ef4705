"""Rehearse a diagnosis: hide every effect in a campaign that has none, and see what would be said.

The hidden effect and the noise are drawn row by row on the grid of the campaign. All cases of a response are scanned at
once beside every kind of slow noise, as the diagnosis does; its fits are left out, for at the SNR at which a plan is
decided they move the evidence by less than the noise does. Where nothing is named, the generic witness is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.baseline import Problem, Term, restricted, span_of
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.discrepancy import LEVEL, generic_bases, leftover_evidence
from studies.diagnosis.effects import Effect, Parameter, Span
from studies.diagnosis.fit import Fit, fit_terms
from studies.diagnosis.investigate import LEFT_OVER
from studies.diagnosis.likelihood import KERNELS, SHARES, NoiseBasis, orthonormal
from studies.diagnosis.null import shipped_levels
from studies.diagnosis.scan import Bank, applicable, build_bank, scan_bank
from studies.diagnosis.selection import NOISE_PRICE, scan_model
from studies.diagnosis.states import FloatArray
from studies.diagnosis.verdict import set_beside

NOTHING, UNEXPLAINED = "nothing", "unexplained"
SLOW_NOISE = (0.1, 1.0)
"""Range of the slow noise's rms over that of the white noise of one row."""
NOISES = ("white", "slow")
"""Cases have white noise alone, and besides it slow noise of every kind, by turns."""
VISIBLE = 3e-3
"""Part of a signature's rms that must survive the baseline for an effect to be hidden at an SNR at all."""
AT_ONCE = 2000
"""About so many cases are scanned together."""
SPARSE_GRID = 40
"""A grid of one parameter with fewer shapes is doubled: the diagnosis would fit the shape between them."""

Answer = tuple[str, ...]
"""The members of the set that is named, the strongest first; or `nothing`, or `unexplained`."""


@dataclass(frozen=True)
class Stage:
    """One response of a campaign without effects.

    Attributes
    ----------
    problem : Problem
    span : Span
    effects : tuple of Effect
        Those that can act on the response here.
    absorbs : (M, p) array
        Orthonormal columns of what the baseline can absorb, its lag included.
    white : float
        Variance of the white noise of a step of the grid.
    rows : float
        Rows of the record in a step.
    threshold : float
        Evidence that a cause needs.
    fits : tuple of Fit
        The baseline alone beside every kind of slow noise.
    models : tuple of (M, p) arrays
        Its rotated columns.
    bank : Bank
        Signatures of the effects.
    """

    problem: Problem
    span: Span
    effects: tuple[Effect, ...]
    absorbs: FloatArray
    white: float
    rows: float
    threshold: float
    fits: tuple[Fit, ...]
    models: tuple[FloatArray, ...]
    bank: Bank

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in the order of their evidence."""
        return self.bank.dictionaries[0].effects

    def sign(self, effect: Effect) -> float:
        """Sign that the first coefficient of an effect must have; 0 where both will do."""
        dictionary = self.bank.dictionaries[0]
        return float(dictionary.signs[dictionary.owner == self.names.index(effect.name)][0])


@dataclass(frozen=True)
class Hidden:
    """Cases that hide one effect: what the baseline leaves of it at SNR 1, and the noise, (M, B) each."""

    effect: Effect
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
    fits = tuple(fit_terms(restricted(problem, kernel=kernel), (), rounds=0) for kernel in KERNELS)
    columns = fit.columns()
    lag = problem.lag_column(problem.tau, (), fit.linear.coefficients)
    steps = sum(int(mask.sum()) for mask in problem.present)
    rows = sum(int(np.isfinite(run.row_responses[problem.response]).sum()) for run in campaign.runs)
    return Stage(
        problem,
        span,
        effects,
        orthonormal(np.concatenate([columns, lag], axis=1)),
        fit.linear.variance,
        max(rows / steps, 1.0),
        threshold,
        fits,
        tuple(scan_model(own) for own in fits),
        build_bank(problem, span, [doubled(effect) for effect in effects]),
    )


def doubled(effect: Effect) -> Effect:
    """Return an effect of one shape parameter with a grid of twice as many shapes."""

    def grid(span: Span, response: str) -> Sequence[tuple[float, ...]]:
        shapes = np.array([shape for (shape,) in effect.grid(span, response)])
        if not 1 < shapes.size < SPARSE_GRID:
            return [(float(shape),) for shape in shapes]
        ordered = np.sort(shapes)
        low, high = ordered[:-1], ordered[1:]
        between = np.sqrt(low * high) if effect.shape[0].logarithmic else 0.5 * (low + high)
        return [(float(shape),) for shape in (*shapes, *between)]

    return replace(effect, grid=grid) if len(effect.shape) == 1 and not effect.shape[0].steady else effect


def hide(stage: Stage, effect: Effect, cases: int, rng: np.random.Generator) -> Hidden:
    """Hide an effect of random shape and SNR 1 under noise of random kind, `cases` times."""
    signals, shares = [], []
    grid = list(effect.grid(stage.span, stage.problem.response))
    views = stage.problem.views(stage.problem.tau)
    sign = stage.sign(effect)
    for _ in range(cases):
        shape = list(grid[int(rng.integers(len(grid)))])
        for k, parameter in enumerate(effect.shape):
            if not parameter.steady and effect.name != "jump":
                shape[k] = _jitter(shape[k], parameter, rng)
        columns = stage.problem.term(Term(effect, tuple(shape), 2), views)
        used = columns[:, :1] if effect.nested and rng.random() < 0.5 else columns
        scale = np.linalg.norm(used, axis=0)
        sizes = rng.standard_normal((used.shape[1],))
        if sign:
            sizes[0] = sign * abs(sizes[0])
        signal = used / np.where(scale > 0, scale, 1.0) @ sizes
        left = signal - stage.absorbs @ (stage.absorbs.T @ signal)
        share = float(np.linalg.norm(left)) / max(float(np.linalg.norm(signal)), 1e-300)
        shares.append(share)
        if share > VISIBLE:
            signals.append(left / np.linalg.norm(left))
    survives = float(np.median(shares)) if shares else 0.0
    rows = stage.problem.values.size
    if not signals:
        return Hidden(effect, *(np.empty((rows, 0)),) * 2, survives)
    noise, level = draw_noise(stage, len(signals), rng)
    return Hidden(effect, np.stack(signals, axis=1) * (level * np.sqrt(rows)), noise, survives)


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
    turn = np.where(np.arange(cases) % 2, 1 + np.arange(cases) // 2 % len(KERNELS), 0)
    for number in range(len(KERNELS) + 1):
        mine = np.flatnonzero(turn == number)
        basis = stage.bank.problems[number - 1].basis
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


def rehearse(stage: Stage, hidden: Sequence[Hidden], snrs: Sequence[float]) -> list[list[list[Answer]]]:
    """Return, for every SNR and hidden effect, the answers to its cases: white and slow noise by turns."""
    pairs = [(snr, h) for snr in snrs for h in hidden]
    owner = np.repeat(np.arange(len(pairs)), [h.noise.shape[1] for _, h in pairs])
    data = np.concatenate([snr * h.left + h.noise for snr, h in pairs], axis=1)
    parts = [_evidence(stage, part) for part in np.array_split(data, max(1, round(owner.size / AT_ONCE)), axis=1)]
    evidence, noises, shares = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    heard = _unexplained(stage, data, noises, shares, np.flatnonzero(evidence.max(axis=0) < stage.threshold))
    answers: list[list[Answer]] = [[] for _ in pairs]
    for case, values in enumerate(evidence.T):
        own = dict(zip(stage.names, values, strict=True))
        name = max(own, key=own.__getitem__)
        if own[name] >= stage.threshold:
            answers[owner[case]].append((name, *set_beside(name, own, stage.problem.response)))
        else:
            answers[owner[case]].append((UNEXPLAINED if case in heard else NOTHING,))
    return [answers[k : k + len(hidden)] for k in range(0, len(pairs), len(hidden))]


def _evidence(stage: Stage, data: FloatArray) -> tuple[FloatArray, np.ndarray, np.ndarray]:
    """Return the net evidence of every effect, (E, B), and the baseline's likeliest kind of noise and its share, (B,).

    What noise of another kind than the baseline's costs is taken off.
    """
    unit = data / np.sqrt(stage.white)
    rotated = [problem.basis.rotate(unit) for problem in stage.bank.problems]
    gains, _, _, noises = scan_bank(stage.bank, stage.models, [target.astype(np.float32) for target in rotated])
    scores = _plain_scores(stage, rotated)
    least = scores.min(axis=1).argmin(axis=0)
    levels = shipped_levels(stage.names)
    net = gains - np.array([levels[name] for name in stage.names])[:, None]
    return net - np.where(noises == least, 0.0, NOISE_PRICE), least, scores.min(axis=0).argmin(axis=0)


def _plain_scores(stage: Stage, rotated: Sequence[FloatArray]) -> FloatArray:
    """Return minus twice the log-likelihood of the baseline for every kind of slow noise, share and case, (K, S, B)."""
    scores = np.empty((len(KERNELS), len(SHARES), rotated[0].shape[1]))
    for number, (problem, model, target) in enumerate(zip(stage.bank.problems, stage.models, rotated, strict=True)):
        for k, share in enumerate(SHARES):
            root = np.sqrt(problem.basis.weights(share))[:, None]
            ortho = orthonormal(model * root)
            rest = target * root
            rest -= ortho @ (ortho.T @ rest)
            determinant = problem.basis.log_determinant(share)
            scores[number, k] = target.shape[0] * np.log((rest**2).sum(axis=0)) + determinant
    return scores


def _unexplained(
    stage: Stage, data: FloatArray, noises: np.ndarray, shares: np.ndarray, silent: np.ndarray
) -> set[int]:
    """Return the cases in which the generic witness sees structure, out of those in which nothing is named."""
    out: set[int] = set()
    bases = generic_bases(stage.problem)
    for number, plain in enumerate(stage.fits):
        for k in range(0, len(SHARES), 2):
            mine = silent[(noises[silent] == number) & (shares[silent] // 2 == k // 2)]
            if mine.size:
                fit = replace(plain, linear=replace(plain.linear, share=float(SHARES[k])))
                seen = leftover_evidence(fit, bases, fit.problem.basis.rotate(data[:, mine]))
                strongest = np.max(np.stack(list(seen.values())), axis=0) - LEVEL
                out |= {int(case) for case in mine[strongest > max(stage.threshold, LEFT_OVER)]}
    return out
