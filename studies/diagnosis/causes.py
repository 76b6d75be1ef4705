"""From inquiries to causes: one entry a physical cause, with its equals, its parameters, and what other responses say."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from studies.diagnosis.baseline import Followed
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.inquiry import Inquiry, begin, inquire, read_thermometer
from studies.diagnosis.lack_of_fit import left_over
from studies.diagnosis.model import Fit, exact_forms, fit
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.search import Hypothesis, Place
from studies.diagnosis.verdict import NINETY, Cause, Interval, same_cause, temper_of, weigh
from studies.effects import Effect, find_effect
from studies.effects.states import FloatArray

VOTERS = 4
"""Rivals of one place that the other responses are asked about."""
FAR_DOWN = 8.0
"""Fall of the log evidence beyond which a step along a shape parameter is too far to show its curvature."""
SHORTENINGS = 5


def vote(
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
        out[column] = replace(
            inquiry,
            selection=selection,
            leftover=left_over(campaign, inquiry.plain, winner.fit),
            votes=votes,
            scores=None,
        )
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
    """Log evidence of another response, its own causes included, when the thermometer is read by a rival.

    No form of its own causes is exact: the more they explain, the less a difference counts.
    """
    thermometer = read_thermometer(campaign, rival)
    baseline = other.final.baseline
    temper = temper_of(other.selection.final.score - other.selection.plain.score)
    if thermometer is None or not isinstance(baseline, Followed):
        return other.final.log_evidence / temper
    reading, whole = thermometer.reads(other.problem.response)
    moved = replace(
        baseline,
        states=thermometer.states,
        reading=reading,
        whole=whole,
        instead=thermometer.instead(other.problem.response),
        missed=thermometer.missed,
    )
    return fit(other.problem, moved, other.final.terms, 2, other.final.solved.scales).log_evidence / temper


def name_causes(campaign: Campaign, inquiries: Mapping[str, Inquiry]) -> tuple[Cause, ...]:
    """List the causes, one entry a physical cause, under the response where its evidence is largest."""
    causes = [_cause(campaign, inquiry, place) for inquiry in inquiries.values() for place in inquiry.selection.places]
    causes.sort(key=lambda cause: -cause.evidence)
    kept: list[Cause] = []
    for cause in causes:
        if not any(same_cause(cause, other) for other in kept):
            kept.append(cause)
    return tuple(kept)


def scores_of(inquiry: Inquiry, place: Place) -> list[float]:
    """Return the log posterior of every rival of a place, with what the other responses say of it."""
    return [_voted(inquiry.votes, place, n, r) for n, r in zip(place.names, place.rivals, strict=True)]


def nothing_of(inquiry: Inquiry, place: Place) -> float:
    """Return the log posterior of the model without the place's effect, with what the other responses say where they were asked."""
    if not min(inquiry.votes.values(), default=0.0):
        return place.without.score
    return place.without.score + max(scores_of(inquiry, place)) - max(r.score for r in place.rivals)


def _cause(campaign: Campaign, inquiry: Inquiry, place: Place) -> Cause:
    column = inquiry.problem.response.column
    scores = scores_of(inquiry, place)
    nothing = nothing_of(inquiry, place)
    members, probability = weigh(place.names, scores, nothing, inquiry.unknown - inquiry.selection.final.score)
    left = inquiry.leftover
    if left.significant and 0.0 < left.share < CONSTANTS["believed"]:
        probability *= left.share  # whatever made the larger rest may have made this too
    winner = place.rivals[int(np.argmax(scores))]
    effect = winner.fit.terms[place.index].effect
    exact = effect.equivalents.get(column, ())
    settled = bool(effect.judge or any(_judge_of(n) for n in exact)) and campaign.clock_known
    names = list(dict.fromkeys([effect.name, *members, *(() if settled else exact)]))
    found = parameters_of(exact_forms(winner.fit), place.index)
    shapes = {n: _shape_of(rival.fit, place.index) for n, rival in zip(place.names, place.rivals, strict=True)}
    if settled:
        names = [n for n in names if n == effect.name or n not in exact]
    return Cause(
        effect.name,
        column,
        probability,
        tuple(sorted(names[1:])),
        found,
        2.0 * max(max(scores) - nothing, 0.0),
        peak=peak_of(winner.fit, place.index),
        shapes=shapes | {effect.name: found},
    )


