"""`hrg compensate`: apply a saved model to a record, or turn it into C for firmware."""

from typing import Any

import numpy as np

from compensation.arrays import Array
from compensation.decimation import Blocks, average_blocks
from compensation.errors import CompensationError
from compensation.improvement import AVERAGING, FEWEST
from compensation.noise import white_rms
from studies import models
from studies.cli.output import answers, keep_record, say
from studies.errors import InputError
from studies.files.writing import write_text
from studies.instrument.units import unit_of
from studies.record import COMPENSATED, RESONATOR, Record, read_record
from studies.record.misread import mend_by, misreadings
from studies.record.one_gyro import FINER, SHIFTS
from studies.record.rest import check_record
from studies.reports import style
from studies.results import Drawing, Figure, Part, Result, Sentence, Table

RATE, APPLIED, FREQUENCY = "measured_rate_deg_per_s", "rate_deg_per_s", "frequency_Hz"
WANTED = 10  # averages of a record that is too short for as many of 100 s
NOISE = 0.02  # relative: what the noise of a model's inputs may add to a record that has nothing to compensate
WORSE = "{} is worse than the record: the standard deviation of {:.3g} s averages increases from {:.4g} to {:.4g}. Use it only if the model is of this gyro."
MOVING = " A model of the frequency is that of settled states: while the temperature changes, the resonator lags its thermometer."
EXPLAINED = 0.5  # of the record's deviation, and of what is left: what a correction in another unit leaves
MISREAD = (
    "{}: {} {}: the correction brings the standard deviation of {:.3g} s averages from {:.4g} to {:.4g}, and to {:.4g} once that is"
    " mended. {}, or leave the record out if it is of another gyro."
)
LATE = (
    "{0}: with {1} read {2:.2g} h {3}, what is left changes by {5:.3g} instead of {4:.3g} (rms, white noise apart): is one of the two logged"
    " by another clock, or does the output lag?"
)
SIGN = "Correct the sign of the column, or of the temperature if the model takes one"
OWN_THERMOMETER = (
    "{1} has no thermometer, so {0} has the resonator's temperature, found from the frequency, instead of a compensated frequency."
    " To compensate other outputs over this temperature, use hrg fit bias --over temperature."
)
COLUMNS = "name: Column | stability_before: Before | stability_after: After | Unit | rows_not_compensated: Empty rows"


@answers("hrg.compensate/1")
def compensate(
    model: str, run: str | None = None, /, *, out: str | None = None, extrapolate: bool = False, emit: str | None = None
) -> Result:
    """Apply a model saved by one of the hrg fit commands: write the record with compensated_… columns added.

    Inputs outside the fitted range are refused. A frequency model uses the temperature of the housing, or else of the
    resonator or the chamber. If the record has no thermometer, the resonator's temperature is found from the frequency and
    added instead, as hrg temperature does.

    Args:
        model: A model file (TOML) written with --save.
        run: The record (CSV) to compensate.
        out: Write the record with the added columns.
        extrapolate: Apply the model outside its fitted range too; without a thermometer, leave those rows empty.
        emit: Write the model as C99 source for firmware.
    """
    loaded = models.read_model(model)
    if (run is None) != (out is None):
        raise InputError("a record and --out go together: hrg compensate MODEL RUN --out FILE.")
    if run is None and emit is None:
        raise InputError("nothing to do: give a record and --out FILE, or --emit FILE.c.")
    if emit is not None:
        write_text(emit, models.emit_c(loaded))
        say(f"C source: {emit}")
    columns: dict[str, dict[str, Any]] = {}
    added: list[str] = []
    parts: list[Part] = []
    if run is not None and out is not None:
        models.emit_c(loaded)  # a formula that lacks a key is refused before a long record is read
        say(f"reading {run}")
        record = read_record(run)
        if loaded.kind != "frequency" and (doubt := check_record(record)):  # that of frequency takes each row alone
            say(f"warning: {doubt}")
        result = models.compensate(loaded, record, extrapolate=extrapolate)
        added = [name for name in result.columns if name not in record]
        columns = {name: _judge(record, result, name) for name in added if name.startswith(COMPENSATED)}
        worse = _find_worse(record, result, columns)
        worse += filter(None, (_find_late(record, result, name, next(iter(loaded.validity), "")) for name in columns))
        keep_record(result, out)
        parts = _show(record, result, columns, worse)
        if RESONATOR in added:
            parts.append(OWN_THERMOMETER.format(out, run))
            if empty := int(np.count_nonzero(np.isnan(result[RESONATOR]))):
                stay = "row stays" if empty == 1 else "rows stay"
                parts.append(f"{empty} {stay} empty: the frequency is missing, or outside the fitted range.")
            parts.append(Figure(lambda: _draw(record, result, RESONATOR), "Temperature of the resonator."))
    payload: dict[str, Any] = {"model": model, "kind": loaded.kind, "run": run, "out": out}
    payload |= {"added": added, "columns": columns}
    return Result(payload, "Compensation of a record", f"{run or 'No record'}, compensated with {model}.", parts)


