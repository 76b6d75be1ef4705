"""The diagnosis of a campaign, from records to verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis import held_out
from studies.diagnosis.baseline import Baseline, Followed, Lagged, Law, bends_of
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.checks import FEWEST_BINS
from studies.diagnosis.clock import judged
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.held_out import Score
from studies.diagnosis.model import Fit, Problem, fit, pose, settle
from studies.diagnosis.planning.chamber import Chamber
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.scan import applicable, build_bank
from studies.diagnosis.search import Hypothesis, Place, Selection, drop, search
from studies.diagnosis.verdict import Cause, Interval, ResponseResult, Verdict, overall, weigh
from studies.diagnosis.witness import Leftover, look
from studies.effects import Effect
from studies.effects.states import FloatArray, States

NARROW_RANGE = 1.0
"""Kelvin below which a temperature does not vary."""
VOTERS = 4
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Thermometer:
    """The temperature of the resonator as the fitted thermometer response tells it.

    Attributes
    ----------
    change, excess : tuples of (N,) arrays
        Change of frequency over its slope, K, and temperature minus reference, K, run by run on the coarse grid.
    missed : tuple of (N,) arrays
        Slow part of what the model leaves, as if it were temperature, K.
    states : tuple of States
        Runs on the fine grid with that temperature.
    """

    change: tuple[FloatArray, ...]
    excess: tuple[FloatArray, ...]
    missed: tuple[FloatArray, ...]
    states: tuple[States, ...]


@dataclass(frozen=True)
class Inquiry:
    """One response under inquiry."""

    problem: Problem
    selection: Selection
    leftover: Leftover
    votes: Mapping[str, float]

    @property
    def plain(self) -> Fit:
        """The baseline alone."""
        return self.selection.plain.fit

    @property
    def final(self) -> Fit:
        """With the named effects."""
        return self.selection.final.fit


@dataclass(frozen=True)
class Diagnosis:
    """A verdict with the fits behind it, for pages and extended models."""

    verdict: Verdict
    campaign: Campaign
    inquiries: Mapping[str, Inquiry]


def investigate(
    campaign: Campaign,
    law: Law | None = None,
    effects: Sequence[Effect] | None = None,
    score_held_out: bool = True,
    advise: bool = True,
    progress: Progress | None = None,
    chamber: Chamber | None = None,
    baselines: Mapping[str, Callable[[Problem], Baseline]] | None = None,
) -> Diagnosis:
    """Find what the baseline leaves, name it, and measure what the extension is worth.

    Parameters
    ----------
    campaign : Campaign
    law : callable, optional
        Relative frequency law of the card, of temperature in K.
    effects : sequence of Effect, optional
        A smaller library.
    score_held_out : bool
        Measure the gain, and refuse causes that do not pay on rows that the fit has not seen.
    advise : bool
        Look for the next run.
    progress : callable, optional
        Is told in a few words what comes next.
    chamber : Chamber, optional
        What the next run may ask of the chamber.
    baselines : mapping from response to callable, optional
        Other baselines than the generic ones.
    """
    tell = progress or (lambda words: None)
    inquiries: dict[str, Inquiry] = {}
    thermometer: Thermometer | None = None
    for column in (c for c in RESPONSES if c in campaign.responses):
        rows = sum(int(np.isfinite(run.responses[column]).sum()) for run in campaign.runs)
        if rows < FEWEST_BINS + 2 * len(campaign.runs):
            continue
        tell(f"{RESPONSES[column].word}: baseline, then every effect")
        make = (baselines or {}).get(column)
        plain = begin(campaign, column, thermometer, law, make)
        inquiries[column] = inquire(campaign, plain, effects, score_held_out)
        if RESPONSES[column].thermometer:
            thermometer = read_thermometer(campaign, inquiries[column].final)
    inquiries = _vote(campaign, inquiries, effects, score_held_out)
    tell("held-out residuals")
    causes = name_causes(campaign, inquiries)
    results = {
        column: _result(campaign, inquiries[column], causes, score_held_out)
        if column in inquiries
        else _too_little("too few values")
        for column in campaign.responses
    }
    for column, reason in campaign.skipped.items():
        results[column] = _too_little(reason)
    verdict = overall([result.verdict for result in results.values()])
    found = Verdict(verdict, causes, results, None, campaign.notes)
    if advise:
        tell("next run")
        from studies.diagnosis.planning.advice import suggest_next

        text, run = suggest_next(campaign, found, inquiries, chamber)
        found = replace(found, next_experiment=text, next_run=run)
    return Diagnosis(found, campaign, inquiries)


def _too_little(reason: str) -> ResponseResult:
    return ResponseResult("not-identifiable", None, (None, None), None, "none", remark=reason)


def begin(
    campaign: Campaign,
    column: str,
    thermometer: Thermometer | None,
    law: Law | None = None,
    make: Callable[[Problem], Baseline] | None = None,
) -> Fit:
    """Return the fitted baseline of one response."""
    response = RESPONSES[column]
    problem = pose(campaign, column, 1000.0)
    states = tuple(run.states for run in campaign.runs)
    baseline: Baseline
    if make is not None:
        baseline = make(problem)
    elif thermometer is None or response.thermometer:
        baseline = Lagged(
            response,
            states,
            campaign.group,
            1000.0,
            _slope(problem, housing := [s.averaged(campaign.group).excess for s in states]),
            law=law if response.thermometer else None,
            bends=bends_of(problem.values, problem.stack(housing), response.powers),
        )
    else:
        reading = thermometer.change if response.bent else thermometer.excess
        baseline = Followed(
            response,
            thermometer.states,
            campaign.group,
            reading,
            thermometer.missed,
            _slope(problem, reading),
            bends=bends_of(problem.values, problem.stack(list(reading)), response.powers),
        )
    first = settle(problem, baseline)
    tau = float(getattr(first.baseline, "tau", states[0].tau if thermometer is None else thermometer.states[0].tau))
    problem = replace(pose(campaign, column, tau), sigma=float(np.sqrt(first.solved.variance)))
    return fit(problem, first.moved(), (), 2)


def _slope(problem: Problem, reading: Sequence[FloatArray]) -> float:
    x = problem.stack(list(reading))
    varies = float(np.ptp(x)) > 1e-9
    slope = float(np.polyfit(x, problem.values, 1)[0]) if varies else 0.0
    return slope or float(np.std(problem.values)) / 10.0 or 1.0


def inquire(campaign: Campaign, plain: Fit, effects: Sequence[Effect] | None, score_held_out: bool) -> Inquiry:
    """Select the effects of one response, refuse what does not pay, and ask the witnesses about the rest."""
    bank = build_bank(plain, applicable(plain.problem, plain, effects))
    selection = search(plain, bank)
    selection = judged(campaign, selection, effects)
    if score_held_out:
        selection = refuse(campaign, selection)
    return Inquiry(plain.problem, selection, look(plain, selection.final.fit), {})


def refuse(campaign: Campaign, selection: Selection) -> Selection:
    """Drop causes, the weakest first, until the extended model is better on rows that it has not seen."""
    while selection.final.fit.terms:
        model, plain = selection.final.fit, selection.plain.fit
        events = any(term.effect.event for term in model.terms)
        measure = held_out.by_block if events or len(campaign.records) == 1 else held_out.by_record
        before, after = measure(plain, campaign), measure(model, campaign)
        if before is None or after is None or after < before:
            break
        weakest = max(range(len(model.terms)), key=lambda k: drop(selection.final, k).score)
        fewer = drop(selection.final, weakest)
        kept = [place for k, place in enumerate(selection.places) if k != weakest]
        selection = replace(selection, final=fewer, places=tuple(kept))
    return selection


def read_thermometer(campaign: Campaign, model: Fit) -> Thermometer | None:
    """Turn the fitted frequency into a thermometer; None where it hardly follows the temperature."""
    baseline = model.moved()
    places = [k for k, name in enumerate(model.tangent.names) if name == "slope"]
    if not isinstance(baseline, Lagged) or not places:
        return None
    slope, spread = model.solved.coefficients[places[0]], np.sqrt(model.solved.covariance[places[0], places[0]])
    if not np.isfinite(spread) or abs(slope) < 3.0 * spread:
        return None
    slow = model.slow_part()
    changes, excesses, missed, states = [], [], [], []
    for run, view, rest in zip(campaign.runs, baseline.views(), slow, strict=True):
        x = view.seen.excess
        known = np.isfinite(rest)
        filled = np.interp(run.time, run.time[known], rest[known]) if known.any() else np.zeros_like(x)
        excesses.append(x)
        changes.append(x + baseline.bend * x**2)
        missed.append(filled / np.where(np.abs(view.steep) > 0, view.steep, np.inf))
        states.append(view.seen_fine)
    return Thermometer(tuple(changes), tuple(excesses), tuple(missed), tuple(states))


def _vote(
    campaign: Campaign, inquiries: dict[str, Inquiry], effects: Sequence[Effect] | None, score_held_out: bool
) -> dict[str, Inquiry]:
    """Let the other responses say which explanation of the thermometer suits them; ask them anew where it changes.

    A shift of the frequency that is temperature shows in bias and 1/Q as well, one that is none does not.
    """
    column = next((c for c in inquiries if RESPONSES[c].thermometer), None)
    others = [c for c in inquiries if not RESPONSES[c].thermometer]
    if column is None or not others or not inquiries[column].selection.places:
        return inquiries
    inquiry = inquiries[column]
    votes: dict[str, float] = {}
    best = inquiry.selection.places[0]
    for place in inquiry.selection.places:
        for name, rival in list(zip(place.names, place.rivals, strict=True))[:VOTERS]:
            votes[_key(place, name)] = sum(_suits(campaign, rival.fit, inquiries[c]) for c in others)
    out = dict(inquiries)
    out[column] = replace(inquiry, votes=votes)
    place = best
    ranked = sorted(zip(place.names, place.rivals, strict=True), key=lambda pair: -_voted(votes, place, *pair))
    if len(inquiry.selection.places) == 1 and ranked[0][0] != place.names[0] and _key(place, ranked[0][0]) in votes:
        winner = ranked[0][1]
        selection = replace(inquiry.selection, final=winner)
        out[column] = replace(inquiry, selection=selection, leftover=look(inquiry.plain, winner.fit), votes=votes)
        thermometer = read_thermometer(campaign, winner.fit)
        for c in others:
            out[c] = inquire(campaign, begin(campaign, c, thermometer), effects, score_held_out)
    return out


def _key(place: Place, name: str) -> str:
    return f"{place.index} {name}"


def _voted(votes: Mapping[str, float], place: Place, name: str, rival: Hypothesis) -> float:
    least = min(votes.values(), default=0.0)
    return rival.score + votes.get(_key(place, name), least)


def _suits(campaign: Campaign, rival: Fit, other: Inquiry) -> float:
    """Log evidence of another response, its own causes included, when the thermometer is read by a rival."""
    thermometer = read_thermometer(campaign, rival)
    baseline = other.final.baseline
    if thermometer is None or not isinstance(baseline, Followed):
        return other.final.log_evidence
    reading = thermometer.change if other.problem.response.bent else thermometer.excess
    moved = replace(baseline, states=thermometer.states, reading=reading, missed=thermometer.missed)
    return fit(other.problem, moved, other.final.terms, 2, other.final.solved.scales).log_evidence


def name_causes(campaign: Campaign, inquiries: Mapping[str, Inquiry]) -> tuple[Cause, ...]:
    """List the causes, one entry a physical cause, under the response where its evidence is largest."""
    causes = [_cause(campaign, inquiry, place) for inquiry in inquiries.values() for place in inquiry.selection.places]
    causes.sort(key=lambda cause: -cause.evidence)
    kept: list[Cause] = []
    for cause in causes:
        if not any(_same(cause, other) for other in kept):
            kept.append(cause)
    return tuple(kept)


def _cause(campaign: Campaign, inquiry: Inquiry, place: Place) -> Cause:
    column = inquiry.problem.response.column
    scores = [_voted(inquiry.votes, place, n, r) for n, r in zip(place.names, place.rivals, strict=True)]
    base = min(inquiry.votes.values(), default=0.0)
    own = max(r.score for r in place.rivals)
    nothing = place.without.score + (max(scores) - own if inquiry.votes else 0.0) if base else place.without.score
    members, probability = weigh(place.names, scores, nothing)
    winner = place.rivals[int(np.argmax(scores))]
    effect = winner.fit.terms[place.index].effect
    exact = effect.equivalents.get(column, ())
    settled = bool(effect.judge or any(_judge_of(n) for n in exact)) and campaign.clock_known
    names = list(dict.fromkeys([effect.name, *members, *(() if settled else exact)]))
    if settled:
        names = [n for n in names if n == effect.name or n not in exact]
    return Cause(
        effect.name,
        column,
        probability,
        tuple(sorted(names[1:])),
        parameters_of(winner.fit, place.index),
        2.0 * max(max(scores) - nothing, 0.0),
        peak=peak_of(winner.fit, place.index),
    )


def _judge_of(name: str) -> str:
    from studies.effects import find_effect

    return find_effect(name).judge


def parameters_of(model: Fit, index: int) -> dict[str, Interval]:
    """Return shape and coefficients of a term with 90 % intervals; of lists the definite member."""
    term = model.terms[index]
    places = model.columns_of(index)
    out: dict[str, Interval] = {}
    spreads = shape_spread(model, index)
    for parameter, value, sd in zip(term.effect.shape, term.shape, spreads, strict=True):
        half = 1.645 * sd
        if parameter.logarithmic and half > 0:
            out[parameter.name] = Interval(value, value * float(np.exp(-half)), value * float(np.exp(half)))
        else:
            out[parameter.name] = Interval(value, value - half, value + half)
    begin = 0
    columns = np.flatnonzero(term.effect.spread > 0)
    values = model.solved.coefficients[places]
    deviations = np.sqrt(np.maximum(np.diag(model.solved.covariance)[places], 0.0))
    for name, coefficient in zip(
        term.effect.coefficient_names(model.problem.response.column), term.effect.coefficients, strict=True
    ):
        at = np.flatnonzero(columns == begin)
        if at.size:
            value, half = float(values[at[0]]), 1.645 * float(deviations[at[0]])
            out[name] = Interval(value, value - half, value + half)
        begin += len(coefficient.spread)
    return out


def shape_spread(model: Fit, index: int) -> list[float]:
    """Return the standard deviation of every shape parameter (of its logarithm where it has one), from the curvature."""
    from studies.diagnosis.model import Term

    term = model.terms[index]
    out = []
    for k, parameter in enumerate(term.effect.shape):
        if parameter.steady:
            out.append(0.0)
            continue
        step = 0.03 if parameter.logarithmic else max(0.01 * abs(term.shape[k]), 0.05)
        sides = []
        for sign in (-1.0, 1.0):
            value = term.shape[k] * float(np.exp(sign * step)) if parameter.logarithmic else term.shape[k] + sign * step
            shape = (*term.shape[:k], value, *term.shape[k + 1 :])
            terms = (*model.terms[:index], Term(term.effect, shape), *model.terms[index + 1 :])
            own = fit(model.problem, model.baseline, terms, 1, model.solved.scales, [model.solved.kind])
            sides.append(own.log_evidence)
        bend = (2.0 * model.log_evidence - sides[0] - sides[1]) / step**2
        out.append(float(1.0 / np.sqrt(bend)) if bend > 0 else step * 10.0)
    return out


def peak_of(model: Fit, index: int) -> float:
    """Return the largest less the smallest change of the response that a term makes in the record."""
    places = model.columns_of(index)
    change = model.linear.columns[:, places] @ model.solved.coefficients[places]
    return float(np.ptp(change)) if change.size else 0.0


def _same(one: Cause, two: Cause) -> bool:
    """The same effect in two responses is one cause when its place agrees; two members of one set are one answer."""
    if one.response == two.response:
        return one.effect in two.equivalent and two.effect in one.equivalent
    if one.effect not in two.names and two.effect not in one.names:
        return False
    for name in ("time_s", "temperature_degC", "period_s", "run"):
        if name in one.parameters and name in two.parameters:
            a, b = one.parameters[name], two.parameters[name]
            slack = 300.0 if name == "time_s" else 0.05 * abs(b.value) + 0.5
            if not (a.low - slack <= b.value <= a.high + slack or b.low - slack <= a.value <= b.high + slack):
                return False
    return True


def _result(campaign: Campaign, inquiry: Inquiry, causes: Sequence[Cause], score_held_out: bool) -> ResponseResult:
    plain, final, left = inquiry.plain, inquiry.final, inquiry.leftover

    def measured(model: Fit) -> Score:
        if score_held_out:
            return held_out.score(model, campaign)
        return Score(held_out.rms(held_out.residuals(model, campaign)), None)

    base = measured(plain)
    extended = measured(final) if final.terms else None
    column = inquiry.problem.response.column
    mine = [cause for cause in causes if cause.response == column and cause.kind == "physics"]
    remark = ""
    share: float | None = None
    if final.terms:
        share = left.share if left.significant else 1.0
    if left.significant and (share is None or share < CONSTANTS["share_explained"]):
        verdict = "unexplained"
    elif final.terms:
        verdict = "not-identifiable" if any(cause.equivalent for cause in mine) else "explained"
    else:
        verdict = "adequate"
        temperature = np.concatenate([run.states.housing for run in campaign.runs])
        if np.ptp(temperature) < NARROW_RANGE:
            verdict, remark = "not-identifiable", f"the temperature varies by {np.ptp(temperature):.2g} K only"
    reached = extended or base
    white = float(np.sqrt(final.solved.variance * inquiry.problem.noise.rows))
    wander = white * final.wander_ratio
    return ResponseResult(
        verdict,
        reached.residual_rms,
        (base.residual_rms, base.held_out_rms),
        None if extended is None else (extended.residual_rms, extended.held_out_rms),
        "structure" if left.significant else "none",
        left.input if left.significant else "",
        2.0 * max(left.evidence, 0.0),
        share,
        remark,
        white=white,
        wander=wander,
        run_shifts=tuple(_run_shifts(final)),
    )


def _run_shifts(model: Fit) -> list[float]:
    """Return the offset of every run about their mean, or the mean residual where runs have none."""
    values = model.values()
    own = [value for name, value in values.items() if name.startswith("offset@")]
    if own:
        return [float(v - np.mean(own)) for v in own]
    return [
        float(np.nanmean(part)) if np.isfinite(part).any() else 0.0 for part in model.problem.unstack(model.residual)
    ]
