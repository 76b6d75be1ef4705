"""Selection of terms of HRG paper eq. (21) for a bias model, and its error on held-out data.

Two ways of selecting stand side by side; the coefficients of the chosen terms are those of least squares in both:

`paper`    F-tests that take the rows for independent, entry 0.05 and removal 0.10;
`guarded`  the errors may remember (white noise plus random walk), the entry level is shared among the candidates that
           compete, so that noise alone brings a term in about one time in twenty; given several runs, the model on
           the path that best predicts a run from the others is kept, if any does better than a constant.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.bias import PARENTS, TERMS, BiasDesign, BiasFit, BiasRun, fit_terms
from compensation.errors import CompensationError, require_runs
from compensation.improvement import FEWEST
from compensation.noise_regression import estimate_theta, whiten
from compensation.samples import block_means
from compensation.stepwise import StepwiseSelection, select_stepwise

Method = Literal["paper", "guarded"]
# Bias stability is the standard deviation of averages over this many seconds; the paper does not state its own.
AVERAGING = 100.0
BLOCKS = 5
# The noise is taken at one standard deviation towards the random walk, which keeps the rate of false terms near 5 %.
CAUTION = 1.0


class NoHeldOut(CompensationError):
    """Nothing can be held out: the rest carries no fit, or has not seen its frequencies and rates."""


@dataclass(frozen=True)
class HeldOutRows:
    """Standard deviations of 100 s averages of held-out runs (else blocks), pooled, about each one's own mean; `coverage` of the range."""

    before: float
    after: float
    coverage: float
    by_runs: bool
    terms: tuple[tuple[str, ...], ...]

    @property
    def gain(self) -> float:
        """How many times smaller the held-out bias is with compensation."""
        return self.before / self.after


Fold = tuple[BiasRun, list[BiasRun]]
"""A run, or part of one, that is held out, and the rest."""


def fit_bias(runs: Sequence[BiasRun], method: Method = "guarded", reference: float | None = None) -> BiasFit:
    """Select and fit the bias model, HRG paper eqs. (21), (22), about a reference; every run has its own constant, B₀ is their mean."""
    require_runs(runs, BiasRun, "prepare_run makes one")
    return _select(runs, method, reference, by_runs=len(runs) > 1)


def score_held_out(runs: Sequence[BiasRun], method: Method = "guarded") -> HeldOutRows:
    """Predict every run from a model selected and fitted without it; with one run, every fifth of it.

    Blocks have a gap of one thermal constant, std(f) / rms(ḟ); only the held-out constant is refitted, and rows out of range are left.
    """
    by_runs = len(runs) > 1
    folds, fits = [], []
    for held_out, rest in _folds(runs, by_runs):
        try:
            fits.append(_select(rest, method, None, by_runs=by_runs and len(runs) > 2))
            folds.append((held_out, rest))
        except CompensationError:  # what is left without this part carries no fit
            continue
    return _pool(folds, fits, by_runs=by_runs)


def _select(pieces: Sequence[BiasRun], method: Method, reference: float | None, *, by_runs: bool) -> BiasFit:
    reference = float(pieces[0].state[0]) if reference is None else reference
    design = BiasDesign(pieces, reference)
    names = design.names
    if method == "paper":
        selection = select_stepwise(design.constants, design.candidates, design.bias, names, PARENTS)
        return fit_terms(design, selection.terms, selection=selection)
    selection = select_guarded(design, cautious_theta(design))
    if not by_runs or not selection.steps:
        return fit_terms(design, selection.terms, selection=selection)
    try:
        scores = score_path(pieces, selection)
    except CompensationError:  # no run can be predicted from the others: the tests alone decide
        return fit_terms(design, selection.terms, selection=selection)
    best = (selection.start, *selection.steps)[int(np.argmin(scores))].terms
    return fit_terms(design, tuple(sorted(best, key=names.index)), selection=selection, scores=scores)


def cautious_theta(design: BiasDesign) -> float:
    """Return θ of the noise beside all terms, `CAUTION` standard deviations towards the random walk."""
    return estimate_theta(design.columns(design.names), design.bias, design.rows, CAUTION)


def follow_columns(X: Array, y: Array) -> Array:
    """Return what columns make of y, also where one is a combination of others."""
    unit = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    return np.asarray(unit @ np.linalg.lstsq(unit, y, rcond=1e-10)[0])


def select_guarded(design: BiasDesign, theta: float) -> StepwiseSelection:
    """Select terms by F-tests in noise of `theta`, the level shared among candidates."""
    constants, candidates, bias = (
        whiten(part, theta, design.rows) for part in (design.constants, design.candidates, design.bias)
    )
    return select_stepwise(constants, candidates, bias, design.names, PARENTS, shared=True)


