"""Named causes of an inference: its terms with their equals and numbers, a delay that the law has taken, a drift of the clock."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.constants import NINETY
from studies.calibration.noise_levels import has_levels
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import Cause, Interval, same_cause, share_wrong, weigh
from studies.effects import library
from studies.effects.effect import UNITS
from studies.inference.background import Background
from studies.inference.generic_forms import offsets
from studies.inference.heat_path import DIRECT, LAGS, MASS, SENSOR
from studies.inference.hypothesis import Hypothesis, Outcome
from studies.inference.inferred import Inferred
from studies.inference.linear import Term
from studies.inference.records import REFERENCE, settle
from studies.inference.search import MARGIN, Search
from studies.inference.signatures import SHARE, Signatures

DELAY = "law.delay_s"
SURE_DELAY = 3.0
"""Standard deviations from which on a delay is said."""
STEP, WORTH = 0.03, 0.5
"""Of a shape parameter (of its logarithm): first step to see its curvature, and fall of the evidence that a step should cost."""


def causes_of(found: Inferred) -> list[Cause]:
    """Return the effects that were found, a delay and a drift of the clock, one entry a physical cause."""
    terms = (_cause(found, k) for k in range(len(found.final.terms)))
    return _merged([*terms, *_path_causes(found), *_delay_cause(found), *_clock_cause(found)])


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
    best = best or {term.effect.name: found.final.score}  # whatever might stand there was given up
    left = found.left[term.response]
    explains = left.significant and left.share >= CONSTANTS["share_explained"]  # what rests is told beside it
    unknown = -np.inf if explains else found.unknown[k]
    members, probability = weigh(list(best), list(best.values()), outcome.without[k].score, unknown)
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


def candidates_of(found: Inferred, name: str) -> list[Cause]:
    """Return what may be behind a response of which nothing was named: the set that gains most, if it gains anything, as likely as it is."""
    best: dict[str, float] = {}
    for one in found.search.scan(found.final):
        if one.term.response == name and one.gain > 0.0:
            best[one.term.effect.name] = max(best.get(one.term.effect.name, 0.0), one.gain + one.term.price)
    if not best:
        return []
    apart = with_levels(found.search, found.final, name).score - found.final.score
    unknown = max(found.left[name].evidence + CONSTANTS["log_prior_unknown"], apart)
    (first, *others), probability = weigh(list(best), list(best.values()), 0.0, unknown)
    evidence = 2.0 * max(best[first], 0.0)
    probability *= 1.0 - share_wrong(evidence, True)
    if probability < CONSTANTS["member"]:
        return []
    return [Cause(first, name, probability, tuple(sorted(others)), {}, evidence)]


def _shape_of(term: Term) -> dict[str, Interval]:
    return {p.name: Interval.about(v, 0.0) for p, v in zip(term.effect.shape, term.shape, strict=True)}


def parameters_of(background: Background, signatures: Signatures, k: int) -> dict[str, Interval]:
    """Return shape and coefficients of a term with 90 % intervals; Σ = Σ_c + Σ_s (∂c/∂s)² σ_s² includes what is not known of the shape."""
    term, out = background.terms[k], {}
    mean, C = background.coefficients(k)
    variance = np.diag(C).copy()
    for place, parameter in enumerate(term.effect.shape):
        value, sd = term.shape[place], 0.0
        if parameter.moves(value):
            sd, slope = _shape_spread(background, signatures, k, place)
            variance = variance + (slope * sd) ** 2
        if parameter.logarithmic and sd > 0:  # no end is farther than the shape may go
            half = min(NINETY * sd, float(np.log(parameter.high / max(parameter.low, 1e-9 * parameter.high))))
            ends = np.clip(value * np.exp([-half, half]), parameter.low, parameter.high)
            out[parameter.name] = Interval(value, float(min(ends[0], value)), float(max(ends[1], value)))
        elif parameter.name == "time_s":  # between two rows nothing tells the moment
            times, _ = background.linear.problem.runs[int(term.shape[0])].own_rows[term.response]
            half = NINETY * sd + 0.5 * float(np.median(np.diff(times)))
            out[parameter.name] = Interval(value, value - half, value + half)
        else:
            out[parameter.name] = Interval.about(value, sd)
    begin = 0
    names = term.effect.coefficient_names(term.response)
    for name, coefficient in zip(names, term.effect.coefficients, strict=True):
        at = term.members.index(begin) if begin in term.members else -1
        if at >= 0 and any(own[:, at].any() for own in term.columns.values()):  # what no row shows is left out
            out[name] = Interval.about(float(mean[at]), float(np.sqrt(variance[at])))
        begin += len(coefficient.spread)
    sizes = [out[name] for name in names if name in out]
    there = term.response in term.columns
    if len(term.members) > 1 and there and all(size.low <= 0.0 <= size.high for size in sizes):
        # members of a family may stand for one another, and what they make together is sure
        out = {name: number for name, number in out.items() if name not in names}
        out[f"peak_to_peak_{UNITS[term.response]}"] = Interval.about(*background.peak_to_peak(k, term.response))
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


def _within(z: float) -> float:
    """Probability that a normal number is within so many standard deviations."""
    return float(scipy.special.erf(abs(z) / np.sqrt(2.0)))


def delay_of(found: Inferred) -> tuple[float, float, float]:
    """A delay that a polynomial law has taken and its standard deviation, in parts of what sensors and clocks usually have, and that, s."""
    priors = found.search.linear.problem.priors
    if DELAY not in priors.names:
        return 0.0, 0.0, 0.0
    k = priors.names.index(DELAY)
    mean, C = found.background.posterior
    return float(mean[k]), float(np.sqrt(C[k, k])), priors.values[k].sd


def by_rows(z: float, sd: float) -> tuple[float, float]:
    """What the rows alone say of a number, with its deviation, of which beside a prior of unit variance z ± sd is left."""
    own = 1.0 - min(sd, 0.99) ** 2
    return z / own, sd / own**0.5


def _path_causes(found: Inferred) -> list[Cause]:
    """Return a second lag, radiation, and a sensor that is late, of a heat path that stands in place of one lag."""
    if found.path is None:
        return []
    name = found.search.linear.responses[0]
    path = replace(found.path, beside=(found.numbers.point, found.background.posterior[1]))
    # what the path was taken for is named, though effects beside it blur it
    sure = path if path.departs else found.path
    probability, evidence = 1.0 / (1.0 + float(np.exp(-path.lead))), 2.0 * path.evidence
    pairs = zip(found.plain[name].residual, found.rows[name].residual, strict=True)
    peak = float(np.ptp(np.concatenate([before - after for before, after in pairs])))
    causes, names = [], {effect.card_key: effect.name for effect in library().values()}
    if path.lags > 1:
        keys = MASS if found.card.polynomial is None else [f"law.{key}" for key in LAGS[: path.lags]]
        numbers = {key.partition(".")[2]: path.interval(key) for key in keys}
        if keys is MASS:
            numbers["second_time_constant_s"] = Interval.about(*path.value(*MASS))
        causes.append(
            Cause(names[f"law.{LAGS[1]}"], name, probability, (), numbers, evidence, peak=peak, together=True)
        )
    if sure.radiates:
        own = path.evidence_for(SHARE) if causes else evidence
        told = [key for key in (SHARE, DIRECT) if key in path.fit.problem.priors.names]  # plain lags have one share
        numbers = {key.removeprefix("law."): path.interval(key) for key in told}
        causes.append(Cause(names[SHARE], name, probability, (), numbers, own, peak=peak, together=True))
    if sure.is_late:
        own = path.evidence_for(SENSOR) if causes else evidence
        numbers = {"sensor_time_constant_s": path.interval(SENSOR)}
        causes.append(Cause(names[SENSOR], name, probability, (), numbers, own, peak=peak, together=True))
    return causes


def _delay_cause(found: Inferred) -> list[Cause]:
    """Return a delay that a polynomial law has taken, as the causes that look like one, when it is more than sensors and clocks have."""
    name = found.search.linear.responses[0]
    z, sd, usual = delay_of(found)
    if name != "frequency_Hz" or abs(z) < SURE_DELAY:
        return []
    alike = sorted((e for e in library().values() if e.delay is not None), key=lambda e: -(e.delay or 0) * z)
    priors, states = found.search.linear.problem.priors, [path.states for path in found.search.signatures.paths]
    law = priors.at(found.numbers.point[: len(priors.values)])
    slope = law["law.f0_Hz"] * law["law.a1_per_K"]  # f(t − d) = f − d df/dT dT/dt
    each = 1.0 if z < 0.0 else slope
    delay, spread = (usual * one for one in by_rows(z, sd))
    return [
        Cause(
            alike[0].name,
            name,
            _within(z),
            tuple(sorted(effect.name for effect in alike[1:])),
            dict.fromkeys(alike[0].coefficient_names(name), Interval.about(-delay * each, spread * abs(each))),
            z**2,
            peak=abs(delay * slope) * float(np.ptp(np.concatenate([one.rate for one in states]))),
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


def with_levels(search: Search, now: Hypothesis, name: str) -> Hypothesis:
    """Return a model with a level of every run of a response, where that is more probable by far; else the model."""
    problem = search.linear.problem
    if len(problem.runs) == 1 or has_levels(problem, name):
        return now
    form = offsets(len(problem.runs))
    bank = search.signatures.shapes_of([(form, name)])
    tried = [search.settle((*now.terms, one.term), one.noise, [name]) for one in search.scan(now, bank)]
    best = max(tried, key=lambda one: one.score, default=now)
    return best if best.score > now.score + MARGIN else now


def farthest(levels: Array) -> tuple[int, float]:
    """Return which of some levels lies farthest from their median, and how far from the mean of the others."""
    far = int(np.argmax(np.abs(levels - np.median(levels))))
    return far, float(levels[far] - np.delete(levels, far).mean())


def only_apart(search: Search, outcome: Outcome, k: int) -> bool:
    """Whether levels of the runs are far likelier where a cause stands."""
    return with_levels(search, outcome.without[k], outcome.final.terms[k].response).score > outcome.final.score + MARGIN
