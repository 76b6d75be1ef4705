"""One response under inquiry: its baseline, the effects that it has, what is left, and what it knows of the temperature."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from compensation.noise import white_rms
from studies.diagnosis import held_out
from studies.diagnosis.baseline import Baseline, Followed, Lagged, Reading, bends_of
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.clock import judged
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.held_out import Score, is_worse, score_both
from studies.diagnosis.lack_of_fit import Leftover, left_over, look
from studies.diagnosis.model import Fit, fit, settle
from studies.diagnosis.problem import Problem, pose
from studies.diagnosis.response import RESPONSES, Response
from studies.diagnosis.scan import applicable, build_bank
from studies.diagnosis.search import Hypothesis, Place, Selection, drop, needed, search
from studies.effects import Effect
from studies.effects.states import FloatArray, States
from studies.inference.sharp import tails_of

MOST_TRIED = 3
"""Rivals that are asked when the winner of a place foretells nothing."""


@dataclass(frozen=True)
class Thermometer:
    """The temperature of the resonator as the fitted thermometer response tells it.

    Attributes
    ----------
    change, excess : tuples of pairs of arrays
        Change of frequency over its slope, K, and temperature minus reference, K, run by run on the coarse grid, (N,), and on
        the fine one.
    missed : tuple of (N, m) arrays
        What may be temperature or not, as if it were, K: the slow part of what the model leaves, what is not known of the
        law's bend beside the named effects, then every named effect on the frequency itself and what the forms of thermal ones may
        miss.
    states : tuple of States
        Runs on the fine grid with that temperature.
    """

    change: tuple[tuple[FloatArray, FloatArray], ...]
    excess: tuple[tuple[FloatArray, FloatArray], ...]
    missed: tuple[FloatArray, ...]
    states: tuple[States, ...]

    def reads(self, response: Response) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
        """Return what a response follows, K, run by run on the coarse grid and on the fine one."""
        coarse, whole = zip(*(self.change if response.bent else self.excess), strict=True)
        return coarse, whole

    def instead(self, response: Response) -> tuple[FloatArray, ...]:
        """Return what it may follow instead on the coarse grid: a law may be one of the temperature or of the frequency."""
        return tuple(coarse for coarse, _ in (self.excess if response.bent else self.change))


@dataclass(frozen=True)
class Inquiry:
    """One response under inquiry."""

    problem: Problem
    selection: Selection
    leftover: Leftover
    votes: Mapping[str, float]
    scores: tuple[Score, Score] | None = None
    """What the baseline and the model with causes leave, where it has any and that was measured."""
    unknown: float = -np.inf
    """Log posterior of generic structure without any named effect, on the scale of the selection's scores: less what such
    structure would add to the named effects."""

    @property
    def plain(self) -> Fit:
        """The baseline alone."""
        return self.selection.plain.fit

    @property
    def final(self) -> Fit:
        """With the named effects."""
        return self.selection.final.fit


def begin(
    campaign: Campaign,
    column: str,
    thermometer: Thermometer | None,
) -> Fit:
    """Return the fitted baseline of one response."""
    response = RESPONSES[column]
    problem = pose(campaign, column, 1000.0)
    states = tuple(run.states for run in campaign.runs)
    baseline: Baseline
    if thermometer is None or response.thermometer:
        baseline = Lagged(
            response,
            states,
            campaign.group,
            1000.0,
            _slope(problem, housing := [s.averaged(campaign.group).excess for s in states]),
            bends=bends_of(problem.values, problem.stack(housing), response.powers),
        )
    else:
        reading, whole = thermometer.reads(response)
        baseline = Followed(
            response,
            thermometer.states,
            campaign.group,
            reading,
            whole,
            thermometer.instead(response),
            thermometer.missed,
            _slope(problem, reading),
            bends=bends_of(problem.values, problem.stack(list(reading)), response.powers),
        )
    first = settle(problem, baseline)
    tau = float(getattr(first.baseline, "tau", states[0].tau if thermometer is None else thermometer.states[0].tau))
    problem = replace(pose(campaign, column, tau), sigma=float(np.sqrt(first.solved.variance)))
    row, tails = row_noise(campaign, column), tails_of(_jitter(campaign, column))
    if first.baseline.lagged:
        steep = float(np.median(np.abs(np.concatenate([view.steep for view in first.tangent.views]))))
        row = float(np.hypot(row, campaign.temperature_noise * steep))
    floor = max((row / problem.sigma) ** 2 - problem.noise.rows, 0.0)
    problem = replace(problem, noise=replace(problem.noise, floor=floor, tails=tails))
    return fit(problem, first.moved(), (), 2)


def row_noise(campaign: Campaign, column: str) -> float:
    """Return the white noise of one row of the record, from second differences."""
    return white_rms(*(run.row_responses[column] for run in campaign.runs))


def _jitter(campaign: Campaign, column: str) -> FloatArray:
    """Return the second differences of the rows of a response."""
    second = np.concatenate([np.diff(run.row_responses[column], 2) for run in campaign.runs])
    return np.asarray(second[np.isfinite(second)])


def _slope(problem: Problem, reading: Sequence[FloatArray]) -> float:
    x = problem.stack(list(reading))
    varies = float(np.ptp(x)) > 1e-9
    slope = float(np.polyfit(x, problem.values, 1)[0]) if varies else 0.0
    return slope or float(np.std(problem.values)) / 10.0 or 1.0


def inquire(campaign: Campaign, plain: Fit, effects: Sequence[Effect] | None, score_held_out: bool) -> Inquiry:
    """Select the effects of one response, refuse what does not pay, and test what is left for lack of fit."""
    bank = build_bank(plain, applicable(plain.problem, plain, effects))
    selection = search(plain, bank)
    selection = judged(campaign, selection, effects)
    scores = None
    if score_held_out:
        selection, scores = refuse(campaign, selection)
    leftover = left_over(campaign, plain, selection.final.fit)
    if not selection.final.fit.terms:
        return Inquiry(plain.problem, selection, leftover, {})
    generic = look(selection.plain.fit, selection.plain.fit)
    unknown = selection.plain.score + generic.smooth + CONSTANTS["log_prior_unknown"]
    beside = max(leftover.smooth + CONSTANTS["log_prior_unknown"], 0.0)
    inexact = CONSTANTS["misfit"] * max(selection.final.score - selection.plain.score, 0.0)
    if unknown > selection.final.score + inexact and not leftover.significant:
        # what is named patches up what a generic form says better alone, by more than its own may be inexact
        leftover = replace(generic, share=0.0)
    return Inquiry(plain.problem, selection, leftover, {}, scores, unknown - beside)


def refuse(campaign: Campaign, selection: Selection) -> tuple[Selection, tuple[Score, Score] | None]:
    """Drop causes, the weakest first, until each pays for itself, here and on rows that the model has not seen.

    Besides, what all of them leave must not be more than what the baseline does; returned with both scores.
    """
    while selection.final.fit.terms:
        fewer = [drop(selection.final, k) for k in range(len(selection.final.fit.terms))]
        weakest = sorted(range(len(fewer)), key=lambda k: -fewer[k].score)
        unpaid = next((k for k in weakest if not _is_paid(campaign, selection, k, fewer[k])), None)
        if unpaid is None:
            scores = score_both(selection.plain.fit, selection.final.fit, campaign)
            if not is_worse(*scores):
                return selection, scores
        k = weakest[0] if unpaid is None else unpaid
        other = None if unpaid is None else _another(selection, k, fewer[k], campaign)
        kept = tuple(place for n, place in enumerate(selection.places) if n != k)
        final = fewer[k] if other is None else other.rivals[0]
        selection = replace(selection, final=final, places=kept if other is None else (*kept, other))
    return selection, None


def _is_paid(campaign: Campaign, selection: Selection, k: int, without: Hypothesis) -> bool:
    by_run = None if selection.final.fit.alone(k) or len(campaign.records) == 1 else held_out.by_record
    pays = without.score < selection.final.score - CONSTANTS["margin"]
    return pays and _pays(without.fit, selection.final.fit, campaign, by_run)


def _another(selection: Selection, k: int, without: Hypothesis, campaign: Campaign) -> Place | None:
    """Return a place whose first rival foretells what its refused winner could not; None where there is none."""
    place = selection.places[k]
    refused = selection.final.names[k]
    rivals = [rival for name, rival in zip(place.names, place.rivals, strict=True) if name != refused]
    if len(place.without.names) > len(without.names):  # other causes were refused since the rivals were fitted
        rivals = [_beside(without, rival, place.index) for rival in rivals[:MOST_TRIED]]
        place = replace(place, index=len(without.names), without=without)
    for n, rival in enumerate(rivals[:MOST_TRIED]):
        if rival.score < without.score + needed(selection.plain, without):
            break
        by_run = None if rival.fit.alone(place.index) or len(campaign.records) == 1 else held_out.by_record
        if _pays(without.fit, rival.fit, campaign, by_run):
            return replace(place, rivals=(rival, *rivals[n + 1 :]))
    return None


def _beside(base: Hypothesis, rival: Hypothesis, index: int) -> Hypothesis:
    """Return a model with one term of a rival more."""
    terms = (*base.fit.terms, replace(rival.fit.terms[index], about=()))
    scales = np.append(base.fit.solved.scales, rival.fit.solved.scales[index])
    return Hypothesis(fit(base.fit.problem, base.fit.moved(), terms, 2, scales), (*base.price, rival.price[index]))


def _follows(model: Fit) -> bool:
    """Whether the response follows the temperature beyond doubt."""
    names = model.tangent.names
    if "slope" not in names:
        return True
    spread = model.deviation_of("slope")
    return bool(np.isfinite(spread) and abs(model.values()["slope"]) >= 3.0 * spread)


def _pays(
    plain: Fit, model: Fit, campaign: Campaign, by_run: Callable[[Fit, Campaign], held_out.Parts | None] | None
) -> bool:
    """Whether a model is better on rows that it has not seen.

    A run whose drive no other run moves cannot be foretold by them, nor can an event: then blocks in time decide. What neither
    foretells is for the evidence: nothing speaks against it. Where the runs disagree it must not be worse as it is scored.
    """
    last: held_out.Compared | None = None
    for measure in (by_run, held_out.by_block):
        found = None if measure is None else held_out.compare(measure(plain, campaign), measure(model, campaign))
        if found is not None and found.sure:
            return found.pays
        last = found or last
    if by_run is not None and last is not None:
        level = held_out.level_of(model)
        last = held_out.compare(*(held_out.by_record(own, campaign, level) for own in (plain, model)))
    return last is None or last.after <= last.before * (1.0 + held_out.ALIKE)


def _bend(model: Fit) -> float:
    """Standard deviation of the law's second power, Hz/K²: a named static curve may have taken some of it, or left some there."""
    names = model.tangent.names
    if "quadratic" not in names or not model.terms:
        return 0.0
    return model.deviation_of("quadratic") / 1e2


def read_thermometer(campaign: Campaign, model: Fit) -> Thermometer | None:
    """Turn the fitted frequency into a thermometer; None where it hardly follows the temperature."""
    if not model.baseline.lagged or not _follows(model):
        return None
    baseline = cast("Reading", model.moved())
    slow, beside, bend = model.slow_part(), model.beside_temperature(), _bend(model)
    inexact = model.inexact_temperature()
    changes, excesses, missed, states = [], [], [], []
    for k, (run, view, rest) in enumerate(zip(campaign.runs, baseline.views(), slow, strict=True)):
        x, whole = view.seen.excess, view.seen_fine.excess
        known = np.isfinite(rest)
        filled = np.interp(run.time, run.time[known], rest[known]) if known.any() else np.zeros_like(x)
        excesses.append((x, whole))
        changes.append((baseline.change(x), baseline.change(whole)))
        parts = np.column_stack([filled, bend * x**2, *(own[k] for own in beside), inexact[k]])
        parts = parts / np.where(np.abs(view.steep) > 0, view.steep, np.inf)[:, None]
        missed.append(parts)
        states.append(view.seen_fine)
    return Thermometer(tuple(changes), tuple(excesses), tuple(missed), tuple(states))