def _shape_of(model: Fit, index: int) -> dict[str, Interval]:
    term = model.terms[index]
    return {own.name: Interval.about(value, 0.0) for own, value in zip(term.effect.shape, term.shape, strict=True)}


def _judge_of(name: str) -> str:
    return find_effect(name).judge


def parameters_of(model: Fit, index: int) -> dict[str, Interval]:
    """Return shape and coefficients of a term with 90 % intervals; of lists the definite member. What no row shows is left out.

    What is not known of the shape is part of what is not known of the coefficients: Σ = Σ_c + Σ_s (∂c/∂s)² σ_s².
    """
    term = model.terms[index]
    places = model.columns_of(index)
    out: dict[str, Interval] = {}
    spreads, moves = shape_spread(model, index)
    for parameter, value, sd in zip(term.effect.shape, term.shape, spreads, strict=True):
        if parameter.logarithmic and sd > 0:
            half = NINETY * sd
            out[parameter.name] = Interval(value, value * float(np.exp(-half)), value * float(np.exp(half)))
        else:
            out[parameter.name] = Interval.about(value, sd)
    begin = 0
    columns = np.flatnonzero(term.effect.spread > 0)
    values = model.solved.coefficients[places]
    deviations = np.sqrt(np.maximum(np.diag(model.solved.covariance)[places], 0.0) + np.sum(np.square(moves), axis=0))
    for name, coefficient in zip(
        term.effect.coefficient_names(model.problem.response.column), term.effect.coefficients, strict=True
    ):
        at, end = np.flatnonzero(columns == begin), begin + len(coefficient.spread)
        members = places[(columns >= begin) & (columns < end)]
        if at.size and model.linear.columns[:, members].any():
            out[name] = Interval.about(float(values[at[0]]), float(deviations[at[0]]))
        begin = end
    return out


def shape_spread(model: Fit, index: int) -> tuple[list[float], FloatArray]:
    """Return the standard deviation of every shape parameter (of its logarithm where it has one), from the curvature.

    Beside them, shape by shape, how far the fitted coefficients go with a standard deviation of it: (shapes, coefficients).
    """
    term = model.terms[index]
    out, moves = [], np.zeros((len(term.shape), model.columns_of(index).size))
    for k, parameter in enumerate(term.effect.shape):
        if not parameter.moves(term.shape[k]):
            out.append(0.0)
            continue
        step = 0.03 if parameter.logarithmic else max(0.01 * abs(term.shape[k]), 0.05)
        for _ in range(SHORTENINGS):
            below, above = (_moved(model, index, k, sign * step) for sign in (-1.0, 1.0))
            fall = model.log_evidence - min(below.log_evidence, above.log_evidence)
            if fall < FAR_DOWN:
                break
            step *= max(float(np.sqrt(1.0 / fall)), 0.02)
        bend = (2.0 * model.log_evidence - below.log_evidence - above.log_evidence) / step**2
        out.append(float(1.0 / np.sqrt(bend)) if bend > 0 else step * 10.0)
        low, high = (side.solved.coefficients[side.columns_of(index)] for side in (below, above))
        moves[k] = (high - low) / (2.0 * step) * out[k]
    return out, moves


def _moved(model: Fit, index: int, k: int, step: float) -> Fit:
    """Return the model with one shape parameter of a term (its logarithm where it has one) a step further."""
    term = model.terms[index]
    value = term.shape[k] * float(np.exp(step)) if term.effect.shape[k].logarithmic else term.shape[k] + step
    shape = (*term.shape[:k], value, *term.shape[k + 1 :])
    terms = (*model.terms[:index], replace(term, shape=shape), *model.terms[index + 1 :])
    return fit(model.problem, model.baseline, terms, 1, model.solved.scales, [model.solved.kind])


def peak_of(model: Fit, index: int) -> float:
    """Return the largest less the smallest change of the response that a term makes in the record."""
    places = model.columns_of(index)
    change = model.linear.columns[:, places] @ model.solved.coefficients[places]
    return float(np.ptp(change)) if change.size else 0.0
