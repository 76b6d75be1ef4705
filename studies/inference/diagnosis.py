"""Diagnosis of a campaign against a card: calibrate, search for effects beside all values and responses at once, judge.

Where effects are found, the card's values are linearised anew at the most probable point of all, and the search begins
again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise import white_rms
from shell.constants import zero_Celsius
from studies.calibration.apart import fit_explained
from studies.calibration.fit import CardFit, at_point
from studies.calibration.observed import HOUSING, RESPONSES, observe
from studies.calibration.priors import gather_priors
from studies.calibration.problem import CardProblem, wide_law
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.response import SeenResponse
from studies.inference.causes import with_levels
from studies.inference.confirmed import confirm, is_worse
from studies.inference.heat_path import (
    FOLLOWED,
    FREQUENCY,
    LAGS,
    WORTH,
    HeatPath,
    effects_would_bring,
    find_heat_path,
    is_ahead,
    is_strained,
    lags_would_bring,
    leaves_thermometer_noise,
    slow_share,
    with_second_mass,
)
from studies.inference.housing import evidence_of, set_housing_apart
from studies.inference.hypothesis import Hypothesis, Outcome
from studies.inference.inferred import Inferred
from studies.inference.lack_of_fit import generic_bank, look
from studies.inference.linear import Linear
from studies.inference.predicted import Kept, Model
from studies.inference.pursuit import Pursuit
from studies.inference.records import Campaign
from studies.inference.search import FURTHER, MARGIN, SUSPICIOUS, Search
from studies.inference.sharp import RESOLVED, fast_line, longest_resolved
from studies.inference.signatures import Signatures
from studies.inference.verdict import judge
from studies.record import Record
from studies.results.shown import Shown

if TYPE_CHECKING:
    from pandas import DataFrame

    from shell.law import FrequencyLaw
    from studies.diagnosis.verdict import Verdict
    from studies.instrument.card import Instrument
    from studies.planning.next_run import Advice

Report = Callable[[str], None]
BLOCKS, BLOCKS_OF_RUN = 800, (100, 400)
"""Block averages of a campaign, and fewest and most of a run."""
FAR = 2.0
"""The same, beyond which the search begins from the card's own values too."""
BEATEN = 100.0
"""Log evidence behind another search, from which on one is given up."""


@dataclass(frozen=True, repr=False)
class Inference(Inferred, Shown):
    """What a card and records say together, with its verdict; `advice`: words about the run that should come next, and the run."""

    drawn_by = "studies.reports.diagnosis_pictures:ladder"
    advice: "Advice | None" = None

    def __repr__(self) -> str:
        return f"Diagnosis({self.verdict})"

    def to_frame(self) -> "DataFrame":
        """Return one row a response."""
        return self.verdict.to_frame()

    @property
    def with_card(self) -> bool:
        """Whether the card is a user's, and not made from the records."""
        return self.card.polynomial is None

    @cached_property
    def verdict(self) -> "Verdict":
        """The outcome of the contract."""
        judged = judge(self)
        if self.advice is None:
            return judged
        return replace(judged, next_experiment=self.advice[0], next_run=self.advice[1])

    @property
    def labels(self) -> list[str]:
        """Names of the records."""
        return [run.record.path or f"run {k}" for k, run in enumerate(self.search.linear.problem.runs, 1)]

    @property
    def shown_responses(self) -> list[str]:
        """Responses that were fitted."""
        return list(self.search.linear.responses)

    def seen(self, response: str) -> SeenResponse:
        """Return what pages show of a response."""
        problem, left = self.search.linear.problem, self.left[response]
        members = [k for k, part in enumerate(problem.parts) if response in part.responses]
        blocks = [problem.runs[problem.parts[k].run].responses[response] for k in members]
        paths = [self.search.signatures.paths[k] for k in members]

        def onto(values: Sequence[Array]) -> Array:
            at = zip(blocks, paths, values, strict=True)
            return np.concatenate([np.interp(b.time - p.time[0], p.states.time, own) for b, p, own in at])

        inputs = {
            "resonator temperature (°C)": onto([p.states.resonator - zero_Celsius for p in paths]),
            "rate (K/min)": onto([60.0 * p.states.rate for p in paths]),
        }  # fmt: skip
        if "frequency_Hz" in problem.responses:
            inputs["frequency (Hz)"] = onto(
                [np.interp(p.states.time, p.time, p.prediction.columns["frequency_Hz"]) for p in paths]
            )
        for label, drive in (("amplitude (V)", "amplitude_squared"), ("electrode voltage (V)", "voltage_squared")):
            own = [getattr(p.states, drive) for p in paths]
            if all(values is not None for values in own):
                inputs[label] = np.sqrt(onto(own))
        plain, final = self.plain[response], self.rows[response]
        rest = [
            np.interp(b.time - b.time[0], t - t[0], own)
            for b, t, own in zip(blocks, plain.time, plain.residual, strict=True)
        ]
        slope = np.concatenate([np.abs(p.by_temperature["frequency_Hz"]) for p in paths])
        return SeenResponse(
            time=plain.time,
            plain=plain.residual,
            final=final.residual,
            named=any(response in term.columns for term in self.final.terms) or self.path is not None,
            step=float(np.median(np.concatenate([b.span for b in blocks]))),
            rest=np.concatenate(rest),
            run=np.concatenate([np.full(len(b.time), k) for k, b in enumerate(blocks)]),
            inputs=inputs,
            slope=float(np.median(slope)) if response == "frequency_Hz" else 0.0,
            alternatives=tuple(
                tuple((h.terms[-1].effect.name, 2.0 * (h.score - base.score)) for h in rivals)
                for term, rivals, base in zip(self.final.terms, self.outcome.rivals, self.outcome.without, strict=True)
                if term.response == response
            ),
            left=(left.input, 2.0 * left.evidence) if left.significant else None,
        )  # fmt: skip


