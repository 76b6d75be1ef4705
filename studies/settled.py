"""Settled parts of a record: soaks, each of which becomes one row of a steady-state table, as the HRG paper makes its Table 1.

A moment is settled when what is left of the change, |dT/dt| τ of the sensor and |df/dt| τ over the slope of the frequency,
is small: τ the slowest time constant, about 3 000 s for the gyro of the paper's Figure 3.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensation.decimation import average_blocks
from compensation.errors import CompensationError
from studies.errors import InputError
from studies.record import Record

Array = NDArray[np.float64]
BLOCK = 60.0  # s
REACH = 5  # blocks to either side, over which slopes are taken
LEAST = 600.0  # s, of a soak
USUAL_SLOPE = 8e-5  # 1/K, relative, where a record is too even to show its own
TEMPERATURES = ("housing_temperature_degC", "chamber_temperature_degC")


@dataclass(frozen=True)
class Soak:
    """One settled part.

    Attributes
    ----------
    path : of its record
    start, end : float, s
    temperature_degC, frequency_Hz : float, means
    error_Hz : float, of the mean frequency: its scatter, and what is left to settle
    left_K : float, largest estimate of what is left to settle
    """

    path: str
    start: float
    end: float
    temperature_degC: float
    frequency_Hz: float
    error_Hz: float
    left_K: float


def find_soaks(records: Sequence[Record], time_constant: float = 3000.0, tolerance: float = 0.05) -> tuple[Soak, ...]:
    """Find the settled parts of records.

    Parameters
    ----------
    time_constant : float, s
        Slowest of the gyro.
    tolerance : float, K
        What may be left of a change.

    Raises
    ------
    InputError
        A record without frequency or temperature; a time constant or tolerance that is not positive.
    """
    if not (time_constant > 0 and tolerance > 0):
        raise InputError("a time constant and a tolerance must be positive.")
    return tuple(soak for record in records for soak in _soaks_of(record, time_constant, tolerance))


def settled_table(soaks: Sequence[Soak], where: str) -> tuple[Array, Array, float]:
    """Return temperatures (°C) and frequencies (Hz) of soaks, and the step (Hz) of readings that are as uncertain as theirs.

    Raises
    ------
    InputError
        Fewer than two temperatures that are half a kelvin apart.
    """
    T, f = np.array([s.temperature_degC for s in soaks]), np.array([s.frequency_Hz for s in soaks])
    if np.count_nonzero(np.diff(np.sort(T)) > 0.5) < 1:
        raise InputError(
            f"{where}: {len(soaks)} settled {'part' if len(soaks) == 1 else 'parts'}, where a fit over temperature needs several temperatures; soak longer, or"
            " allow more to be left (--left), or give a shorter --time-constant."
        )
    return T, f, float(np.sqrt(12.0) * max(s.error_Hz for s in soaks))


def _soaks_of(record: Record, time_constant: float, tolerance: float) -> list[Soak]:
    column = next((name for name in TEMPERATURES if name in record), TEMPERATURES[0])
    try:
        blocks = average_blocks(
            record["time_s"], {"T": record[column], "f": record["frequency_Hz"]}, max(BLOCK, float(np.median(np.diff(record["time_s"]))))
        )  # fmt: skip
    except CompensationError as error:
        raise InputError(f"{record.path}: {error}") from None
    t, T, f = blocks.time, blocks.columns["T"], blocks.columns["f"]
    if len(t) < 2 * REACH + 1:
        return []
    span = float(np.ptp(T))
    slope = abs(float(np.polyfit(T - T.mean(), f, 1)[0])) if span > 1.0 else 0.0
    slope = slope or USUAL_SLOPE * float(f.mean())
    left = time_constant * np.maximum(np.abs(_slopes(t, T)), np.abs(_slopes(t, f)) / slope)
    found = []
    for rows in _stretches((left < tolerance) & (np.gradient(t) < 3 * blocks.width)):
        if t[rows[-1]] - t[rows[0]] >= LEAST:
            scatter = float(np.std(np.diff(f[rows]))) / np.sqrt(2.0 * len(rows))
            uncertainty = float(np.hypot(scatter, slope * left[rows].mean()))
            ends, means = (float(t[rows[0]]), float(t[rows[-1]])), (float(T[rows].mean()), float(f[rows].mean()))
            found.append(Soak(record.path, *ends, *means, uncertainty, float(left[rows].max())))
    return found


def _slopes(t: Array, values: Array) -> Array:
    """Slopes of straight lines through each block and its neighbours."""
    slopes = np.empty_like(values)
    for k in range(len(t)):
        near = slice(max(k - REACH, 0), k + REACH + 1)
        x = t[near] - t[near].mean()
        slopes[k] = float(x @ values[near]) / float(x @ x)
    return slopes


def _stretches(settled: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Settled rows, apart where more than some of them together are not: noise interrupts no soak."""
    rows = np.flatnonzero(settled)
    return [part for part in np.split(rows, np.flatnonzero(np.diff(rows) > 2 * REACH) + 1) if len(part)]
