"""Zero-rate runs of a gyro from record files: which columns count, rows left out, long records averaged."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.cross_damping import RestRun
from compensation.decimation import average_blocks
from compensation.spikes import find_spikes, find_stuck, find_stuck_at_ends
from studies.errors import InputError, numbered
from studies.record import OUTPUTS, Record
from studies.record.one_law import course_of, follow

TEMPERATURES = ("housing_temperature_degC", "resonator_temperature_degC", "chamber_temperature_degC")
MOST_ROWS = 20_000  # beyond which a run is averaged in blocks before a fit: temperature is slow, and noise averages
LEAST_SPIKE = 1e-3  # of a column's span, by which a spike stands out: a smooth column has no noise to measure it by
DRIVING = (TEMPERATURES[0], TEMPERATURES[2], TEMPERATURES[1])
BLOCKS = 100  # by which a rate is told
FASTEST = 1.0  # K/s over a record, beyond which its time cannot be in seconds
OPPOSITE = 15.0  # K between a chamber and the housing in it, from which on one of them may have the opposite sign, and
FOLLOWS_NOT, STANDS = 3.0, 10.0
"""Times less with the sign changed, where they move against each other and where one stands."""
AT_ONCE, LEAST_CHANGE, FASTER = 4, 5.0, 2.0  # rows in one direction, K and K/s, beyond which it is said of a housing
DOUBTFUL, FAST, FASTER_THAN_ANY, SLOWEST = 0.1, 0.15, 0.5, 1e-4
"""K/s held for a tenth of a record: 6, 9 and 30 K/min, 0.36 K/h. Chambers for fast transfers reach 20 K/min."""
LEAST_SPREAD, LONG = 10.0, 1e6  # K that a record covers, and s it lasts, before a slow one is doubted
SHORT_LAG, LONG_LAG = 200.0, 2e5
"""s: between them lie resonators behind their housing, in vacuum; a small cup of metal is faster."""
BRIEF = 1200.0  # s: a run of 20 h, if they are minutes
CLEAR, APART = 0.5, 30.0  # of what lags so many times shorter leave of a frequency: left by a lag that is there
LARGEST_REST = 0.01  # applied rate in °/s that still counts as rest: somewhat more than the earth's, 0.0042 °/s


@dataclass(frozen=True)
class RestData:
    """Runs for a fit at rest, with the columns that they came from and the rows that were left out."""

    runs: tuple[RestRun, ...]
    output: str
    temperature_column: str
    left_out: int
    block_s: float


def drop_spikes(keep: NDArray[np.bool_], *columns: Array) -> NDArray[np.bool_]:
    """Return the rows to keep without those in which a column is contradicted by its neighbours."""
    cleaned = keep.copy()
    for column in columns:
        cleaned &= ~find_spikes(np.where(keep, column, np.nan), LEAST_SPIKE)
    return cleaned


def without_spikes(record: Record) -> Record:
    """Return a record without the readings that such rows are left out for."""
    names = [name for name in (*OUTPUTS, *TEMPERATURES) if name in record]
    spikes = {name: find_spikes(record[name], LEAST_SPIKE) for name in names}
    return record.with_columns({name: np.where(rows, np.nan, record[name]) for name, rows in spikes.items()})


def choose_column(records: Sequence[Record], candidates: Sequence[str], purpose: str) -> str:
    """Return the first candidate that every record has."""
    for name in candidates:
        if all(name in record for record in records):
            return name
    names = " or ".join(candidates)
    for record in records:
        if not any(name in record for name in candidates):
            raise InputError(f"{record.path}: it has no column {names}, which {purpose} needs in every record.")
    raise InputError(f"{records[0].path}: {purpose} needs the same column in every record: {names}.")


def require_rest(record: Record, why: str) -> None:
    """Refuse a record of a gyro that turned."""
    if "rate_deg_per_s" in record and np.any(np.abs(record["rate_deg_per_s"]) > LARGEST_REST):
        raise InputError(f"{record.path or 'record'}: rate_deg_per_s is not zero; {why}")


def gather_rest(records: Sequence[Record], outputs: dict[str, float]) -> RestData:
    """Return the runs of these records in SI units; `outputs` gives the output columns and their unit in rad/s."""
    output = choose_column(records, tuple(outputs), "a fit at zero rate")
    column = choose_column(records, TEMPERATURES, "a fit over temperature")
    runs, left_out, widest = [], 0, 0.0
    for record in records:
        require_rest(record, "this fit needs the gyro at rest.")
        time, values, temperature = record["time_s"], record[output], record[column]
        complete = drop_spikes(np.isfinite(values) & np.isfinite(temperature), values, temperature)
        left_out += int(np.count_nonzero(~complete))
        if np.count_nonzero(complete) < 2:
            empty = [name for name in (output, column) if np.count_nonzero(np.isfinite(record[name])) < 2]
            what = (
                f"{' and '.join(empty)} has no values"
                if empty
                else f"{output} and {column} never have a value in one row"
            )
            raise InputError(f"{record.path}: {what}; a fit over temperature needs both.")
        time, values, temperature = time[complete], values[complete], temperature[complete]
        if len(time) > MOST_ROWS:
            width = math.ceil((time[-1] - time[0]) / MOST_ROWS * 10) / 10
            blocks = average_blocks(time, {"output": values, "temperature": temperature}, width)
            time, values, temperature = blocks.time, blocks.columns["output"], blocks.columns["temperature"]
            widest = max(widest, width)
        runs.append(RestRun(time, values * outputs[output], temperature))
    return RestData(tuple(runs), output, column, left_out, widest)


def check_record(record: Record) -> str:
    """Refuse temperatures that contradict each other or lag as in no chamber and no resonator; else return doubts of them and of outputs that stand still, if any."""
    return " ".join(filter(None, (check_temperatures(record), *_stuck(record))))


def stuck_rows(record: Record) -> dict[str, NDArray[np.bool_]]:
    """Return output -> rows in which it holds one reading where the readings beside it differ; a temperature may well be held, but not to the end after noise."""
    found = {name: find_stuck(record[name]) for name in OUTPUTS if name in record}
    found |= {name: find_stuck_at_ends(record[name]) for name in TEMPERATURES[:1] if name in record}
    return {name: rows for name, rows in found.items() if rows.any()}


def without_stuck(record: Record) -> Record:
    """Return a record without its stuck readings, and without outputs where the housing's stand still: nothing drives them there."""
    stuck = stuck_rows(record)
    if not stuck:
        return record
    undriven = stuck.get(TEMPERATURES[0])
    if undriven is not None:
        none = np.zeros(len(record), dtype=bool)
        stuck |= {name: undriven | stuck.get(name, none) for name in OUTPUTS if name in record}
    return record.with_columns({name: np.where(rows, np.nan, record[name]) for name, rows in stuck.items()})


