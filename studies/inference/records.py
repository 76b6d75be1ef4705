"""Records of one gyro made ready for a diagnosis: checked, each once, with the columns that can be used and why others cannot."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from compensation.arrays import Array
from compensation.spikes import find_spikes
from studies.calibration.observed import LEAST_ROWS, RESPONSES
from studies.errors import InputError, numbered
from studies.record import Record, place_in_time, with_bias
from studies.record.one_gyro import run_apart, runs_of_one_gyro
from studies.record.rest import LEAST_SPIKE
from studies.simulation.drive import COMMAND_COLUMNS, RATE

HOUSING, CHAMBER, RESONATOR = "housing_temperature_degC", "chamber_temperature_degC", "resonator_temperature_degC"
REFERENCE = "reference_frequency_Hz"


@dataclass(frozen=True)
class Campaign:
    """Records that a diagnosis can use, each once, with their `numbers` (from 1), `skipped` responses, notes, and whether all are `timed`."""

    paths: tuple[str, ...]
    records: tuple[Record, ...]
    numbers: tuple[int, ...]
    skipped: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    timed: bool = False
    one_apart: bool = False  # whether one run lies apart from the law of the others


def driving(record: Record) -> Array:
    """Temperature that drives a record that is ready, °C, without its holes."""
    own = np.asarray(record[HOUSING if HOUSING in record else CHAMBER])
    return own[np.isfinite(own)]


def make_ready(given: Sequence[Record]) -> Campaign:
    """Check several records of one gyro and keep what can be used; InputError where they disagree or lack a column or unit."""
    if not given:
        raise InputError("no records given; a diagnosis needs at least one.")
    given = [with_bias(record) for record in given]
    source = _temperature_source(given)
    check_units(given)
    check_device(given)
    notes: list[str] = []
    kept, odd = runs_of_one_gyro(given, notes.append)
    one_apart = odd is not None
    if odd is not None and len(kept) > 2:
        notes.append(f"{kept[odd].path or f'run {odd + 1}'} is left out of the diagnosis.")
        del kept[odd]
        one_apart = run_apart(kept) is not None
    tables = [_columns(record, source) for record in kept]
    outliers = sum(_remove_outliers(table) for table in tables)
    skipped = _unusable(kept, tables)
    if all(name in skipped or not any(name in table for table in tables) for name in RESPONSES) and not skipped:
        raise InputError(f"{kept[0].path or 'record'}: a diagnosis needs frequency_Hz, bias_deg_per_h or inverse_q.")
    _, timed = place_in_time(kept)
    if not timed and len(kept) > 1:
        notes.append("The records have no distinct start times (# start: …); they are treated as consecutive.")
    for name in COMMAND_COLUMNS:
        there = [record.has_values(name) for record in kept]
        if any(there) and not all(there) and name != RATE:
            notes.append(f"{name} is not in every record and was left out.")
            tables = [{key: own for key, own in table.items() if key != name} for table in tables]
    if outliers:
        notes.insert(0, f"{numbered(outliers, 'outlying value')} {'was' if outliers == 1 else 'were'} left out.")
    out = []
    for record, table in zip(kept, tables, strict=True):
        columns = {key: own for key, own in table.items() if key != "temperature" and key not in skipped}
        place = CHAMBER if source == CHAMBER else HOUSING
        out.append(replace(record, columns=columns | {place: table["temperature"]}))
    numbers = [1 + next(k for k, one in enumerate(given) if one["time_s"] is record["time_s"]) for record in kept]
    long = [any(name in own and np.isfinite(own[name]).sum() >= LEAST_ROWS for name in RESPONSES) for own in out]
    paths = tuple(record.path or f"run {number}" for record, number in zip(kept, numbers, strict=True))
    if not any(long):
        short = {name: "too few rows in every run" for name in RESPONSES if any(name in own for own in out)}
        why = "; ".join(f"{name}: {words}" for name, words in (skipped | short).items())
        still = not short and set(skipped.values()) == {"constant"}
        mend = "Record more digits, or a run in which it varies." if still else "Give longer records."
        raise InputError(f"{', '.join(paths)}: too little for a diagnosis: {why}. {mend}")
    notes += [f"{own.path}: too few rows; it is left out." for own, enough in zip(out, long, strict=True) if not enough]
    chosen = [k for k, enough in enumerate(long) if enough]
    return Campaign(
        paths,
        tuple(out[k] for k in chosen),
        tuple(numbers[k] for k in chosen),
        skipped,
        tuple(notes),
        timed,
        one_apart,
    )


def _temperature_source(records: Sequence[Record]) -> str:
    names = (HOUSING, CHAMBER, RESONATOR)
    told = [{name for name in names if name in own and np.isfinite(own[name]).sum() > 1} for own in records]
    for name in names:
        if all(name in own for own in told):
            return name
    lacking = next((record for record, own in zip(records, told, strict=True) if not own), records[0])
    raise InputError(
        f"{lacking.path or 'record'}: {HOUSING} or {CHAMBER} is needed, with two values or more, the same in every record."
    )


def _columns(record: Record, source: str) -> dict[str, Array]:
    names = ("time_s", *RESPONSES, *COMMAND_COLUMNS, REFERENCE, *((CHAMBER,) if source == HOUSING else ()))
    table = {name: np.asarray(record[name], dtype=float) for name in names if name in record}
    table["temperature"] = np.asarray(record[source], dtype=float)
    return table


def _remove_outliers(table: dict[str, Array]) -> int:
    """Set outlying rows of every measured column to NaN and return how many there were."""
    count = 0
    for name in ("temperature", *RESPONSES, REFERENCE):
        if name in table:
            outlying = find_spikes(table[name], LEAST_SPIKE if name == "temperature" else 0.0)
            if outlying.any():
                table[name] = np.where(outlying, np.nan, table[name])
                count += int(outlying.sum())
    return count


def _unusable(records: Sequence[Record], tables: Sequence[dict[str, Array]]) -> dict[str, str]:
    """Return response -> why it cannot be judged."""
    skipped = {}
    spans = [np.ptp(own) for t in tables if (own := t["temperature"][np.isfinite(t["temperature"])]).size]
    if not spans:
        raise InputError(f"{records[0].path or 'record'}: the driving temperature has no values.")
    for name in RESPONSES:
        parts = [table[name][np.isfinite(table[name])] for table in tables if name in table]
        values = np.concatenate(parts or [np.empty(0)])
        if values.size == 0:
            if any(name in record.columns for record in records):
                skipped[name] = "every value is missing"
        elif values.size < FEWEST_BINS:
            skipped[name] = f"only {numbered(values.size, 'value')}"
        elif np.ptp(values) == 0.0:
            skipped[name] = "constant"
        elif max(spans) == 0.0:
            skipped[name] = "the temperature never changes (is the sensor stuck?)"
    return skipped


CLEAR = 4.0
"""Standard deviations at which a drift of the clock is believed."""
INDEPENDENT = 10.0
"""Neighbouring rows share slow noise: one row in so many counts as independent."""


def drift_of(records: Sequence[Record]) -> tuple[float, float] | None:
    """Return the drift of the gyro's clock against the reference, Hz a day, and its standard deviation; None where a record has none."""
    starts, _ = place_in_time(records)
    days, errors = [], []
    for record, start in zip(records, starts, strict=True):
        if REFERENCE not in record or "frequency_Hz" not in record:
            return None
        days.append((record["time_s"] - record["time_s"][0] + start) / 86400.0)
        errors.append(record["frequency_Hz"] - record[REFERENCE])
    t, error = np.concatenate(days), np.concatenate(errors)
    known = np.isfinite(error)
    if known.sum() < INDEPENDENT:
        return None
    slope, level = np.polyfit(t[known], error[known], 1)
    rest = error[known] - slope * t[known] - level
    spread = np.sqrt(INDEPENDENT * np.mean(rest**2) / known.sum()) / max(float(np.std(t[known])), 1e-300)
    return float(slope), float(spread)


