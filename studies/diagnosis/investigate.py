"""The diagnosis of a campaign, from records to verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np

from compensation.noise import white_rms
from shell.constants import zero_Celsius
from studies.diagnosis import held_out
from studies.diagnosis.baseline import Reading, first_stretches
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.causes import name_causes, vote
from studies.diagnosis.checks import FEWEST_BINS
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.held_out import Score, score_both
from studies.diagnosis.inquiry import Inquiry, Thermometer, begin, inquire, read_thermometer
from studies.diagnosis.lack_of_fit import doubt_of
from studies.diagnosis.model import Fit
from studies.diagnosis.planning.advice import suggest_next
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.seen import SeenResponse
from studies.diagnosis.verdict import Cause, ResponseResult, Verdict, doubted, overall
from studies.effects import Effect
from studies.planning.chamber import Chamber
from studies.results.shown import Shown

ASKED = ("frequency_Hz", "inverse_q", "bias_deg_per_h")
"""The bias last: it follows the temperature, and 1/Q through the anisotropy of damping."""
FORETOLD = 0.95
"""Part of the rows below which it is said that held-out residuals are not about all."""
SURE_DELAY, LEAST_DELAY = 3.0, 0.5
"""Standard deviations, and part of what is expected of it beforehand, from which on a delay is said."""
WORSE = 3.0
"""Held-out over training residual from which on the other runs are said not to determine a run."""
FEWEST_LAGS = 3.0
"""Time constants that the records must cover before they confirm a baseline whose lag is free."""
NARROW_RANGE = 1.0
"""Kelvin below which a temperature does not vary."""
Progress = Callable[[str], None]

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """A verdict with the fits behind it, for pages and extended models."""

    drawn_by = "studies.reports.diagnosis_pictures:ladder"
    with_card: ClassVar[bool] = False

    verdict: Verdict
    campaign: Campaign
    inquiries: Mapping[str, Inquiry]

    def __repr__(self) -> str:
        return f"Diagnosis({self.verdict})"

    def to_frame(self) -> "DataFrame":
        """Return one row a response."""
        return self.verdict.to_frame()

    @property
    def labels(self) -> list[str]:
        """Names of the records."""
        return list(dict.fromkeys(run.label for run in self.campaign.runs))

    @property
    def shown_responses(self) -> list[str]:
        """Responses that were fitted."""
        return [name for name in self.verdict.responses if name in self.inquiries]

    def seen(self, response: str) -> SeenResponse:
        """Return what pages show of a response."""
        campaign, inquiry = self.campaign, self.inquiries[response]
        problem, views, left = inquiry.plain.problem, inquiry.plain.tangent.views, inquiry.leftover
        inputs = {
            "resonator temperature (°C)": problem.stack([v.seen.resonator - zero_Celsius for v in views]),
            "rate (K/min)": 60.0 * problem.stack([v.seen.rate for v in views]),
        }
        if "frequency_Hz" in campaign.responses:
            inputs["frequency (Hz)"] = problem.stack([run.responses["frequency_Hz"] for run in campaign.runs])
        for label, drive in (("amplitude (V)", "amplitude_squared"), ("electrode voltage (V)", "voltage_squared")):
            if all(getattr(v.coarse, drive) is not None for v in views):
                inputs[label] = np.sqrt(problem.stack([getattr(v.coarse, drive) for v in views]))
        steep = np.concatenate([np.abs(view.steep) for view in inquiry.final.tangent.views])
        return SeenResponse(
            time=tuple(run.row_time for run in campaign.runs),
            plain=tuple(held_out.residuals(inquiry.plain, campaign)),
            final=tuple(held_out.residuals(inquiry.final, campaign)),
            named=bool(inquiry.final.terms),
            step=campaign.step,
            rest=inquiry.plain.residual,
            run=np.concatenate([np.full(int(mask.sum()), k) for k, mask in enumerate(problem.present)]),
            inputs=inputs,
            slope=float(np.median(steep)) if steep.size else 0.0,
            alternatives=tuple(
                tuple((name, 2.0 * (rival.score - place.without.score)) for name, rival in zip(place.names, place.rivals, strict=True))
                for place in inquiry.selection.places
            ),
            left=(left.input, 2.0 * left.evidence) if left.significant else None,
        )  # fmt: skip


def investigate(
    campaign: Campaign,
    effects: Sequence[Effect] | None = None,
    score_held_out: bool = True,
    advise: bool = True,
    progress: Progress | None = None,
    chamber: Chamber | None = None,
) -> Diagnosis:
    """Find what the baseline leaves, name it, and measure what the extension is worth.

    Parameters
    ----------
    campaign : Campaign
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
    """
    tell = progress or (lambda words: None)
    inquiries: dict[str, Inquiry] = {}
    thermometer: Thermometer | None = None
    for column in (c for c in ASKED if c in campaign.responses):
        rows = sum(int(np.isfinite(run.responses[column]).sum()) for run in campaign.runs)
        if rows < FEWEST_BINS + 2 * len(campaign.runs):
            continue
        tell(f"{RESPONSES[column].word}: baseline, then all effects")
        plain = begin(campaign, column, thermometer)
        cleaned = campaign.without_spikes(column, held_out.residuals(plain, campaign))
        if cleaned is not campaign:
            campaign, plain = cleaned, begin(cleaned, column, thermometer)
        inquiries[column] = inquire(campaign, plain, effects, score_held_out)
        if RESPONSES[column].thermometer:
            thermometer = read_thermometer(campaign, inquiries[column].final)
    inquiries = {column: inquiries[column] for column in RESPONSES if column in inquiries}
    inquiries = vote(campaign, inquiries, effects, score_held_out)
    tell("held-out residuals")
    causes = tuple(sorted(name_causes(campaign, inquiries), key=lambda cause: -cause.evidence))
    results = {
        column: _result(campaign, inquiries[column], causes, score_held_out)
        if column in inquiries
        else _too_little("too few values")
        for column in campaign.responses
    }
    if brief := _too_brief(campaign, inquiries):
        results = {
            column: replace(one, verdict="not-identifiable", remark=brief) if one.verdict == "adequate" else one
            for column, one in results.items()
        }
    for column, reason in campaign.skipped.items():
        results[column] = _too_little(reason)
    verdict = overall([result.verdict for result in results.values()])
    named = tuple(cause for cause in doubted(causes) if cause.probability >= CONSTANTS["member"])
    found = Verdict(verdict, named, results, None, campaign.said)
    if advise:
        tell("next run")
        text, run = suggest_next(campaign, found, inquiries, chamber)
        found = replace(found, next_experiment=text, next_run=run)
    return Diagnosis(found, campaign, inquiries)


def _too_brief(campaign: Campaign, inquiries: Mapping[str, Inquiry]) -> str:
    """Return why nothing can be confirmed by records in which the resonator hardly follows the housing; else nothing."""
    lags = [one.final.baseline for column, one in inquiries.items() if RESPONSES[column].thermometer]
    if not lags:
        return ""
    reading = cast("Reading", lags[0])
    span = sum(float(np.ptp(run.time)) for run in campaign.runs)
    if span >= FEWEST_LAGS * reading.tau:
        return ""
    return (
        f"too short to judge: {span:.0f} s, and the resonator may follow the housing with {reading.tau:.0f} s or more"
    )


def _too_little(reason: str) -> ResponseResult:
    return ResponseResult("not-identifiable", None, (None, None), None, "none", remark=reason)


def _result(campaign: Campaign, inquiry: Inquiry, causes: Sequence[Cause], score_held_out: bool) -> ResponseResult:
    plain, final, left = inquiry.plain, inquiry.final, inquiry.leftover

    extended = None
    if inquiry.scores is not None:
        base, extended = inquiry.scores
    elif not score_held_out:
        base = Score(held_out.rms(held_out.residuals(plain, campaign)), None)
        extended = Score(held_out.rms(held_out.residuals(final, campaign)), None) if final.terms else None
    elif final.terms:
        base, extended = score_both(plain, final, campaign)
    else:
        base = held_out.score(plain, campaign)
    column = inquiry.problem.response.column
    mine = [cause for cause in causes if cause.response == column and cause.kind == "physics"]
    share = (left.share if left.significant else 1.0) if final.terms else None
    named = bool(mine) or any(cause.kind == "value" and cause.response == column for cause in causes)
    verdict, remarks = _judge(campaign, inquiry, mine, share, named)
    remarks += _delayed(inquiry)
    reached = extended or base
    beyond = reached.held_out_rms
    if verdict == "adequate" and beyond is not None and beyond > WORSE * reached.residual_rms:
        response = inquiry.problem.response
        remarks.append(
            f"values fitted to the other runs predict this run only to {beyond * response.scale:.3g} "
            f"{response.shown}; without it they are not determined"
        )
    if reached.foretold < FORETOLD:
        rest = "the other runs" if len(campaign.records) > 1 else "the rest of the record"
        share_known = f"{100 * reached.foretold:.0f} % of the rows"
        remarks.append(
            f"no held-out residual, since {'no row' if reached.foretold < 0.005 else 'only ' + share_known} can be predicted from {rest}"
            if reached.held_out_rms is None
            else f"held-out residuals cover {share_known}; the others cannot be predicted from {rest}"
        )
    noise = min(value for value in (reached.residual_rms, reached.held_out_rms) if value is not None)
    white = white_rms(*held_out.residuals(final, campaign))
    white = white or float(np.sqrt(final.solved.variance * inquiry.problem.noise.rows))
    if verdict != "unexplained" and noise > CONSTANTS["wander_usual"] * white:
        remarks.append(
            f"the residual is {noise / white:.2g} times its white noise; its slow part within a run is treated as coloured noise"
        )
    return ResponseResult(
        verdict,
        noise,
        (base.residual_rms, base.held_out_rms),
        None if extended is None else (extended.residual_rms, extended.held_out_rms),
        "structure" if left.significant else "none",
        left.input if left.doubtful else "",
        2.0 * max(left.evidence, 0.0),
        share,
        "; ".join(remarks),
        white=white,
        wander=final.wander,
        run_shifts=tuple(_run_shifts(final)),
    )


def _judge(
    campaign: Campaign, inquiry: Inquiry, mine: Sequence[Cause], share: float | None, named: bool
) -> tuple[str, list[str]]:
    """Return the verdict of one response, and what must be said with it."""
    left, final = inquiry.leftover, inquiry.final
    clean = share is None or share >= CONSTANTS["share_explained"]
    # a name that a generic form beats by more than forms are inexact patches the structure up, it does not explain it
    patched = bool(mine) and max(cause.probability for cause in mine) < CONSTANTS["believed"]
    if left.wander and clean:
        return "not-identifiable", [
            f"the residual drifts by {final.wander_ratio:.0f} times the noise of a row within minutes: this record cannot "
            "distinguish slow noise from a cause that acts slowly"
        ]
    if left.significant and (share is None or not clean or patched):
        return "unexplained", []
    apart = _apart(campaign, inquiry)
    if final.terms:
        return "not-identifiable" if any(cause.equivalent for cause in mine) else "explained", apart
    if named:
        return "explained", []
    temperature = np.concatenate([run.states.housing for run in campaign.runs])
    if np.ptp(temperature) < NARROW_RANGE:
        return "not-identifiable", [f"the temperature varies by {np.ptp(temperature):.2g} K only"]
    if left.doubtful:
        return "not-identifiable", [doubt_of(left.input, left.evidence)]
    return ("not-identifiable", apart) if apart else ("adequate", _turned_on(inquiry))


def _apart(campaign: Campaign, inquiry: Inquiry) -> list[str]:
    """Return the sentence on runs that lie farther apart than what is left within them; none where they do not."""
    response, final = inquiry.problem.response, inquiry.final
    apart, usual = _spread_of_runs(final)
    if response.own_offset or apart <= usual:
        return []
    white = float(np.sqrt(final.solved.variance))
    text = (
        f"the runs lie {apart * response.scale:.3g} {response.shown} (rms) apart, {apart / max(final.wander, white):.0f} "
        "times the residual within them: ageing, clock error, handling, or drift between runs"
    )
    return [text if campaign.timed else text + "; start times ('# start' in the records) would show which of these"]


def _delayed(inquiry: Inquiry) -> list[str]:
    """Return the sentence on a delay that the baseline has taken: it tolerates what sensors and clocks may have."""
    final = inquiry.final
    if "delay" not in final.tangent.names:
        return []
    delay = float(getattr(final.baseline, "delay", None) or final.values()["delay"])
    prior = float(final.tangent.prior[final.tangent.names.index("delay")])
    if abs(delay) < max(SURE_DELAY * final.deviation_of("delay"), LEAST_DELAY * prior):
        return []
    return [
        f"it follows the temperature {abs(delay):.2g} s {'later' if delay > 0.0 else 'earlier'} than one lag predicts, as "
        "sensors and clocks may; a thermometer lag or a rate effect of this size looks the same"
    ]


def _turned_on(inquiry: Inquiry) -> list[str]:
    """Return the sentence on a response whose runs have offsets of their own, far beyond what is left within them."""
    response, final = inquiry.problem.response, inquiry.final
    apart, usual = _spread_of_runs(final)
    if not response.own_offset or apart <= usual:
        return []
    return [
        f"the runs lie {apart * response.scale:.3g} {response.shown} (rms) apart, which is treated as a turn-on offset; "
        "ageing or a jump between runs would look the same. A saved model states it as turn-on; "
        "a card with bias_turn_on_deg_per_h distinguishes them"
    ]


def _spread_of_runs(final: Fit) -> tuple[float, float]:
    """Return how far the runs lie apart (rms), and how far they may before it is said."""
    apart = float(np.sqrt(np.mean(np.square(_run_shifts(final)))))
    return apart, CONSTANTS["wander_usual"] * float(np.hypot(final.wander, np.sqrt(final.solved.variance)))


def _run_shifts(model: Fit) -> list[float]:
    """Return the offset of every record about their mean, or the mean residual where they have none."""
    values = model.values()
    own = [value for name, value in values.items() if name.startswith("offset@")]
    if own:
        return [float(v - np.mean(own)) for v in own]
    firsts = np.array(first_stretches([view.fine for view in model.tangent.views]))
    rows, first = model.residual, firsts[model.problem.run]
    return [float(rows[first == k].mean()) if np.any(first == k) else 0.0 for k in dict.fromkeys(firsts.tolist())]
