"""The extended model: the card with the named effects as `[[effect]]` tables, calibrated against the records by the one simulation.

The diagnosis says which effects there are and of what shape; what all values are together, those of bias, loss and of the way
from the chamber to the housing among them, is for `studies.calibration`, so that what is saved predicts as it was fitted.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.diagnosis.campaign import Campaign, Run
from studies.diagnosis.causes import parameters_of
from studies.diagnosis.investigate import Diagnosis
from studies.diagnosis.model import Fit, fit
from studies.diagnosis.scan import build_bank, scan
from studies.diagnosis.search import refine
from studies.diagnosis.terms import Term, used
from studies.diagnosis.verdict import Interval
from studies.effects import Effect, Parameter, find_effect
from studies.effects.states import FloatArray
from studies.errors import InputError
from studies.record import Record

if TYPE_CHECKING:
    from studies.calibration.calibrate import Calibration
    from studies.instrument.card import Instrument

WIDER = 3.0
"""Of what a diagnosis knows of an effect, the prior with which a calibration finds it anew beside all other values."""
SURE = 3.0
"""Log evidence, twenty to one, by which fewer members of a family must be likelier than all of them."""


def extend(
    instrument: "Instrument",
    diagnosis: Diagnosis,
    records: Sequence[Record],
    progress: Callable[[str], None] = lambda words: None,
) -> "Calibration":
    """Calibrate the card with the named effects: its instrument predicts what was diagnosed.

    Parameters
    ----------
    instrument : Instrument
        The card that the records were held against.
    diagnosis : Diagnosis
    records : sequence of Record
        Those that were diagnosed.
    progress : callable, optional
        Is told what comes next.

    Raises
    ------
    InputError
        If the diagnosis has no fitted response.
    """
    from studies.calibration.calibrate import calibrate

    if not diagnosis.inquiries:
        raise InputError("no extended model to save: nothing could be fitted.")
    progress("calibrating the extended card")
    entries = [own for own in instrument.content.get("effect", []) if _is_in_the_baseline(own)]
    for column, inquiry in diagnosis.inquiries.items():
        model = prune(inquiry.final)
        entries += [entry_of(model, k, column) for k, term in enumerate(model.terms) if not term.effect.once]
    extended = instrument.with_table("effect", entries)
    return calibrate(extended, without_events(diagnosis, records), profile=False, progress=progress, keep=False)


def _is_in_the_baseline(entry: dict[str, Any]) -> bool:
    """Whether the card's own effect is part of what the diagnosis started from: that of the frequency."""
    effect = find_effect(entry["name"])
    return effect.thermal or entry.get("response", effect.responses[0]) == "frequency_Hz"


def prune(model: Fit) -> Fit:
    """Return the model with families cut down to the members that pay, where the records tell so: the others are uncertain for nothing.

    A form that is likelier by less than `SURE` is a guess, and a card that takes it at its word predicts other times and temperatures
    too surely: then the family stays whole, if it holds that form. What forms may miss is no part of a card: it is left out first.
    """
    terms = [replace(term, about=(), named=False) for term in model.terms]
    if terms:
        model = fit(model.problem, model.baseline, terms, 1, model.solved.scales)
    for index in range(len(model.terms)):
        term = model.terms[index]
        places = used(term.effect)
        known = model.coefficients_of(index)[places] / np.sqrt(
            np.maximum(np.diag(model.solved.covariance)[model.columns_of(index)], 1e-300)
        )
        fewer = model
        for place in places[np.argsort(np.abs(known))]:
            effect = fewer.terms[index].effect
            if used(effect).size == 1 or (effect.positive and place == 0):
                continue
            terms = list(fewer.terms)
            terms[index] = replace(term, effect=_without_member(effect, int(place)))
            tried = fit(fewer.problem, fewer.baseline, terms, 1, fewer.solved.scales)
            if tried.log_evidence >= fewer.log_evidence:
                fewer = tried
        if fewer is not model:
            fewer = refine(fewer, index)
        best = max((_definite(model, index), fewer), key=lambda f: f.log_evidence)
        sure = best.log_evidence > model.log_evidence + SURE
        model = best if sure or not _holds(model.terms[index], best.terms[index]) else model
    return model


def _holds(family: Term, form: Term) -> bool:
    """Whether a form is of a family as it was fitted: what is not fitted of their shapes is the same."""
    pairs = zip(family.effect.shape, family.shape, form.shape, strict=True)
    return all(one == other for parameter, one, other in pairs if not parameter.moves(one))