def settle(names: Sequence[str], judge: str, equals: Sequence[str], drifts: bool | None) -> list[str]:
    """Return the names that could stand for one cause without those that the reference clock (`judge`, its `equals`) excludes."""
    pair = {judge, *equals}
    if drifts is None or not pair & set(names):
        return list(names)
    left = [name for name in names if name not in pair or (name == judge) == drifts]
    return left or list(names)


FEWEST_BINS = 24
"""Values from which on the noise of a response can be told."""
ONE_WAVE = 1e-3
"""Relative difference of two clocks beyond which they count different waves."""
MOST_LOSS = 30.0
"""Times by which 1/Q of one gyro may differ from record to record."""


def check_units(records: Sequence[Record]) -> None:
    """Raise InputError when a column can hardly be in the unit that its name says."""
    for record in records:
        where = record.path or "record"
        if not 100.0 < (value := _level(record, "frequency_Hz", 1e3)) < 1e9:
            raise InputError(f"{where}: frequency_Hz is about {value:g}, not 100 Hz to 1 GHz. Is it in another unit?")
        own, other = (_level(record, name, np.nan) for name in ("frequency_Hz", REFERENCE))
        if abs(other / own - 1) > ONE_WAVE:
            raise InputError(
                f"{where}: {REFERENCE} is about {other:.6g} Hz, frequency_Hz about {own:.6g} Hz: the two are to be of one wave,"
                " by two clocks. Correct the one that is wrong, or leave that column out."
            )
        if not 0.0 < (value := _level(record, "inverse_q", 1e-3)) < 0.1:
            raise InputError(f"{where}: inverse_q is about {value:g}, not between 0 and 0.1. Is it Q itself?")


def _level(record: Record, name: str, none: float) -> float:
    """Return the median of a column, or what stands for one without values."""
    known = record[name][np.isfinite(record[name])] if name in record else np.empty(0)
    return float(np.median(known)) if known.size else none


def check_device(records: Sequence[Record]) -> None:
    """Raise InputError when the records name different gyros, or have losses that no gyro has both of."""
    names = {record.instrument: record.path for record in records if record.instrument}
    if len(names) > 1:
        (one, first), (two, second), *_ = names.items()
        raise InputError(f"{second}: instrument '{two}' is not that of {first}, '{one}'; diagnose one gyro at a time.")
    levels = [(level, record.path) for record in records if np.isfinite(level := _level(record, "inverse_q", np.nan))]
    if levels and max(levels)[0] > MOST_LOSS * min(levels)[0]:
        raise InputError(
            f"{max(levels)[1]}: inverse_q is about {max(levels)[0]:g}, in {min(levels)[1]} about {min(levels)[0]:g}; "
            "the records are of different gyros, or one is in another unit."
        )