def _stuck(record: Record) -> list[str]:
    return [
        f"{record.path or 'record'}: {name} repeats one reading in {numbered(int(rows.sum()), 'row')}, the first at {record['time_s'][rows][0]:.6g} s,"
        " where the readings beside them differ, as of a stuck logger or a mark for missing values: they are left out."
        for name, rows in stuck_rows(record).items()
    ]


def check_temperatures(record: Record) -> str:
    """Refuse temperatures that no chamber and no resonator gives; else return a doubt, if any."""
    name = next((one for one in DRIVING if one in record and np.isfinite(record[one]).sum() > 1), None)
    if name is None:
        return ""
    where, known = record.path or "record", np.isfinite(record[name])
    _check_signs(record, where)
    time, T = record["time_s"][known], record[name][known]
    time = time - time[0]
    lasts, spread = max(float(np.ptp(time)), 1e-9), float(np.subtract(*np.percentile(T, [99.5, 0.5])))
    if spread > FASTEST * lasts:
        raise InputError(
            f"{where}: the temperature changes by {np.ptp(T):.3g} K within {lasts:.3g} s, faster than any chamber. time_s must be in seconds: is it in minutes or hours?"
        )
    if name != TEMPERATURES[2] and (change := _fastest_change(time, T)):
        raise InputError(f"{where}: {name} changes by {change[0]:.3g} K within {change[1]:.3g} s, faster than any housing. time_s must be in seconds: is it in minutes or hours?")  # fmt: skip
    if spread < LEAST_SPREAD:
        return ""
    held = _held_rate(time, T, lasts)
    unit = "minutes" if held > DOUBTFUL else "milliseconds" if held < SLOWEST and lasts > LONG else ""
    if not unit:
        return ""
    lag = None
    if "frequency_Hz" in record and name != TEMPERATURES[1]:
        lag = _lag_of(record, name)
    part = "faster than {:.2g} K/min for a tenth" if unit == "minutes" else "slower than {:.2g} K/min for nine tenths"
    said = f"{where}: {name} changes {part.format(60 * held)} of its {lasts:.3g} s"
    if lag is not None:
        said += f", and the frequency follows it by {lag:.2g} s"
        fast = held > (FAST if lasts < BRIEF else FASTER_THAN_ANY)
        if (fast and lag < SHORT_LAG) if unit == "minutes" else lag > LONG_LAG:
            raise InputError(f"{said}, as in no chamber and no resonator: time_s must be in seconds: is it in {unit}?")
        if unit == "minutes" and lag > SHORT_LAG:
            return ""
    return f"{said}: if time_s is in {unit}, convert it to seconds ('hrg import')."


