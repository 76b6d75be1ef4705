"""The diagnosis of a campaign, from records to verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.advice import suggest_next
from studies.diagnosis.baseline import Law, Problem, choose_kernel, choose_kernel_score, pose, span_of
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.checks import FEWEST_BINS
from studies.diagnosis.clock import CLOCK_PAIR, clock_drifts, with_clock
from studies.diagnosis.consistency import consistency
from studies.diagnosis.discrepancy import Leftover, generic_bases, leftover_evidence, strongest
from studies.diagnosis.effects import Effect
from studies.diagnosis.fit import fit_terms, intervals
from studies.diagnosis.gain import Score, rms, row_residuals, score
from studies.diagnosis.innovations import find_lines
from studies.diagnosis.null import bootstrap_levels, draw_null, levels_of, shipped_levels
from studies.diagnosis.patchwork import patched
from studies.diagnosis.scan import applicable, build_bank
from studies.diagnosis.selection import BESIDE, Found, Selection, scan_model, scan_models, select
from studies.diagnosis.sharp import sharp_leftover
from studies.diagnosis.thermometer import Thermometer, read_thermometer, smooth_thermometer
from studies.diagnosis.verdict import Cause, ResponseResult, Verdict, equivalent_to, overall, probability_of

THRESHOLD = 26.0
"""Net evidence that a cause needs: on the generator, nulls with 1/f noise reached 25 in 2 of 57 campaigns."""
SPARSE = 60.0
"""Sampling, s, beyond which thresholds of the frequency grow: the housing between two rows is anyone's guess."""
LEFT_OVER, LEFT_OVER_SHARE = 30.0, 0.03
"""Evidence of the generic witness that counts, and its least part of what was explained: no noise model is exact."""
FURTHER = 50.0
"""Evidence at which a further cause beside the strongest deserves two thirds of its claim (measured on the generator)."""
LEAK = 0.002
"""Part of the evidence in the frequency that a cause in another response must have: its thermometer is not exact."""
NARROW_RANGE = 1.0
PREFERENCE = 6.0
"""How much likelier another thermometer than the corrected frequency must be."""


@dataclass(frozen=True)
class Inquiry:
    """One response under inquiry: its selection and what the generic witness saw after it."""

    problem: Problem
    selection: Selection
    leftover: Leftover
    evidence_levels: Mapping[str, float]


@dataclass(frozen=True)
class Diagnosis:
    """A verdict with the fits behind it, for pages and extended models."""

    verdict: Verdict
    campaign: Campaign
    inquiries: Mapping[str, Inquiry]


