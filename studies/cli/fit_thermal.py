"""`hrg fit thermal`: time constants of the resonator behind its housing, from records.

With --json one object, schema `hrg.fit-thermal/1`: `data`, `confidence`, `estimates` (by name: `value`, null where not
`determined`, `low`, `high`), `undetermined` (combinations of relative changes that the records leave open),
`initial_departure_K` per run, `residual_rms_Hz`, `row_step_s` of the averaged rows, `warnings`.
"""

from typing import TYPE_CHECKING, Any

from studies.cli.output import answers
from studies.results import Column, Figure, Result, Sentence, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

    from studies.calibration.lags.identification import Identification
    from studies.cli.arguments import Array

UNITS = {"offset": "Hz", "slope": "Hz/K", "curvature": "Hz/K²", "cubic": "Hz/K³"}


@answers("hrg.fit-thermal/1")
def fit_thermal(*data: str, card: str | None = None, lags: int | None = None, confidence: float = 0.9) -> Result:
    """Identify how the resonator lags behind its housing, with intervals, and say what the records do not determine.

    The records need time_s, frequency_Hz and housing_temperature_degC (or chamber_temperature_degC). The initial state of
    every run is unknown and fitted; the noise may drift. The lags are in series, and radiation makes a share of their
    conductance at 20 °C. Intervals hold for a gyro that is such a chain; a residual above the noise says that it is not.

    Parameters
    ----------
    data : str
        One or more records (CSV): steps, ramps or cycles.
    card : str
        A card whose law gives the curvature of the frequency over temperature; without it a curvature is fitted.
    lags : int
        Number of lags; as many as the records support unless given.
    confidence : float
        Of the intervals.
    """
    from studies.calibration.lags.records import fit_thermal_constants
    from studies.cli.output import say
    from studies.cli.telling import Told
    from studies.errors import InputError
    from studies.instrument.card import load_card
    from studies.record import read_record
    from studies.reports.digits import to_interval

    if not data:
        raise InputError("name at least one record (CSV) with a step, a ramp or a cycle of temperature.")
    if not 0 < confidence < 1:
        raise InputError(f"--confidence {confidence:g}: a confidence lies between 0 and 1, such as 0.9.")
    records = [read_record(path) for path in data]
    told = Told("lags")
    found = fit_thermal_constants(records, load_card(card) if card else None, lags, confidence, told)
    told.done()
    for warning in found.warnings:
        say(f"warning: {warning}")
    white, wandering = found.noise.innovation, float(found.residual.std())
    wanders = []
    if wandering > 3 * white:
        wanders.append(
            f"the residual ({wandering:.2g} Hz) is {wandering / white:.1f} times its white part: the noise is coloured, or the gyro"
            " is more than this chain of lags; then the constants are effective ones, outside their intervals."
        )
        say(f"note: {wanders[0]}")
    payload = _payload(found, list(data))
    rows = [
        {
            "constant": name,
            "unit": UNITS.get(name, "s" if name.startswith("time_constant") else ""),
            "value": "not determined",
        }
        | (
            {}
            if e.value is None
            else dict(zip(("value", "low", "high"), to_interval(e.value, e.low, e.high), strict=True))
        )
        for name, e in found.estimates.items()
    ]
    columns = [Column(key, key) for key in ("constant", "value", "low", "high", "unit")]
    note = f"Intervals of {100 * confidence:g} %; rows of {found.row_step:g} s; residual {found.residual.std():.2g} Hz."
    return Result(
        payload,
        "Thermal lags of the resonator",
        f"Time constants of the resonator behind its housing, from {', '.join(data)}.",
        [
            Table("Thermal constants", rows, columns, note),
            *(Sentence(f"Not determined by the records: {direction}", "warning") for direction in found.undetermined),
            *(Sentence(words, "warning", "page") for words in (*found.warnings, *wanders)),
            Figure(lambda: _residual(found.residual, found.row_step), "Residual of the frequency, all runs in order."),
        ],
    )


def _residual(residual: "Array", step: float) -> "Drawing":
    import numpy as np

    from studies.reports import style

    with style.figure(height=2.6) as (made, axis):
        rows = style.few_rows(len(residual))
        axis.plot(step / 3600 * np.arange(len(residual))[rows], residual[rows], ".", color=style.BLUE, markersize=3)
        axis.set_xlabel("time, gaps left out (h)")
        axis.set_ylabel("residual (Hz)")
        return made


def _payload(found: "Identification", data: list[str]) -> "dict[str, Any]":
    return {
        "schema": "hrg.fit-thermal/1",
        "data": data,
        "confidence": found.confidence,
        "estimates": {
            name: {"value": e.value, "low": e.low, "high": e.high, "determined": e.value is not None}
            for name, e in found.estimates.items()
        },
        "undetermined": [direction.parts for direction in found.undetermined],
        "initial_departure_K": [departure.tolist() for departure in found.departures],
        "residual_rms_Hz": float(found.residual.std()),
        "row_step_s": found.row_step,
        "warnings": list(found.warnings),
    }
