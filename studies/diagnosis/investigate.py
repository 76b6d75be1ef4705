"""The diagnosis of a campaign, from records to verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np
import scipy

from compensation.noise import white_rms
from shell.constants import zero_Celsius
from studies.diagnosis import held_out
from studies.diagnosis.baseline import Reading, first_stretches
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.causes import name_causes, vote
from studies.diagnosis.checks import FEWEST_BINS
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.held_out import Score, score_both
from studies.diagnosis.inquiry import Inquiry, Thermometer, again, begin, inquire, read_thermometer
from studies.diagnosis.lack_of_fit import doubt_of
from studies.diagnosis.model import Fit
from studies.diagnosis.planning.advice import suggest_next
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.seen import SeenResponse
from studies.diagnosis.simulated import FAR, Simulated, shifts_of, simulate_baseline
from studies.diagnosis.stated import as_shipped, with_loss_carried, without_rate_terms
from studies.diagnosis.verdict import Cause, Interval, ResponseResult, Shift, Verdict, doubted, overall
from studies.effects import Effect
from studies.planning.chamber import Chamber
from studies.plausible import check_card_frequency
from studies.shown import Shown

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

    from studies.instrument.card import Instrument


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
    card: "Instrument | None" = None,
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
    card : Instrument, optional
        Its own simulation is then the baseline of the frequency.
    """
    tell, measured = progress or (lambda words: None), campaign
    if card is not None:
        for seen in campaign.runs:
            if "frequency_Hz" in seen.responses:
                check_card_frequency(card, seen.responses["frequency_Hz"], seen.label)
        campaign = measured = replace(campaign, turn_on=card.noise.bias_turn_on_deg_per_h)
    inquiries: dict[str, Inquiry] = {}
    thermometer: Thermometer | None = None
    for column in (c for c in ASKED if c in campaign.responses):
        rows = sum(int(np.isfinite(run.responses[column]).sum()) for run in campaign.runs)
        if rows < FEWEST_BINS + 2 * len(campaign.runs):
            continue
        tell(f"{RESPONSES[column].word}: baseline, then all effects")
        simulated = card is not None and RESPONSES[column].thermometer
        make = partial(simulate_baseline, campaign, card) if simulated and card is not None else None
        if column == "bias_deg_per_h":
            clock = next(
                (i.final.baseline for i in inquiries.values() if isinstance(i.final.baseline, Simulated)), None
            )
            campaign = campaign if clock is None else without_rate_terms(campaign, clock)
            if clock is not None and "inverse_q" in inquiries:
                campaign = with_loss_carried(campaign, clock, inquiries["inverse_q"].final)
        plain = begin(campaign, column, thermometer, make)
        cleaned = campaign.without_spikes(column, held_out.residuals(plain, campaign))
        if cleaned is not campaign:
            campaign, plain = cleaned, begin(cleaned, column, thermometer, make and again(plain))
        found_here = inquire(campaign, plain, effects, score_held_out)
        if found_here.final.terms and RESPONSES[column].own_offset and campaign.turn_on:
            campaign, found_here = _doubt_turn_on(campaign, column, thermometer, found_here, effects, score_held_out)
        inquiries[column] = found_here
        if RESPONSES[column].thermometer:
            thermometer = read_thermometer(campaign, inquiries[column].final)
    inquiries = {column: inquiries[column] for column in RESPONSES if column in inquiries}
    inquiries = vote(campaign, inquiries, effects, score_held_out)
    tell("held-out residuals")
    shifts = tuple(shift for inquiry in inquiries.values() for shift in shifts_of(inquiry.final))
    causes = (*wrong_values(shifts), *name_causes(campaign, inquiries))
    causes = tuple(sorted(causes, key=lambda cause: -cause.evidence))
    shipped = _shipped(measured, inquiries)
    results = {
        column: _result(campaign, inquiries[column], causes, score_held_out, shipped.get(column))
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
    found = Verdict(verdict, named, results, None, campaign.said, calibration=shifts)
    if advise:
        tell("next run")
        text, run = suggest_next(campaign, found, inquiries, chamber)
        found = replace(found, next_experiment=text, next_run=run)
    return Diagnosis(found, campaign, inquiries)


def _doubt_turn_on(
    campaign: Campaign,
    column: str,
    thermometer: Thermometer | None,
    inquiry: Inquiry,
    effects: Sequence[Effect] | None,
    score_held_out: bool,
) -> tuple[Campaign, Inquiry]:
    """Ask whether one turn-on beyond what the card states is all that was named of a response.

    What changes a bias from run to run, ageing or a jump, does not come back. A run whose level leaves both neighbours far beyond
    the stated deviation has had another turn-on, if with levels of their own the runs need no cause.
    """
    if len(campaign.records) < len(campaign.runs):
        return campaign, inquiry
    free = replace(campaign, turn_on=0.0)
    plain = begin(free, column, thermometer)
    order = np.argsort([run.states.campaign_time[0] for run in campaign.runs])
    steps = np.diff(np.array(_run_shifts(plain))[order])
    furthest = np.maximum(np.minimum(steps[:-1], -steps[1:]), np.minimum(-steps[:-1], steps[1:]))
    if furthest.max(initial=0.0) < CONSTANTS["turned_back"] * campaign.turn_on:
        return campaign, inquiry
    without = inquire(free, plain, effects, score_held_out)
    if without.final.terms:
        return campaign, inquiry
    path = campaign.runs[order[int(np.argmax(furthest)) + 1]].label
    note = (
        f"{path}: its bias lies {furthest.max():.2g} °/h from the runs before and after it, but the card states"
        f" {campaign.turn_on:.2g} °/h from turn-on to turn-on; each run was therefore given its own offset."
    )
    return replace(free, notes=(*free.notes, note)), without


def _too_brief(campaign: Campaign, inquiries: Mapping[str, Inquiry]) -> str:
    """Return why nothing can be confirmed by records in which the resonator hardly follows the housing; else nothing."""
    lags = [one.final.baseline for column, one in inquiries.items() if RESPONSES[column].thermometer]
    if not lags:
        return ""
    reading = cast("Reading", lags[0])
    span = sum(float(np.ptp(run.time)) for run in campaign.runs)
    if reading.from_card:
        change = float(np.ptp(np.concatenate([view.seen.resonator for view in reading.views()])))
        return (
            f"too short to judge: the resonator's temperature changes by {change:.2g} K only"
            if change < NARROW_RANGE
            else ""
        )
    if span >= FEWEST_LAGS * reading.tau:
        return ""
    return (
        f"too short to judge: {span:.0f} s, and the resonator may follow the housing with {reading.tau:.0f} s or more"
    )


def _too_little(reason: str) -> ResponseResult:
    return ResponseResult("not-identifiable", None, (None, None), None, "none", remark=reason)


def _shipped(campaign: Campaign, inquiries: Mapping[str, Inquiry]) -> dict[str, float]:
    for inquiry in inquiries.values():
        if isinstance(inquiry.plain.baseline, Simulated):
            own = inquiry.plain.baseline
            return as_shipped(campaign, replace(own, z=(0.0,) * len(own.z), initial=tuple({} for _ in own.initial)))
    return {}


def wrong_values(shifts: Sequence[Shift]) -> list[Cause]:
    """Return the card's values that the data move by more than two of their standard deviations."""
    return [
        Cause(
            shift.parameter,
            "frequency_Hz",
            float(scipy.special.erf(abs(shift.shift_sd) / np.sqrt(2.0))),
            (),
            {shift.parameter: Interval(shift.value, min(shift.low, shift.high), max(shift.low, shift.high))},
            shift.shift_sd**2,
            kind="value",
        )
        for shift in shifts
        if abs(shift.shift_sd) > FAR
    ]


def _result(
    campaign: Campaign, inquiry: Inquiry, causes: Sequence[Cause], score_held_out: bool, shipped: float | None
) -> ResponseResult:
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
            f"no held-out residual: {'no row' if reached.foretold < 0.005 else 'only ' + share_known} can be predicted from {rest}"
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
        shipped=shipped,
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