def investigate(
    campaign: Campaign,
    law: Law | None = None,
    draws: int = 0,
    rng: np.random.Generator | None = None,
    effects: Sequence[Effect] | None = None,
    held_out: bool = True,
) -> Diagnosis:
    """Find what the baseline leaves, name it, and measure what the extension is worth.

    Parameters
    ----------
    campaign : Campaign
    law : callable, optional
        Relative frequency law of the card, of temperature in K.
    draws : int
        Draws of this campaign's own null for thresholds; 0 takes the shipped, conservative ones.
    rng : numpy Generator, optional
        For the draws.
    effects : sequence of Effect, optional
        A smaller library.
    held_out : bool
        Measure the gain, the slowest part.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    inquiries: dict[str, Inquiry] = {}
    thermometer: Thermometer | None = None
    for response in campaign.responses:
        problem = _pose_one(campaign, response, inquiries, thermometer, law)
        if problem is None:
            continue
        if response != "frequency_Hz" and "frequency_Hz" in inquiries:
            problem, thermometer = _best_thermometer(campaign, response, inquiries["frequency_Hz"], problem)
        threshold = THRESHOLD + LEAK * _explained(inquiries)
        if response == "frequency_Hz":
            threshold *= max(1.0, campaign.runs[0].states.step / SPARSE)
        inquiries[response] = inquire(campaign, problem, draws, rng, effects, threshold)
        if response == "frequency_Hz":
            thermometer = read_thermometer(campaign, inquiries[response].selection.fit)
    causes = merge_causes(inquiries, campaign)
    results = {
        response: _result(campaign, inquiries[response], causes, held_out)
        if response in inquiries
        else _too_little("too few values")
        for response in campaign.responses
    }
    for response, reason in campaign.skipped.items():
        results[response] = _too_little(reason)
    verdict = overall([result.verdict for result in results.values()])
    selections = {response: inquiry.selection for response, inquiry in inquiries.items()}
    advice, run = suggest_next(campaign, verdict, causes, results, selections)
    return Diagnosis(Verdict(verdict, causes, results, advice, campaign.notes, next_run=run), campaign, inquiries)


def _too_little(reason: str) -> ResponseResult:
    return ResponseResult("not-identifiable", None, (None, None), None, "none", remark=reason)


def _pose_one(
    campaign: Campaign,
    response: str,
    inquiries: Mapping[str, Inquiry],
    thermometer: Thermometer | None,
    law: Law | None,
) -> Problem | None:
    rows = sum(int(np.isfinite(run.responses[response]).sum()) for run in campaign.runs)
    if rows < FEWEST_BINS + 2 * len(campaign.runs):
        return None
    if thermometer is None:
        return pose(campaign, response, law=law)
    readings = thermometer.change if response == "bias_deg_per_h" else thermometer.excess
    return pose(campaign, response, readings, thermometer.states)


def _best_thermometer(
    campaign: Campaign, response: str, frequency: Inquiry, clean_problem: Problem
) -> tuple[Problem, Thermometer | None]:
    """Take the frequency without or with its non-thermal terms, or its fitted model: whichever the response follows.

    Noise of the frequency that is no temperature would otherwise enter the response through the polynomial.
    """
    fit = frequency.selection.fit
    clean = read_thermometer(campaign, fit)
    if clean is None:
        return clean_problem, clean
    others = [smooth_thermometer(campaign, clean, fit.problem.bend)]
    if any(term.effect.acts_on == "response" for term in fit.terms):
        others.append(read_thermometer(campaign, fit, clean=False) or clean)
    best, least = clean_problem, choose_kernel_score(clean_problem) - PREFERENCE
    for other in others:
        problem = _pose_one(campaign, response, {}, other, None)
        if problem is not None and (tried := choose_kernel_score(problem)) < least:
            best, least = problem, tried
    return best, clean


def inquire(
    campaign: Campaign,
    problem: Problem,
    draws: int,
    rng: np.random.Generator,
    effects: Sequence[Effect] | None,
    threshold: float = THRESHOLD,
) -> Inquiry:
    """Select the effects of one response and ask the generic witness about the rest."""
    problem = choose_kernel(problem)
    span = span_of(campaign, problem.tau if problem.lagged else 1000.0)
    usable = applicable(problem, effects)
    bank = None
    plain = fit_terms(problem, ())
    levels = shipped_levels([effect.name for effect in usable])
    bases = generic_bases(problem)
    generic_levels: dict[str, float] = {}
    if draws:
        bank = build_bank(problem, replace(span, lines=find_lines(plain)), usable)
        levels = bootstrap_levels(problem, bank, scan_models(plain, bank), draws, rng)
        noise = draw_null(problem, scan_model(plain), min(draws, 100), rng)
        generic_levels = {
            name: float(levels_of(values[None, :])[0])
            for name, values in leftover_evidence(plain, bases, noise).items()
        }
    selection = select(problem, span, levels, threshold, effects, bank)
    if problem.response == "frequency_Hz" and any(effect.name == CLOCK_PAIR[0] for effect in usable):
        selection = with_clock(selection, campaign)
    leftover = strongest(leftover_evidence(selection.fit, bases), generic_levels)
    if patched(selection.fit):
        leftover = Leftover(
            "temperature and time, where the named effects cancel or overlap",
            max(selection.found[-1].evidence, leftover.evidence),
        )
    sharp = sharp_leftover(selection.fit)
    if sharp.evidence > max(leftover.evidence, BESIDE * (selection.plain.score - selection.fit.score)):
        leftover = sharp
    return Inquiry(problem, selection, leftover, levels)


def _explained(inquiries: Mapping[str, Inquiry]) -> float:
    frequency = inquiries.get("frequency_Hz")
    return 0.0 if frequency is None else frequency.selection.plain.score - frequency.selection.fit.score


def has_leftover(inquiry: Inquiry) -> bool:
    """Whether structure is left: the generic evidence passes its threshold and is not a trifle beside what was explained."""
    selection = inquiry.selection
    explained = max(selection.plain.score - selection.fit.score, 0.0)
    return inquiry.leftover.evidence > max(selection.threshold, LEFT_OVER, LEFT_OVER_SHARE * explained)


def merge_causes(inquiries: Mapping[str, Inquiry], campaign: Campaign) -> tuple[Cause, ...]:
    """List the causes, one entry a physical cause, under the response where its evidence is largest."""
    causes: list[Cause] = []
    drifts = clock_drifts(campaign)
    for response, inquiry in inquiries.items():
        seen: set[str] = set()
        for found in inquiry.selection.found:
            cause = _cause(inquiry, found, response, drifts if response == "frequency_Hz" else None)
            if cause.effect in seen:
                continue
            seen.add(cause.effect)
            causes.append(cause)
    causes.sort(key=lambda cause: -cause.evidence)
    kept: list[Cause] = []
    for cause in causes:
        if any(_same_cause(cause, other) or _same_set(cause, other) for other in kept):
            continue
        kept.append(cause)
    return tuple(
        cause
        if rank == 0
        else replace(cause, probability=cause.probability * float(1.0 - np.exp(-cause.evidence / FURTHER)))
        for rank, cause in enumerate(kept)
    )


def _cause(inquiry: Inquiry, found: Found, response: str, drifts: bool | None = None) -> Cause:
    winner = found.rivals[0]
    equivalent = equivalent_to(found, response, drifts)
    if drifts is not None and winner.name in CLOCK_PAIR:
        named = next((r for r in found.rivals if r.name == CLOCK_PAIR[0 if drifts else 1]), None)
        winner = winner if named is None else named
    index = found.index if winner.name == found.name else len(winner.fit.terms) - 1
    return Cause(
        winner.name,
        response,
        probability_of(found, equivalent, inquiry.selection.threshold, has_leftover(inquiry)),
        equivalent,
        intervals(winner.fit, index),
        winner.evidence,
        consistency(winner.fit, index),
    )


def _same_set(one: Cause, two: Cause) -> bool:
    """Two members of one inseparable set in one response are two forms of one answer."""
    return one.response == two.response and one.effect in two.equivalent and two.effect in one.equivalent


def _same_cause(one: Cause, two: Cause) -> bool:
    """The same effect in two responses is one cause when its shape agrees."""
    if one.response == two.response or one.effect != two.effect:
        return False
    for name in ("time_s", "temperature_degC", "period_s", "run"):
        if name in one.parameters and name in two.parameters:
            a, b = one.parameters[name], two.parameters[name]
            slack = 300.0 if name == "time_s" else 0.05 * abs(b.value) + 0.5
            if not (a.low - slack <= b.value <= a.high + slack or b.low - slack <= a.value <= b.high + slack):
                return False
    return True


def _result(campaign: Campaign, inquiry: Inquiry, causes: Sequence[Cause], held_out: bool) -> ResponseResult:
    selection = inquiry.selection
    response = inquiry.problem.response
    left = has_leftover(inquiry)
    base = score(selection.plain, campaign) if held_out else Score(rms(row_residuals(selection.plain, campaign)), None)
    extended = None
    if selection.found:
        extended = (
            score(selection.fit, campaign) if held_out else Score(rms(row_residuals(selection.fit, campaign)), None)
        )
    remark = ""
    if left:
        verdict = "unexplained"
    elif selection.found:
        drifts = clock_drifts(campaign) if response == "frequency_Hz" else None
        ambiguous = any(equivalent_to(found, response, drifts) for found in selection.found)
        verdict = "not-identifiable" if ambiguous else "explained"
    else:
        verdict = "adequate"
        temperature = np.concatenate([run.states.housing for run in campaign.runs])
        if np.ptp(temperature) < NARROW_RANGE:
            verdict, remark = "not-identifiable", f"the temperature varies by {np.ptp(temperature):.2g} K only"
    noise = (extended or base).residual_rms
    return ResponseResult(
        verdict,
        noise,
        (base.residual_rms, base.held_out_rms),
        None if extended is None else (extended.residual_rms, extended.held_out_rms),
        "structure" if left else "none",
        inquiry.leftover.input if left else "",
        inquiry.leftover.evidence,
        remark,
    )