def _judge(record: Record, result: Record, name: str) -> dict[str, Any]:
    # A rate made from raw counts has no uncompensated column of its own in the record.
    after, before = result[name], record.columns.get(name.removeprefix(COMPENSATED))
    missing = np.isnan(after) if before is None else np.isnan(after) & ~np.isnan(before)
    return {
        "averaging_s": _width(record),
        "stability_before": None if before is None else _stability(record, name, before),
        "stability_after": _stability(record, name, after),
        "rows_not_compensated": int(np.count_nonzero(missing)),
    }


def _find_worse(record: Record, result: Record, columns: dict[str, dict[str, Any]]) -> list[str]:
    """Return a sentence on each output that the model makes worse; refuse one of the opposite sign, or in another unit."""
    found = []
    for name, one in columns.items():
        was, now, output = one["stability_before"], one["stability_after"], name.removeprefix(COMPENSATED)
        if was is None or now is None:
            continue
        for words, times in misreadings(output).items():
            so = _stability(record, name, record[output] - (record[output] - result[name]) / times)
            if so is not None and so < EXPLAINED * min(was, now):
                mend = SIGN if times < 0 else mend_by(times)
                raise InputError(MISREAD.format(record.path, output, words, _width(record), was, now, so, mend))
        if now > was * (1 + NOISE):
            moving = MOVING if output == FREQUENCY else ""
            found.append(WORSE.format(name, _width(record), was, now) + moving)
    return found


def _find_late(record: Record, result: Record, name: str, drive: str) -> str:
    """Say by how much another clock, or a lag, would explain what a correction leaves; empty where none does."""
    output = name.removeprefix(COMPENSATED)
    if output not in record or output == FREQUENCY or (output == RATE and APPLIED in record):
        return ""
    means = _means(record, output=record[output], correction=record[output] - result[name])
    if means is None:
        return ""
    time, (y, correction) = means.time, means.columns.values()

    def compare(by: float) -> tuple[float, float, float, float]:
        """Return which part of the squares the correction of `by` s later leaves of those of now, `by`, and both, white noise apart."""
        later = np.interp(time + by, time, correction, left=np.nan, right=np.nan)
        both = np.isfinite(later)
        if np.count_nonzero(both) < FEWEST:
            return np.inf, by, 0.0, 0.0
        moved, now = (float(left.var()) - white_rms(left) ** 2 for left in ((y - later)[both], (y - correction)[both]))
        return moved / now if now > 0 else np.inf, by, moved, now

    _, near, *_ = min(map(compare, SHIFTS))
    part, by, moved, now = min(compare(near * times) for times in FINER)
    if part >= EXPLAINED**2:
        return ""
    return LATE.format(name, drive, abs(by) / 3600, "later" if by > 0 else "earlier", now**0.5, max(moved, 0.0) ** 0.5)


def _show(record: Record, result: Record, columns: dict[str, dict[str, Any]], worse: list[str]) -> list[Part]:
    rows = [{"name": name, "unit": unit_of(name).removeprefix("1") or ""} | one for name, one in columns.items()]
    which = "Before, after" if any(one["stability_before"] is not None for one in rows) else "After"
    error = (
        " of the difference from the applied rate, delays at its steps included"
        if APPLIED in record and any(name.endswith(RATE) for name in columns)
        else ""
    )
    note = f"{which}: standard deviation of {_width(record):.3g} s averages{error}."
    if any(one["rows_not_compensated"] for one in rows):
        note += " Empty rows: an input is missing, too few samples come before, or the output is within a dead band."
    for words in worse:
        say(f"warning: {words}")
    parts: list[Part] = [*(Sentence(words, "warning", "page") for words in worse)]
    parts.append(Table("Compensated columns", rows, COLUMNS, note))
    for name, one in columns.items():
        if one["stability_after"] is None:
            parts.append(f"{name}: too few rows for averages.")
        parts.append(Figure(lambda name=name: _draw(record, result, name), f"{name} over time."))  # type: ignore[misc]
    return parts


def _draw(record: Record, result: Record, name: str) -> Drawing:
    rows = style.few_rows(len(record))
    hours = record["time_s"][rows] / 3600
    with style.figure(height=3.4, x="time (h)", y=unit_of(name)) as (made, axes):
        if before := name.removeprefix(COMPENSATED) in record:
            axes.plot(hours, record[name.removeprefix(COMPENSATED)][rows], color=style.ORANGE, label="before")
        axes.plot(hours, result[name][rows], color=style.BLUE, label="after" if before else name)
        return made


def _width(record: Record) -> float:
    """Return AVERAGING, or what makes WANTED averages of a shorter record (s)."""
    return min(AVERAGING, float(np.ptp(record["time_s"])) / WANTED)


def _stability(record: Record, name: str, values: Array) -> float | None:
    """Standard deviation of averages; of a measured rate the error, where the record has the applied one."""
    means = _means(record, output=values - record[APPLIED] if name.endswith(RATE) and APPLIED in record else values)
    return None if means is None else float(means.columns["output"].std())


def _means(record: Record, **columns: Array) -> Blocks | None:
    """Averages of columns; None where there are too few."""
    try:
        means = average_blocks(record["time_s"], columns, _width(record))
    except CompensationError:
        return None
    return means if means.time.size >= FEWEST else None