def _folds(pieces: Sequence[BiasRun], by_runs: bool) -> list[Fold]:
    if by_runs:
        return [(run, [other for other in pieces if other is not run]) for run in pieces]
    length = max(1, sum(piece.time.size for piece in pieces) // BLOCKS)
    gap = thermal_constant(pieces)
    folds = []
    for piece in pieces:
        cuts = np.linspace(0, piece.time.size, max(1, round(piece.time.size / length)) + 1).astype(int)
        for begin, end in pairwise(cuts.tolist()):
            before = int(np.searchsorted(piece.time, piece.time[begin] - gap))
            after = int(np.searchsorted(piece.time, piece.time[end - 1] + gap, side="right"))
            around = [piece.part(slice(0, before)), piece.part(slice(after, None))]
            rest = [part for part in around if part.time.size > 2 * len(TERMS)]
            rest += [other for other in pieces if other is not piece]
            if rest and sum(part.time.size for part in rest) > 4 * len(TERMS):
                folds.append((piece.part(slice(begin, end)), rest))
    if not folds:
        raise NoHeldOut("the run is too short to hold a part of it out; record longer, or give several runs.")
    return folds


def thermal_constant(pieces: Sequence[BiasRun]) -> float:
    """Return std(f) / rms(ḟ), the time in which frequency or temperature changes by its own spread (s)."""
    state = np.concatenate([piece.state for piece in pieces])
    rate = np.concatenate([piece.rate for piece in pieces])
    return float(np.std(state) / np.sqrt(np.mean(rate**2)))


def score_path(runs: Sequence[BiasRun], selection: StepwiseSelection) -> tuple[float, ...]:
    """Return the held-out sd of each model on a selection's path, its terms kept, over that of the constant alone."""
    by_runs = len(runs) > 1
    folds = _folds(runs, by_runs)
    designs = [BiasDesign(rest, float(runs[0].state[0])) for _, rest in folds]
    scores = []
    for step in (selection.start, *selection.steps):
        fits = [fit_terms(design, step.terms, theta=1.0) for design in designs]  # θ matters to no prediction
        scores.append(1.0 / _pool(folds, fits, by_runs=by_runs).gain)
    return tuple(scores)


def score_runs(fit: BiasFit, runs: Sequence[BiasRun]) -> HeldOutRows:
    """Apply a fitted model to held-out runs, less each run's own mean, also to rows out of its range."""
    return _pool([(run, []) for run in runs], [fit] * len(runs), by_runs=True, everywhere=True)


def bias_stability(run: BiasRun, bias: Array | None = None) -> float:
    """Return the standard deviation of 100 s averages of the run's bias, or of another column of its rows."""
    return float(np.std(_averages(run.bias if bias is None else bias, run), ddof=1))


def _pool(folds: Sequence[Fold], fits: Sequence[BiasFit], *, by_runs: bool, everywhere: bool = False) -> HeldOutRows:
    raw: list[Array] = []
    compensated: list[Array] = []
    for (run, _), fit in zip(folds, fits, strict=True):
        inside = within(run.state, fit.state_range) & within(run.rate, fit.rate_range) | everywhere
        left = fit.left(run)
        averages = [_averages(values[inside], run) for values in (run.bias, left)]
        if averages[0].size >= FEWEST:
            raw.append(averages[0] - averages[0].mean())
            compensated.append(averages[1] - averages[1].mean())
    if not raw:
        raise NoHeldOut(
            f"no held-out part lies inside the range of {folds[0][0].variable.name} and its rate in the rest; record two"
            " runs of each kind, such as two coolings and two warmings over the same temperatures, or cycles."
        )
    before, after = np.concatenate(raw), np.concatenate(compensated)
    possible = sum(_averages(run.bias, run).size for run, _ in folds)
    return HeldOutRows(
        before=float(np.sqrt(np.mean(before**2))),
        after=float(np.sqrt(np.mean(after**2))),
        coverage=before.size / possible,
        by_runs=by_runs,
        terms=tuple(fit.terms for fit in fits),
    )


def within(values: Array, limits: tuple[float, float]) -> NDArray[np.bool_]:
    """Tell which values lie inside the limits."""
    return np.asarray((values >= limits[0]) & (values <= limits[1]))


def _averages(values: Array, run: BiasRun) -> Array:
    """Average consecutive rows over AVERAGING seconds."""
    return block_means(values, max(1, round(AVERAGING / run.width)))
