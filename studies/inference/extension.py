"""The extended model: the card with the named effects as `[[effect]]` tables, calibrated against the records by the one simulation."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.diagnosis.verdict import Interval
from studies.effects import Effect, Parameter
from studies.effects.states import Lags
from studies.inference.causes import parameters_of
from studies.inference.diagnosis import Inference
from studies.inference.heat_path import MASS
from studies.inference.linear import Term
from studies.record import Record
from studies.simulation.drive import COLUMN
from studies.simulation.noise import noise_keys

if TYPE_CHECKING:
    from studies.calibration.calibrate import Calibration

FROM_RUN = "from_run"
"""The run from which on a thermometer is another one."""
BEYOND, READINGS = 20.0, 4001
"""Kelvin beyond the readings, and places, at which its error is computed."""
WIDER = 3.0
"""Of what a diagnosis knows of an effect, the prior with which a calibration finds it anew beside all other values."""


def extend(found: Inference, progress: Callable[[str], None] = lambda words: None) -> "Calibration":
    """Calibrate the card with the named effects: its instrument predicts what was diagnosed, with the noise that was found."""
    from studies.calibration.calibrate import calibrate

    progress("calibrating the extended card")
    named = [entry_of(found, k) for k, term in enumerate(found.final.terms) if not term.effect.once]
    card = found.card
    if found.path is not None or card.polynomial is not None:
        # begin in the valley that was found: what is known beforehand is wide
        priors = found.search.linear.problem.priors
        at = priors.at(found.numbers.point[: len(priors.values)])
        card = card.with_values({name: at[name] for name in (MASS if card.polynomial is None else at)})
    card = card.with_table("effect", [*card.content.get("effect", []), *named])
    done = calibrate(card, without_events(found), profile=False, progress=progress, keep=False)
    losses = [own["inverse_q"] for own in found.campaign.records if "inverse_q" in own]
    loss = float(np.nanmedian(np.concatenate(losses))) if losses else 1.0
    stated = done.instrument.content.get("noise", {}) | noise_keys(done.fit.noise, loss)
    return replace(done, instrument=done.instrument.with_table("noise", stated))


def entry_of(found: Inference, k: int) -> dict[str, Any]:
    """Return the `[[effect]]` table of a term, without the coefficients that are 0; numbers are as uncertain as a prior."""
    background, term = found.background, found.final.terms[k]
    effect = term.effect
    values = np.zeros(effect.spread.size)
    values[list(term.members)] = background.coefficients(k)[0][: len(term.members)]
    values = np.minimum(values, np.concatenate([np.full(len(own.spread), own.most) for own in effect.coefficients]))
    numbers: dict[str, Any] = {p.name: float(value) for p, value in zip(effect.shape, term.shape, strict=True)}
    if FROM_RUN in numbers:  # what is simulated comes after
        numbers[FROM_RUN] = 0.0
    if effect.sees_heat:  # the fit knew the temperature with it; a simulation has to solve for it
        numbers[effect.shape[0].name] = float(np.clip(values[0], 0.0, 1.0))
    numbers |= {key: shortest(value) for key, value in effect.numbers(values, term.response).items() if np.any(value)}
    shapes = {parameter.name: parameter for parameter in effect.shape}
    for key, known in parameters_of(background, found.search.signatures, k).items():
        sd = spread_of_shape(shapes[key], known) if key in shapes else WIDER * known.sd
        if sd > 0 and isinstance(numbers.get(key), float):
            numbers[key] = {"value": numbers[key], "sd": float(sd)}
    return {"name": effect.name, "response": term.response, **_date(found, effect), **numbers}


def _date(found: Inference, effect: Effect) -> dict[str, str]:
    """From when an effect counts its time: the start of the first run, where all runs say theirs."""
    starts = [record.start for record in found.campaign.records]
    known = [start for start in starts if start is not None]
    return (
        {"since": min(known, key=lambda one: one.timestamp()).isoformat()} if effect.dated and known == starts else {}
    )


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


def without_events(found: Inference) -> list[Record]:
    """Return the records as they would be had what happens once happened before them all: a jump that stays is there from the start, a thermometer was exchanged before."""
    problem, records = found.search.linear.problem, found.campaign.records
    out = list(records)
    for k, part in enumerate(problem.parts):
        columns: dict[str, Array] = {}
        record, time = records[part.run], problem.runs[part.run].inner.time
        for term, values in zip(found.final.terms, found.numbers.coefficients, strict=True):
            if FROM_RUN in (parameter.name for parameter in term.effect.shape):
                columns |= _read_anew(found, term, values, k)
            if not term.effect.once:
                continue
            for name, change in found.model.change(term, values, k).items():
                own = columns.setdefault(name, np.array(record[name], dtype=float))
                own += _last(found, term, values, name) - np.interp(record["time_s"], time, change)
        out[part.run] = record.with_columns(columns) if columns else record
    return out


def _read_anew(found: Inference, term: Term, values: Array, k: int) -> dict[str, Array]:
    """Return what a thermometer that came later would have read in a run before it: s of T = s + e(s)."""
    states, drive = found.search.signatures.paths[k].states, found.search.signatures.paths[k].prediction.drive
    if states.run >= term.shape[0]:
        return {}
    name = COLUMN[drive.boundary]
    T = found.campaign.records[found.search.linear.problem.parts[k].run][name] + zero_Celsius
    s = np.linspace(np.nanmin(T) - BEYOND, np.nanmax(T) + BEYOND, READINGS)
    later = replace(states, run=int(term.shape[0]), time=s, housing=s, lags=Lags.one(0.0))
    error = term.effect.columns(later, term.shape, term.response)[:, list(term.members)] @ values
    return {name: np.interp(T, s + error, s) - zero_Celsius}


def _last(found: Inference, term: Term, values: Array, name: str) -> float:
    """What an event leaves behind it at the end of the campaign."""
    parts = found.search.linear.problem.parts
    ends = [found.model.change(term, values, k)[name][-1] for k, part in enumerate(parts) if name in part.responses]
    return 0.0 if term.effect.thermal else float(ends[-1])
