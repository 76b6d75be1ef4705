"""From an inference to the verdict of the contract: causes with their equals and numbers, values that moved, and each response."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.lines import Line
from compensation.noise import Noise, white_rms
from studies.calibration.estimates import SILENT
from studies.calibration.fit import LASTING, stated_noise
from studies.calibration.ladder import noise_rms
from studies.calibration.priors import from_standard
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import (
    FAR,
    NINETY,
    Cause,
    Interval,
    ResponseResult,
    Shift,
    Verdict,
    doubted,
    overall,
    same_cause,
    weigh,
    wrong_values,
)
from studies.effects import find_effect, library
from studies.inference.clock import settle
from studies.inference.inferred import Inferred
from studies.inference.lack_of_fit import doubt_of
from studies.inference.model import Background, Term
from studies.inference.records import REFERENCE, Campaign
from studies.inference.sharp import longest_resolved
from studies.inference.signatures import Signatures

Array = NDArray[np.float64]
FEWEST_LAGS = 3.0
"""Time constants that the records must cover before they confirm a law whose lag is free."""
BRIEF, MINUTES = 300.0, 5.0
"""Seconds, and times the change within them up to which slow noise is usual where no card states it: a random walk of a day."""
SLOW_THAN = {True: "what the card states of its noise", False: "what noise usually makes of its changes within minutes"}
DELAY = "law.delay_s"
SURE_DELAY, LEAST_DELAY = 3.0, 0.5
"""Standard deviations, and part of what is expected of it beforehand, from which on a delay is said."""
ODD = 5.0
"""Times the scatter of the other runs from which on one is odd."""
NARROW_RANGE = 1.0
"""Kelvin below which a temperature does not vary."""
STEP, WORTH = 0.03, 0.5
"""Of a shape parameter (of its logarithm): first step to see its curvature, and fall of the evidence that a step should cost."""


def judge(found: Inferred) -> Verdict:
    """Return the verdict."""
    shifts = find_shifts(found) if found.card.polynomial is None else []
    physics = _merged(
        [*(_cause(found, k) for k in range(len(found.final.terms))), *_delay_cause(found), *_clock_cause(found)]
    )
    causes = tuple(sorted((*wrong_values(shifts), *physics), key=lambda cause: -cause.evidence))
    results = {name: _result(found, name, causes) for name in found.search.linear.responses}
    results |= skipped_results(found.campaign)
    verdict = overall([result.verdict for result in results.values()])
    named = tuple(cause for cause in doubted(causes) if cause.probability >= CONSTANTS["member"])
    return Verdict(
        verdict,
        named,
        results,
        next_step(named, results, {name: left.line for name, left in found.left.items()}),
        found.campaign.notes,
        calibration=tuple(shifts),
    )


def skipped_results(campaign: Campaign) -> dict[str, ResponseResult]:
    """Return the results of responses that are not judged, with the reason."""
    return {
        name: ResponseResult("not-identifiable", None, (None, None), None, "none", remark=why)
        for name, why in campaign.skipped.items()
    }


def find_shifts(found: Inferred) -> list[Shift]:
    """Return the values of the card that the data determine or have moved, with 90 % intervals."""
    priors, (mean, C) = found.search.linear.problem.priors, found.background.posterior
    count = len(priors.values)
    z, cov = priors.standard(mean[:count]), priors.root @ C[:count, :count] @ priors.root.T
    at, out = priors.at(mean[:count]), []
    for value, own, sd in zip(priors.values, z, np.sqrt(np.diag(cov)), strict=True):
        low, high = (from_standard(value, own + side * NINETY * sd) for side in (-1.0, 1.0))
        if sd < SILENT or abs(own) > FAR:
            out.append(Shift(value.name, value.value, at[value.name], min(low, high), max(low, high), float(own)))
    return out


def _merged(causes: Sequence[Cause]) -> list[Cause]:
    """Return one entry a physical cause, under the response where its evidence is largest."""
    kept: list[Cause] = []
    for cause in sorted(causes, key=lambda one: -one.evidence):
        if not any(same_cause(cause, other) for other in kept):
            kept.append(cause)
    return kept


def _cause(found: Inferred, k: int) -> Cause:
    """Return one term as a cause, with the effects that these data cannot tell from it."""
    outcome, term = found.outcome, found.final.terms[k]
    best: dict[str, float] = {}
    for rival in outcome.rivals[k]:
        name = rival.terms[-1].effect.name
        best[name] = max(best.get(name, -np.inf), rival.score)
    members, probability = weigh(list(best), list(best.values()), outcome.without[k].score, found.unknown[k])
    left = found.left[term.response]
    if left.significant and 0.0 < left.share < CONSTANTS["believed"]:
        probability *= left.share  # whatever made the larger rest may have made this too
    exact = term.effect.equivalents.get(term.response, ())
    names = list(dict.fromkeys([term.effect.name, *members, *exact]))
    for judge in (one for one in library().values() if one.judge == REFERENCE and term.response in one.sizes):
        names = settle(names, judge.name, judge.equivalents.get(term.response, ()), found.clock_drifts)
    numbers = parameters_of(found.background, found.search.signatures, k)
    own = next(iter([columns for name, columns in term.columns.items() if name == term.response]))
    change = own @ found.background.coefficients(k)[0]
    told = dict(numbers)
    for one in term.effect.shape:
        if one.is_run:
            told[one.name] = Interval.about(float(found.campaign.numbers[int(numbers[one.name].value)]), 0.0)
    shapes = {rival.terms[-1].effect.name: _shape_of(rival.terms[-1]) for rival in reversed(outcome.rivals[k])}
    return Cause(
        names[0],
        term.response,
        probability,
        tuple(sorted(names[1:])),
        told,
        2.0 * max(found.final.score - outcome.without[k].score, 0.0),
        peak=float(np.ptp(change)),
        shapes=shapes | {term.effect.name: numbers},
    )


def _shape_of(term: Term) -> dict[str, Interval]:
    return {p.name: Interval.about(v, 0.0) for p, v in zip(term.effect.shape, term.shape, strict=True)}


def parameters_of(background: Background, signatures: Signatures, k: int) -> dict[str, Interval]:
    """Return shape and definite coefficients of a term with 90 % intervals.

    What is not known of the shape is part of what is not known of the coefficients: Σ = Σ_c + Σ_s (∂c/∂s)² σ_s².
    """
    term, out = background.terms[k], {}
    mean, C = background.coefficients(k)
    variance = np.diag(C).copy()
    for place, parameter in enumerate(term.effect.shape):
        value, sd = term.shape[place], 0.0
        if parameter.moves(value):
            sd, slope = _shape_spread(background, signatures, k, place)
            variance = variance + (slope * sd) ** 2
        if parameter.logarithmic and sd > 0:
            half = NINETY * sd
            out[parameter.name] = Interval(value, value * float(np.exp(-half)), value * float(np.exp(half)))
        else:
            out[parameter.name] = Interval.about(value, sd)
    begin = 0
    names = term.effect.coefficient_names(term.response)
    for name, coefficient in zip(names, term.effect.coefficients, strict=True):
        at = term.members.index(begin) if begin in term.members else -1
        if at >= 0 and any(own[:, at].any() for own in term.columns.values()):  # what no row shows is left out
            out[name] = Interval.about(float(mean[at]), float(np.sqrt(variance[at])))
        begin += len(coefficient.spread)
    return out


def _shape_spread(background: Background, signatures: Signatures, k: int, place: int) -> tuple[float, Array]:
    """Return the standard deviation of a shape parameter (of its logarithm where it has one) and how coefficients go with it."""
    term = background.terms[k]
    parameter, value = term.effect.shape[place], term.shape[place]
    step = STEP if parameter.logarithmic else max(0.01 * abs(value), 0.05)

    def moved(by: float) -> Background:
        there = value * float(np.exp(by)) if parameter.logarithmic else value + by
        shape = (*term.shape[:place], there, *term.shape[place + 1 :])
        columns = signatures.of_term(term.effect, shape, term.response, term.members, term.starts)
        own = replace(term, shape=shape, columns=columns)
        return replace(background, terms=(*background.terms[:k], own, *background.terms[k + 1 :]))

    for _ in range(6):
        below, above = moved(-step), moved(step)
        fall = background.evidence - 0.5 * (below.evidence + above.evidence)
        if 0.1 * WORTH < fall < 10 * WORTH:
            break
        step *= float(np.clip(np.sqrt(WORTH / max(fall, 1e-6)), 0.02, 5.0))
    sd = step / float(np.sqrt(2.0 * fall)) if fall > 0 else 10.0 * step
    slope = (above.coefficients(k)[0] - below.coefficients(k)[0]) / (2.0 * step)
    return sd, slope


def _result(found: Inferred, name: str, causes: Sequence[Cause]) -> ResponseResult:
    left, plain, rows = found.left[name], found.plain[name], found.rows[name]
    before, after = found.held_out[name]
    terms = [term for term in found.final.terms if term.response == name]
    mine = [cause for cause in causes if cause.response == name and cause.kind == "physics"]
    values = any(cause.kind == "value" and cause.response == name for cause in causes)
    share = (left.share if left.significant else 1.0) if terms else None
    slow = _slow(found, name)
    verdict, remark = _judge(found, name, bool(terms), mine, values, slow, share)
    remark = "; ".join(word for word in (remark, _delayed(found, name), _turned_on(found, name, verdict)) if word)
    noise = min(value for value in (rows.rms, after if terms else before) if value is not None)
    white = white_rms(*rows.residual)
    return ResponseResult(
        verdict,
        noise,
        (plain.rms, before),
        (rows.rms, after) if terms else None,
        "structure" if left.significant else "none",
        left.input if left.doubtful else "",
        2.0 * max(left.evidence, 0.0),
        share,
        remark,
        white=white,
        wander=float(np.sqrt(max(rows.rms**2 - white**2, 0.0))),
        shipped=found.shipped[name].rms,
        run_shifts=_run_shifts(found, name),
    )


def _judge(
    found: Inferred, name: str, terms: bool, mine: Sequence[Cause], values: bool, slow: float, share: float | None
) -> tuple[str, str]:
    left = found.left[name]
    clean = share is None or share >= CONSTANTS["share_explained"]
    patched = bool(mine) and max(cause.probability for cause in mine) < CONSTANTS["believed"]
    if left.significant and (share is None or not clean or patched):
        return "unexplained", ""
    apart = _apart(found, name)
    if apart and not terms and not mine:
        return "not-identifiable", apart
    if slow > CONSTANTS["wander_usual"]:
        return "not-identifiable", (
            f"the slow part of the residual is {slow:.2g} times {SLOW_THAN[found.card.polynomial is None]}: these records cannot"
            " distinguish slow noise from a cause that acts slowly"
        )
    if terms or mine:
        return ("not-identifiable" if any(cause.equivalent for cause in mine) else "explained"), apart
    if values:
        return "explained", ""
    paths = found.search.signatures.paths
    if found.card.polynomial is not None:
        lasts = sum(float(np.ptp(path.time)) for path in paths)
        lag = max(path.states.tau for path in paths)
        if lasts < FEWEST_LAGS * lag:
            return (
                "not-identifiable",
                f"too short to judge: {lasts:.0f} s, and the resonator may follow the housing with {lag:.0f} s or more",
            )
    resonator = np.concatenate([path.states.resonator for path in found.search.signatures.paths])
    if np.ptp(resonator) < NARROW_RANGE:
        return (
            "not-identifiable",
            f"too short to judge: the resonator's temperature changes by {np.ptp(resonator):.2g} K only",
        )
    return ("not-identifiable", doubt_of(left.input, left.evidence)) if left.doubtful else ("adequate", "")


def _within(z: float) -> float:
    """Probability that a normal number is within so many standard deviations."""
    return float(scipy.special.erf(abs(z) / np.sqrt(2.0)))


def _delay(found: Inferred) -> tuple[float, float, float]:
    """A delay that a polynomial law has taken and its standard deviation, in parts of what sensors and clocks usually have, and that, s."""
    priors = found.search.linear.problem.priors
    if DELAY not in priors.names:
        return 0.0, 0.0, 0.0
    k = priors.names.index(DELAY)
    mean, C = found.background.posterior
    return float(mean[k]), float(np.sqrt(C[k, k])), priors.values[k].sd


def _delay_cause(found: Inferred) -> list[Cause]:
    """Return a delay that a polynomial law has taken, as the causes that look like one, when it is more than sensors and clocks have."""
    name = found.search.linear.responses[0]
    z, sd, usual = _delay(found)
    if name != "frequency_Hz" or abs(z) < SURE_DELAY:
        return []
    alike = sorted((e for e in library().values() if e.delay is not None), key=lambda e: -(e.delay or 0) * z)
    delay = Interval.about(abs(z) * usual, sd * usual)
    return [
        Cause(
            alike[0].name,
            name,
            _within(z),
            tuple(sorted(effect.name for effect in alike[1:])),
            dict.fromkeys(alike[0].coefficient_names(name), delay) if z < 0 else {},
            z**2,
        )
    ]


def _clock_cause(found: Inferred) -> list[Cause]:
    """Return a drift of the clock that a reference shows, however small it is beside the noise of the frequency."""
    if found.clock is None or not found.clock_drifts:
        return []
    (slope, sd), effect = found.clock, next(one for one in library().values() if one.judge == REFERENCE)
    (response,) = effect.sizes
    (name,) = effect.coefficient_names(response)
    return [Cause(effect.name, response, _within(slope / sd), (), {name: Interval.about(slope, sd)}, (slope / sd) ** 2)]


def _delayed(found: Inferred, name: str) -> str:
    """Return the sentence on a delay that a polynomial law has taken: it tolerates what sensors and clocks may have."""
    z, sd, usual = _delay(found)
    if name != found.search.linear.responses[0] or abs(z) < max(SURE_DELAY * sd, LEAST_DELAY):
        return ""
    delay = z * usual
    return (
        f"it follows the temperature {abs(delay):.2g} s {'later' if delay > 0.0 else 'earlier'} than one lag predicts, as sensors and"
        " clocks may; a thermometer lag or a rate effect of this size looks the same"
    )


def _turned_on(found: Inferred, name: str, verdict: str) -> str:
    """Return the sentence on offsets of runs far beyond what is left within them."""
    if name in LASTING or verdict != "adequate":
        return ""
    shifts, within = _shifts_and_rest(found, name)
    response = RESPONSES[name]
    far = int(np.argmax(np.abs(shifts - np.median(shifts))))
    others = np.delete(shifts, far)
    if len(others) > 1 and abs(odd := shifts[far] - others.mean()) > ODD * max(float(np.std(others, ddof=1)), within):
        record = found.campaign.records[far].path or f"run {far + 1}"
        return (
            f"{record}: its bias lies {odd * response.scale:+.3g} {response.shown} from that of the other runs, which agree to"
            f" {np.std(others, ddof=1) * response.scale:.2g} {response.shown}: one turn-on, or something done between the runs"
        )
    apart = float(np.sqrt(np.mean(shifts**2)))
    if apart <= CONSTANTS["wander_usual"] * within or found.card.polynomial is None:
        return ""
    return (
        f"the runs lie {apart * response.scale:.3g} {response.shown} (rms) apart, which is treated as a turn-on offset; ageing or a jump"
        " between runs would look the same. A saved model states it as turn-on; a card with bias_turn_on_deg_per_h distinguishes them"
    )


def _apart(found: Inferred, name: str) -> str:
    """Return the sentence on runs of a response without turn-on that lie farther apart than what is left within them."""
    if name not in LASTING or found.card.polynomial is None:
        return ""
    shifts, within = _shifts_and_rest(found, name)
    apart = float(np.sqrt(np.mean(shifts**2)))
    if apart <= CONSTANTS["wander_usual"] * within:
        return ""
    response = RESPONSES[name]
    text = (
        f"the runs lie {apart * response.scale:.3g} {response.shown} (rms) apart, {apart / within:.0f} times the residual within them:"
        " ageing, clock error, handling, or drift between runs"
    )
    return text if found.campaign.timed else text + "; start times ('# start' in the records) would show which of these"


def _slow(found: Inferred, name: str) -> float:
    """What is left of a response over the scatter of neighbouring rows and what the card states of slow noise."""
    rows = found.rows[name]
    if found.card.polynomial is not None:  # nothing is stated: over the changes within minutes
        level = found.search.linear.rows[name]
        rest = found.background.residual(name)
        apart = max(1, round(BRIEF / level.span))
        changes = np.concatenate([rest[own][apart:] - rest[own][:-apart] for own in level.slices])
        change = float(np.mean(changes**2)) if len(changes) else 0.0
        brief = float(np.hypot(white_rms(*rows.residual), np.sqrt(change / 2.0)))
        return rows.rms / max(MINUTES * brief, 1e-300)
    stated = stated_noise(found.card.noise, name) or Noise(0.0)
    slow = noise_rms(found.fit, name, replace(stated, white=0.0, offset=0.0))
    return rows.rms / max(float(np.hypot(white_rms(*rows.residual), slow)), 1e-300)


def _shifts_and_rest(found: Inferred, name: str) -> tuple[Array, float]:
    """Means of the runs about their mean, and the rms of what is left within the runs."""
    rows = found.rows[name].residual
    return np.array(_run_shifts(found, name)), float(
        np.sqrt(np.mean(np.concatenate([own - own.mean() for own in rows]) ** 2))
    )


def _run_shifts(found: Inferred, name: str) -> tuple[float, ...]:
    """Mean of what is left of each run, about their mean."""
    level = found.search.linear.rows[name]
    rest = found.background.residual(name)
    means = np.array([rest[own].mean() for own in level.slices])
    return tuple(float(value) for value in means - means.mean())


def next_step(
    causes: Sequence[Cause], results: Mapping[str, ResponseResult], lines: Mapping[str, Line | None]
) -> str | None:
    """Return what to measure next: what would separate a set, or see again what nobody explains."""
    for cause in causes:
        if cause.equivalent:
            sensors = sorted({find_effect(name).sensor for name in cause.names} - {""})
            more = f" Alternatively, without a run: {'; or '.join(sensors)}." if sensors else ""
            others = ", ".join(cause.equivalent)
            return f"To distinguish {cause.effect} from {others}: {find_effect(cause.effect).isolate}.{more}"
    for name, result in results.items():
        if result.verdict == "unexplained":
            word, line = RESPONSES[name].word, lines.get(name)
            if line is not None:
                return (
                    f"The {word} has a line of {line.period:.3g} s: diagnose a part of at most {longest_resolved(line.period) / 3600:.2g} h,"
                    " where it is resolved, or record its spectrum."
                )
            return (
                f"The {word} has structure in {result.left_over_input} that no known effect explains: repeat a run unchanged to see"
                " whether it recurs, then vary that input alone."
            )
    return None