def _check_signs(record: Record, where: str) -> None:
    """Refuse a housing that is far from its chamber and near it with the opposite sign."""
    if DRIVING[0] not in record or DRIVING[1] not in record:
        return
    both = np.array([record[DRIVING[0]], record[DRIVING[1]]])
    apart, turned = (np.nanmedian(np.abs(sign * both[0] - both[1])) for sign in (1.0, -1.0))
    against = np.nanmean(np.prod(both - np.nanmean(both, axis=1, keepdims=True), axis=0))
    if apart > max(OPPOSITE, (FOLLOWS_NOT if against < -1.0 else STANDS) * turned):
        raise InputError(
            f"{where}: {DRIVING[0]} is {apart:.3g} K away from {DRIVING[1]} (median), and {turned:.3g} K with the sign changed. Correct the column that has the opposite sign."
        )


def _fastest_change(time: Array, T: Array) -> tuple[float, float] | None:
    """Largest change (K) over `AT_ONCE` rows in one direction, and how long it took, if no mass behind a wall can change so fast."""
    if len(T) <= AT_ONCE:
        return None
    rose, lasts = T[AT_ONCE:] - T[:-AT_ONCE], time[AT_ONCE:] - time[:-AT_ONCE]
    each = np.lib.stride_tricks.sliding_window_view(np.diff(T), AT_ONCE)[: len(rose)]
    even = (each * np.sign(rose)[:, None] > 0.1 * np.abs(rose)[:, None]).all(axis=1)  # not one jump among rows
    fast = np.where(even & (np.abs(rose) > np.maximum(LEAST_CHANGE, FASTER * lasts)), np.abs(rose), 0.0)
    k = int(np.argmax(fast))
    return (float(fast[k]), float(lasts[k])) if fast.any() else None


def _held_rate(time: Array, T: Array, lasts: float) -> float:
    """Rate (K/s) that a temperature exceeds during a tenth of the record: the few jumps of a set point do not count."""
    block = np.minimum(BLOCKS * time / lasts, BLOCKS - 1).astype(int)
    count = np.bincount(block, minlength=BLOCKS)
    at, mean = (np.bincount(block, own, BLOCKS)[count > 0] / count[count > 0] for own in (time, T))
    return float(np.percentile(np.abs(np.diff(mean) / np.diff(at)), 90))


def _lag_of(record: Record, name: str) -> float | None:
    """Lag (s) with which the frequency follows a temperature by one law; None where none is clear."""
    course = course_of(record, name, "frequency_Hz")
    if course is None or course.time.size < BLOCKS // 4:
        return None
    left = {lag: follow([course], lag).left for lag in (0.0, *np.logspace(0, 7, 29))}
    best = min(left, key=left.__getitem__)
    shorter = [own for lag, own in left.items() if lag < best / APART]
    return best if shorter and left[best] < CLEAR * min(shorter) else None