def build_problem(
    card: "Instrument", records: Sequence[Record], housing: bool = True, law: "FrequencyLaw | None" = None
) -> CardProblem:
    """Return the problem of a card's values and the starts of runs, driven by the measured temperature; a card explains its `housing` too, and its `law` may be known."""
    named = (*RESPONSES, HOUSING) if housing and card.polynomial is None else RESPONSES
    runs = tuple(run.explaining(named) for run in observe(records, blocks=blocks_of(records)))
    return CardProblem(card, gather_priors(card), runs, wide_law(card, runs, whole=law))


def blocks_of(records: Sequence[Record]) -> int:
    """Return how many block averages a run has: more where a line is faster than the usual ones and finer ones resolve it."""
    count = int(np.clip(BLOCKS / len(records), *BLOCKS_OF_RUN))
    longest = max(float(np.ptp(record["time_s"])) for record in records)
    sampling = max(float(np.median(np.diff(record["time_s"]))) for record in records)
    for name in RESPONSES:
        series = [(record["time_s"] - record["time_s"][0], record[name]) for record in records if name in record]
        line = fast_line(series, sampling, longest / count, white_rms(*(own for _, own in series))) if series else None
        if line is not None and longest <= longest_resolved(line.period):
            count = max(count, int(np.ceil(RESOLVED * longest / line.period)))
    return count


def infer(
    card: "Instrument", campaign: Campaign, progress: Report = lambda _: None, law: "FrequencyLaw | None" = None
) -> Inference:
    """Find what records say of a card, whose `law` may be known, and of effects that it lacks."""
    progress("calibration without effects")
    whole, apart = fit_explained(build_problem(card, campaign.records, law=law), progress)
    campaign = replace(campaign, notes=(*campaign.notes, *apart))
    found = set_housing_apart(whole)
    problem = found.problem
    path, search, outcome = _with_heat_path(whole, found, progress)
    while True:
        if card.polynomial is None and path is None and np.abs(found.away).max(initial=0.0) > FAR:
            # values may have gone far to do what an effect does: look from the card as shipped too
            progress("again from the card's own values")
            pursuit = Pursuit(set_housing_apart(at_point(whole, np.zeros(whole.problem.count))), progress)
            again = pursuit.outcome(search.fair(outcome.final) - BEATEN)
            search, outcome = max((again, (search, outcome)), key=lambda found: found[0].fair(found[1].final))
        # in its own noise: in that of a longer path, or beside effects, its straight lines lead out of the world
        plain = _model_of(found)
        shipped = {name: rows.rms for name, rows in plain.residuals(Kept(np.zeros(problem.count), ())).items()}
        calibrated, blocks = plain.residuals(Kept(found.point, ())), found.state.residual
        progress("held-out rows")
        named = bool(outcome.final.terms)
        longer = None if path is None else _model_of(path.fit)
        outcome, held, rows = confirm(search, outcome, plain, (calibrated, blocks), longer)
        if named and not outcome.final.terms:  # the values are those of the card, or of the longer path, alone again
            search, outcome = _without_effects(longer or plain, progress)
            if longer is not None:
                outcome, held, rows = confirm(search, outcome, plain, (calibrated, blocks), longer)
        if path is None or not is_worse(*held[FREQUENCY]):
            break
        progress("again without the longer heat path, which predicts unseen rows no better")
        path, (search, outcome) = None, Pursuit(found, progress).outcome()
    if path is not None:
        card, found = path.card, path.fit
    progress("lack of fit")
    without, levelled = outcome.plain, outcome.final
    for name in search.linear.responses:
        without, levelled = (with_levels(search, one, name) for one in (without, levelled))
    bank = generic_bank(search)
    left = look(search, bank, without if path is None else plain, levelled, rows)
    unknown = []
    for term, base in zip(outcome.final.terms, outcome.without, strict=True):
        forms = [own for own in bank if own.response in term.columns]
        best = max((one.gain for one in search.scan(base, forms)), default=-np.inf)
        unknown.append(base.score + best + CONSTANTS["log_prior_unknown"] - outcome.final.score)
    return Inference(
        card, found, search, outcome, left, shipped, calibrated, rows, held, tuple(unknown), campaign, path
    )