def _definite(model: Fit, index: int) -> Fit:
    """Return the model with a term cut down to its definite curve, the first column, at the likeliest of all its shapes.

    A family at another shape may hold the same curve as a further member: two members of a number each, or one that is known.
    """
    term, problem = model.terms[index], model.problem
    effect = term.effect
    if used(effect).size == 1:
        return model
    for place in used(effect)[1:]:
        effect = _without_member(effect, int(place))
    others = [one for k, one in enumerate(model.terms) if k != index]
    base = fit(problem, model.baseline, others, 1, np.delete(model.solved.scales, index))
    seen = scan(base, build_bank(base, [effect]))
    if not seen:
        return model
    terms = (*model.terms[:index], replace(term, effect=effect, shape=seen[0].term.shape), *model.terms[index + 1 :])
    return refine(fit(problem, model.baseline, terms, 1, model.solved.scales), index)


def _without_member(effect: Effect, place: int) -> Effect:
    """Return the effect with one column less to fit."""
    coefficients, begin = [], 0
    for own in effect.coefficients:
        spread = list(own.spread)
        if begin <= place < begin + len(spread):
            spread[place - begin] = 0.0
        begin += len(spread)
        coefficients.append(replace(own, spread=tuple(spread)))
    return replace(effect, coefficients=tuple(coefficients))


def entry_of(model: Fit, index: int, column: str) -> dict[str, Any]:
    """Return the `[[effect]]` table of a fitted term, without the coefficients that are 0; numbers are as uncertain as a prior."""
    term = model.terms[index]
    most = np.concatenate([np.full(len(own.spread), own.most) for own in term.effect.coefficients])
    values = np.minimum(model.coefficients_of(index), most)
    numbers: dict[str, Any] = {p.name: float(value) for p, value in zip(term.effect.shape, term.shape, strict=True)}
    if term.effect.sees_heat:  # the fit knew the temperature with it; a simulation has to solve for it
        numbers[term.effect.shape[0].name] = float(np.clip(values[0], 0.0, 1.0))
    numbers |= {key: shortest(value) for key, value in term.effect.numbers(values, column).items() if np.any(value)}
    shapes = {parameter.name: parameter for parameter in term.effect.shape}
    for key, known in parameters_of(model, index).items():
        sd = spread_of_shape(shapes[key], known) if key in shapes else WIDER * known.sd
        if sd > 0 and isinstance(numbers.get(key), float):
            numbers[key] = {"value": numbers[key], "sd": float(sd)}
    return {"name": term.name, "response": column, **numbers}


def spread_of_shape(parameter: Parameter, known: Interval) -> float:
    """Return the prior's standard deviation of a shape parameter: at most that of a value which is even between its bounds."""
    interval, bounds, scale = np.array([known.low, known.high]), np.array([parameter.low, parameter.high]), 1.0
    if parameter.logarithmic and parameter.low > 0:
        interval, bounds, scale = np.log(interval), np.log(bounds), known.value
    return scale * min(WIDER * Interval(known.value, *interval).sd, float(np.ptp(bounds)) / float(np.sqrt(12.0)))


def shortest(value: float | list[float]) -> float | list[float]:
    """Return a list without the zeros at its end, and a number for one alone: that can be uncertain."""
    if isinstance(value, float):
        return value
    members = value[: int(np.flatnonzero(value)[-1]) + 1]
    return members if len(members) > 1 else members[0]


def without_events(diagnosis: Diagnosis, records: Sequence[Record]) -> list[Record]:
    """Return the records as they would be had what happens once happened before them all: a jump that stays is there from the start."""
    out = []
    for number, record in enumerate(records, 1):
        runs = [run for run in diagnosis.campaign.runs if run.label == (record.path or f"run {number}")]
        columns: dict[str, FloatArray] = {}
        for column, inquiry in diagnosis.inquiries.items():
            for k, term in enumerate(inquiry.final.terms):
                if term.effect.once and column in record:
                    values = columns.setdefault(column, np.array(record[column]))
                    _take_away(inquiry.final, k, diagnosis.campaign, runs, record, values)
        out.append(record.with_columns(columns) if columns else record)
    return out


def _take_away(
    model: Fit, index: int, campaign: Campaign, runs: Sequence[Run], record: Record, values: FloatArray
) -> None:
    """Take what an event made of a response from the rows of some runs, and add what it leaves behind."""
    places = model.columns_of(index)
    change = model.problem.unstack(model.linear.columns[:, places] @ model.solved.coefficients[places])
    end = change[-1][np.isfinite(change[-1])]
    last = float(end[-1]) if end.size and not model.terms[index].effect.thermal else 0.0
    time = record["time_s"] - record["time_s"][0]
    for run, own in zip(campaign.runs, change, strict=True):
        if any(run is one for one in runs):
            known, inside = np.isfinite(own), (time >= run.row_time[0]) & (time <= run.row_time[-1])
            values[inside] += last - np.interp(time[inside], run.time[known], own[known])
