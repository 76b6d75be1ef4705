"""The diagnosis of a campaign, from records to verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis import held_out
from studies.diagnosis.baseline import Baseline, Law
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.causes import name_causes, vote
from studies.diagnosis.checks import FEWEST_BINS
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.held_out import Score
from studies.diagnosis.inquiry import Inquiry, Thermometer, begin, inquire, read_thermometer
from studies.diagnosis.model import Fit, Problem
from studies.diagnosis.planning.advice import suggest_next
from studies.diagnosis.planning.chamber import Chamber
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import Cause, ResponseResult, Verdict, overall
from studies.effects import Effect

NARROW_RANGE = 1.0
"""Kelvin below which a temperature does not vary."""
Progress = Callable[[str], None]


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
    inquiries = vote(campaign, inquiries, effects, score_held_out)
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
        text, run = suggest_next(campaign, found, inquiries, chamber)
        found = replace(found, next_experiment=text, next_run=run)
    return Diagnosis(found, campaign, inquiries)


def _too_little(reason: str) -> ResponseResult:
    return ResponseResult("not-identifiable", None, (None, None), None, "none", remark=reason)


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