def _with_heat_path(whole: CardFit, found: CardFit, progress: Report) -> tuple[HeatPath | None, Search, Outcome]:
    """Search beside the path of the card, or one lag, and where that leaves slow noise of which other lags would take something, strains the card's values, or the sensor is late, beside a longer one; the likelier heat path stays."""
    own, given, path = Pursuit(found, progress), whole.problem.instrument.polynomial is None, None
    tried: dict[tuple[int, bool], HeatPath] = {}
    left = slow_share(found) > SUSPICIOUS and (given or not leaves_thermometer_noise(found))
    bring = lags_would_bring(own.search) if left else -np.inf
    ended = None
    if not (given or is_ahead(found)) and bring > WORTH and effects_would_bring(own.search) > bring:
        # an effect may do more than any lag, and then leave nothing to lags
        search, outcome = ended = own.outcome()
        slow = search.linear.rows[FREQUENCY].slow_share(outcome.final.noise[FREQUENCY])
        if slow < FOLLOWED and lags_would_bring(search, outcome.final) < 0.0:
            return None, search, outcome
    if given and (is_strained(found) or (bring > WORTH and bring > effects_would_bring(own.search))):
        path = with_second_mass(whole, found, progress)
    elif not given and (bring > WORTH or is_ahead(found)):
        path = find_heat_path(found, None if bring > WORTH else 1, tried, progress)
    if path is None or not path.departs:
        return (None, *(ended or own.outcome()))
    score, path, pursuit, begun = _beside(path, progress)
    suspicious = slow_share(path.fit) > SUSPICIOUS or any(term.response == FREQUENCY for term in begun[1].terms)
    if not given and path.lags < len(LAGS) and suspicious:
        # an effect may do what a lag does: a longer path has to be beaten with effects beside it
        longer = _beside(find_heat_path(found, len(LAGS), tried, progress), progress)
        score, path, pursuit, begun = longer if longer[0] > score + WORTH else (score, path, pursuit, begun)
    there, grown = pursuit.ended(*begun)
    score = _score(path, there, grown.final)
    gain, plain = score - evidence_of(found), own.search.settle((), found.noise)
    if with_levels(own.search, plain, FREQUENCY).score - plain.score > gain + MARGIN:
        return (None, *(ended or own.outcome()))
    if not (given or ended) and own.search.fair(plain) + own.most(plain) < score - BEATEN:
        ended = own.search, Outcome(plain, plain, (), ())
    search, outcome = ended or own.outcome(-np.inf if given else score - BEATEN)
    lead = score - search.fair(outcome.final)
    if lead < MARGIN + given * FURTHER * sum(t.brought for t in outcome.final.terms if t.response == FREQUENCY):
        return None, search, outcome
    return replace(path, evidence=gain, lead=lead), there, grown


def _beside(path: HeatPath, progress: Report) -> tuple[float, HeatPath, Pursuit, tuple[Hypothesis, Hypothesis]]:
    """Begin to search for effects beside a longer heat path; first what both score."""
    progress(f"effects beside a heat path with {path.lags} time constants")
    pursuit = Pursuit(path.fit, progress)
    begun = pursuit.begun()
    return _score(path, pursuit.search, begun[1]), path, pursuit, begun


def _score(path: HeatPath, search: Search, final: Hypothesis) -> float:
    """Log posterior of effects beside a heat path, and of that."""
    return search.fair(final) + path.housing + path.price


def _model_of(found: CardFit) -> Model:
    """A card without effects, about its most probable values."""
    return Model(Linear.of(found), Signatures.at(found.problem, found.point), (), found.noise)


def _without_effects(alone: Model, progress: Report) -> tuple[Search, Outcome]:
    """Return a search that has found nothing, about the values of a card alone."""
    search = Search(alone.linear, alone.signatures, alone.noise, progress=progress)
    none, _ = search.grow(most=0)
    return search, Outcome(none, none, (), ())
