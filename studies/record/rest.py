"""Zero-rate runs of a gyro from record files: which columns count, rows left out, long records averaged."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensation.cross_damping import RestRun
from compensation.decimation import average_blocks
from compensation.spikes import find_spikes
from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.record import Record

TEMPERATURES = ("housing_temperature_degC", "resonator_temperature_degC", "chamber_temperature_degC")
MOST_ROWS = 20_000  # beyond which a run is averaged in blocks before a fit: temperature is slow, and noise averages
LEAST_SPIKE = 1e-3  # of a column's span, by which a spike stands out: a smooth column has no noise to measure it by
FASTEST = 1.0  # K/s over a record, beyond which its time cannot be in seconds
LARGEST_REST = 0.01  # applied rate in °/s that still counts as rest: somewhat more than the earth's, 0.0042 °/s


@dataclass(frozen=True)
class RestData:
    """Runs for a fit at rest, with the columns that they came from and the rows that were left out."""

    runs: tuple[RestRun, ...]
    output: str
    temperature_column: str
    left_out: int
    block_s: float


def drop_spikes(keep: NDArray[np.bool_], *columns: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the rows to keep without those in which a column is contradicted by its neighbours."""
    cleaned = keep.copy()
    for column in columns:
        cleaned &= ~find_spikes(np.where(keep, column, np.nan), LEAST_SPIKE)
    return cleaned


def celsius_range(lowest: float, highest: float) -> tuple[float, float]:
    """Return a fitted range (K) in °C so that the readings at its ends lie inside, whatever rounding kelvin brought."""
    ends = []
    for kelvin, outward in ((lowest, -1.0), (highest, 1.0)):
        exact = kelvin - zero_Celsius
        short = round(exact, 9)
        ends.append(short if abs(short - exact) < 1e-11 else exact + outward * 1e-9)
    return ends[0], ends[1]


def choose_column(records: "Sequence[Record]", candidates: Sequence[str], purpose: str) -> str:
    """Return the first candidate that every record has."""
    for name in candidates:
        if all(name in record for record in records):
            return name
    names = " or ".join(candidates)
    for record in records:
        if not any(name in record for name in candidates):
            raise InputError(f"{record.path}: it has no column {names}, which {purpose} needs in every record.")
    raise InputError(f"{records[0].path}: {purpose} needs the same column in every record: {names}.")


def require_rest(record: "Record", why: str) -> None:
    """Refuse a record of a gyro that turned."""
    if "rate_deg_per_s" in record and np.any(np.abs(record["rate_deg_per_s"]) > LARGEST_REST):
        raise InputError(f"{record.path or 'record'}: rate_deg_per_s is not zero; {why}")


def gather_rest(records: "Sequence[Record]", outputs: "dict[str, float]") -> RestData:
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
            raise InputError(f"{record.path}: no rows with both {output} and {column}; the temperature is missing.")
        time, values, temperature = time[complete], values[complete], temperature[complete]
        if len(time) > MOST_ROWS:
            width = math.ceil((time[-1] - time[0]) / MOST_ROWS * 10) / 10
            blocks = average_blocks(time, {"output": values, "temperature": temperature}, width)
            time, values, temperature = blocks.time, blocks.columns["output"], blocks.columns["temperature"]
            widest = max(widest, width)
        runs.append(RestRun(time, values * outputs[output], temperature + zero_Celsius))
    return RestData(tuple(runs), output, column, left_out, widest)


def check_seconds(where: str, time: NDArray[np.float64], temperature: NDArray[np.float64]) -> None:
    """Refuse a record whose temperature changes as no chamber's does: its time is in another unit."""
    known = temperature[np.isfinite(temperature)]
    lasts = float(np.ptp(time))
    if known.size and np.subtract(*np.percentile(known, [95, 5])) > FASTEST * max(lasts, 1e-9):
        raise InputError(
            f"{where}: the temperature changes by {np.ptp(known):.3g} K within {lasts:.3g} s, faster than any chamber."
            " time_s must be in seconds: is it in minutes or hours?"
        )
