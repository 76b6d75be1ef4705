"""One measured run: frequency and housing temperature in time, and the same on even rows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensation.decimation import average_groups
from thermal.errors import ThermalError
from thermal.network import Array

Rows = NDArray[np.intp]
LEAST_ROWS = 30


@dataclass(frozen=True)
class HousingRun:
    """Columns of a run as measured; not-a-number marks a missing value."""

    time: Array  # array (N,), s, increasing
    frequency: Array  # array (N,), Hz
    housing_temperature: Array  # array (N,), K

    def __post_init__(self) -> None:
        columns = [np.asarray(c, dtype=float) for c in (self.time, self.frequency, self.housing_temperature)]
        if len({column.shape for column in columns}) > 1 or columns[0].ndim != 1:
            raise ThermalError("time, frequency and housing temperature of a run need the same number of rows.")
        for name, column in zip(("time", "frequency", "housing_temperature"), columns, strict=True):
            object.__setattr__(self, name, column)
        if not np.isfinite(self.time).all():
            raise ThermalError("the time of a run has a missing value.")
        back = np.flatnonzero(np.diff(self.time) <= 0)
        if back.size:
            k = int(back[0])
            raise ThermalError(
                f"the time of a run must increase; row {k + 2} ({self.time[k + 1]:g} s) follows {self.time[k]:g} s."
            )
        if np.any(self.housing_temperature <= 0):
            raise ThermalError("the housing temperature of a run is in kelvin and must be above 0.")


@dataclass(frozen=True)
class EvenRun:
    """A run averaged onto even rows."""

    # time, housing_temperature: arrays (M,), s and K, even and without holes
    time: Array
    housing_temperature: Array
    rows: Rows  # array (K,), the rows at which the frequency is known
    # frequency_time, frequency: arrays (K,), mean time (s) and mean (Hz) of the samples of these rows
    frequency_time: Array
    frequency: Array
    breaks: Rows  # array, places in `rows` at which a new stretch begins after a hole
    warnings: tuple[str, ...]  # what was missing


def row_step(runs: Sequence[HousingRun], most: int) -> float:
    """Distance (s) of even rows that suits all runs: at most `most` of them, none finer than the finest run."""
    if min(len(run.time) for run in runs) < 2:
        raise ThermalError("one row cannot determine time constants.")
    finest = min(float(np.median(np.diff(run.time))) for run in runs)
    wanted = max(float(np.ptp(run.time)) for run in runs) / (most - 1)
    # A whole number of samples in every row: with one sample more here than there the rows' mean times would jitter.
    return finest * max(1.0, float(np.ceil(wanted / finest - 1e-9)))


def even_rows(run: HousingRun, step: float) -> EvenRun:
    """Average a run onto even rows `step` (s) apart; holes in the frequency stay, in the temperature they are bridged.

    Averaging commutes with linear lags, so only the law's curvature sees the width of a row, in second order.
    """
    half_sample = min(float(np.median(np.diff(run.time))), step) / 2
    row = ((run.time - run.time[0] + half_sample) // step).astype(np.intp)
    count = int(row[-1]) + 1
    if count < LEAST_ROWS:
        raise ThermalError(f"a run needs at least {LEAST_ROWS} rows, not {count}.")
    known_f, known_T = np.isfinite(run.frequency), np.isfinite(run.housing_temperature)
    if not known_f.any() or not known_T.any():
        raise ThermalError("a run needs readings of both frequency and housing temperature.")
    members = np.bincount(row, minlength=count)
    full = members == members.max()
    offset = (np.bincount(row, run.time, count)[full] / members[full] - step * np.flatnonzero(full)).mean()
    time = offset + step * np.arange(count)
    _, T = _average(row[known_T], run.housing_temperature[known_T], count)
    places, f = _average(row[known_f], run.frequency[known_f], count)
    T_known = np.flatnonzero(np.isfinite(T))
    f_time = _average(row[known_f], run.time[known_f], count)[1]
    T_time = _average(row[known_T], run.time[known_T], count)[1]
    return EvenRun(
        time=time,
        housing_temperature=np.interp(time, T_time[T_known], T[T_known]),
        rows=places,
        frequency_time=f_time[places],
        frequency=f[places],
        breaks=np.flatnonzero(np.diff(places) > 1) + 1,
        warnings=(
            *_describe_holes(T_known, time, "housing temperature", "a straight line bridges it"),
            *_describe_holes(places, time, "frequency", "those rows are left out"),
        ),
    )


def _average(row: Rows, value: Array, count: int) -> tuple[Rows, Array]:
    mean = average_groups(value, row, count)
    return np.flatnonzero(np.isfinite(mean)), mean


def _describe_holes(places: Rows, time: Array, what: str, mend: str) -> Sequence[str]:
    holes = np.flatnonzero(np.diff(places) > 1)
    if not holes.size:
        return ()
    widths = time[places[holes + 1]] - time[places[holes]]
    k = int(np.argmax(widths))
    return (
        f"the {what} has {holes.size} {'hole' if holes.size == 1 else 'holes'}, the longest of {widths[k]:.6g} s after "
        f"{time[places[holes[k]]]:.6g} s; {mend}.",
    )
