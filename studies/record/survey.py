"""A record looked at without a card and without a fit: every column's range, faults, steps, spectrum and noise; nothing is changed."""

from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil, sqrt

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from compensation.arrays import Array
from compensation.decimation import average_groups
from compensation.errors import CompensationError
from compensation.lines import Line, find_line
from compensation.noise import white_rms
from compensation.samples import is_regular
from compensation.spikes import NEIGHBOURS, find_dropouts, find_spikes, find_step, find_stuck
from studies.files.stored import portions
from studies.progress import told
from studies.record import COMMANDED, Record
from studies.record.rest import LEAST_SPIKE
from studies.record.settled import LEAST, TEMPERATURES, Soak, find_holds, find_soaks
from studies.record.stability import Stability, read_stability, unbroken
from studies.record.steps import Step, find_steps
from studies.reports.columns import find_gaps

CONFIDENCE = 0.9
FEWEST = 64  # values of a column that has a spectrum and an Allan deviation
MOST = 20_000  # means that steps, lines and correlations are found in
BRIDGED = 3  # rows: a hole up to the next is drawn across
SEGMENTS = 8  # of a series, whose periodograms are averaged
MOST_FREQUENCIES = 4096
CHANGES = 200  # means of a record, between which changes are correlated


@dataclass(frozen=True)
class Density:
    """One-sided spectral density, unit²/Hz, over frequency (Hz); `even`: of even rows (Welch), else of uneven ones (Lomb)."""

    frequency: Array
    density: Array
    even: bool


@dataclass(frozen=True)
class ColumnRange:
    """What is in a column: its ends, what its readings were rounded to (0: nothing that shows), missing values and gaps, (k, 2)."""

    name: str
    low: float
    high: float
    resolution: float
    missing: int
    gaps: Array

    def as_row(self) -> dict[str, float | int | str | None]:
        """Return it as a row of a table."""
        longest = float(np.ptp(self.gaps, axis=1).max()) if len(self.gaps) else None
        return {
            "column": self.name, "low": self.low, "high": self.high, "resolution": self.resolution or None,
            "missing": self.missing, "gaps": len(self.gaps), "longest_gap_s": longest,
        }  # fmt: skip


@dataclass(frozen=True)
class ColumnSurvey:
    """What one column shows; `stability` and `density` are None where it is constant or short."""

    range: ColumnRange
    mean: float = np.nan
    spikes: int = 0
    stuck: int = 0
    zeros: int = 0
    steps: tuple[Step, ...] = ()
    line: Line | None = None
    white: float = 0.0  # Allan deviation at 1 s of the white noise that second differences show, rounding at least
    stability: Stability | None = None
    density: Density | None = None

    @property
    def name(self) -> str:
        """The column."""
        return self.range.name

    @property
    def varies(self) -> bool:
        """Whether it has two values."""
        return self.range.high > self.range.low


@dataclass(frozen=True)
class Survey:
    """What one record shows."""

    record: Record
    step: float
    even: bool
    columns: tuple[ColumnSurvey, ...]
    settled: tuple[Soak, ...]  # soaks, or where the temperature is held where there is no frequency (NaN)
    correlations: tuple[dict[str, str | float | None], ...]  # `one`, `two`, of their `values`, `changes`


def survey_record(record: Record) -> Survey:
    """Look at every column of a record."""
    time = record["time_s"]
    names = [name for name in record.columns if name != "time_s"]
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    looked = told(names, f"looking at {record.path}")
    columns = tuple(survey_column(name, time, record[name]) for name in looked)
    varying = [column.name for column in columns if column.varies]
    return Survey(
        record,
        step,
        len(time) > 2 and is_regular(time),
        columns,
        _find_settled(record),
        tuple(_correlate(time, one, record[one], two, record[two]) for one, two in combinations(varying, 2)),
    )


def find_range(name: str, values: Array, time: Array | None = None) -> ColumnRange:
    """Look at what is in a column, and over time at its gaps."""
    low, high, missing, some = np.inf, -np.inf, 0, np.empty(0)
    for k in portions(len(values)):
        part = values[k]
        y = part[np.isfinite(part)]
        missing += part.size - y.size
        low, high = float(np.min(y, initial=low)), float(np.max(y, initial=high))
        some = np.append(some, y[: MOST - some.size])
    gaps = find_gaps(time, values) if time is not None else np.empty((0, 2))
    step = find_step(some)
    places = (some - some[0]) / step if step else some
    rounded = step > 0 and bool(np.max(np.abs(places - np.round(places))) < 0.01)
    low, high = (low, high) if low <= high else (np.nan, np.nan)
    return ColumnRange(name, low, high, step if rounded else 0.0, missing, gaps)


def survey_column(name: str, time: Array, values: Array) -> ColumnSurvey:
    """Look at one column."""
    own, known = find_range(name, values, time), np.isfinite(values)
    if not known.any():
        return ColumnSurvey(own)
    y, spikes = values[known], find_spikes(values, LEAST_SPIKE)
    stuck = int(find_stuck(values).sum()) if name not in COMMANDED else 0
    found = ColumnSurvey(own, float(y.mean()), int(spikes.sum()), stuck, int(find_dropouts(values).sum()))
    if len(y) < FEWEST or not found.varies:
        return found
    clean = np.where(spikes, np.nan, values)
    t, thin, width = average_evenly(time, clean)
    rounding = 0.0 if name in COMMANDED else own.resolution / sqrt(12)
    try:
        spacing, series = unbroken(time, {name: clean}, spikes_left_out=True)
        stability = read_stability(series[name], spacing, CONFIDENCE)
    except CompensationError:  # too short, or nothing but one value between the gaps
        stability = None
    return replace(
        found,
        steps=find_steps(t, thin),
        line=find_line([(t, thin)], width, float(t[-1] - t[0]) / 20) if is_regular(t) else None,
        white=max(white_rms(y), rounding) * float(np.sqrt(np.median(np.diff(time[known])))),
        stability=stability,
        density=find_density(time, clean),
    )


def average_evenly(time: Array, values: Array, most: int = MOST) -> tuple[Array, Array, float]:
    """Return known values as they are, or their means over `most` equal parts of the time where there are more; times and width (s)."""
    known = np.isfinite(values)
    t, y = time[known], values[known]
    if len(t) <= most:
        return t, y, float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    if is_regular(t):
        rows = ceil(len(t) / most)
        t, y = (x[: len(x) // rows * rows].reshape(-1, rows).mean(axis=1) for x in (t, y))
        return t, y, float(t[1] - t[0])
    width = float(t[-1] - t[0]) / most
    part = np.minimum(((t - t[0]) / width).astype(np.intp), most - 1)
    filled = np.bincount(part, minlength=most) > 0
    return average_groups(t, part, most)[filled], average_groups(y, part, most)[filled], width


def find_density(time: Array, values: Array) -> Density | None:
    """Return the spectral density of a column, its mean and slope taken off: Welch's of even rows, gaps left out, Lomb's of uneven ones."""
    known = np.isfinite(values)
    t, y = time[known], values[known]
    step = float(np.median(np.diff(t)))
    place = (t - t[0]) / step if step > 0 else np.zeros(1)
    rows = np.rint(place).astype(np.intp)
    if step > 0 and rows[-1] < 2 * len(t) and np.max(np.abs(place - rows * (place[-1] / rows[-1]))) < 0.01:
        step = float(t[-1] - t[0]) / rows[-1]
        grid = np.arange(rows[-1] + 1)
        near = np.diff(rows, prepend=0)[np.searchsorted(rows, grid)] <= BRIDGED
        even = np.where(near, np.interp(grid, rows, y), np.nan)
        length = max(FEWEST, 2 * len(even) // (SEGMENTS + 1))
        while True:
            parts = sliding_window_view(even, min(length, len(even)))[:: length - length // 2]
            parts = parts[np.isfinite(parts).all(axis=1)]
            if 2 * parts.size > len(y) or length <= FEWEST:
                break
            length //= 2
        if parts.size:
            return _average_periodograms(parts, step)
    t, y, _ = average_evenly(time, values, MOST_FREQUENCIES)
    y = y - np.polyval(np.polyfit(t - t[0], y, 1), t - t[0])
    f = np.linspace(1.0, len(y) // 2, len(y) // 2) / float(t[-1] - t[0])
    power = scipy.signal.lombscargle(t - t[0], y, 2 * np.pi * f)
    return _thin_out(f, 2 * float(t[-1] - t[0]) / len(y) * power, even=False)


def _average_periodograms(parts: Array, step: float) -> Density:
    """Return the mean over parts of a series (rows of equal length), each under Hann's window, its mean and slope taken off."""
    x = np.arange(parts.shape[1]) - (parts.shape[1] - 1) / 2
    window = np.cos(np.pi * (x - 0.5) / len(x)) ** 2  # scipy.signal takes 0.4 s to load
    rests = parts - parts.mean(axis=1)[:, None] - np.outer(parts @ x / (x @ x), x)
    S = step / (window @ window) * np.mean(np.abs(np.fft.rfft(rests * window)) ** 2, axis=0)
    S[1 : (len(x) + 1) // 2] *= 2
    return _thin_out(np.fft.rfftfreq(len(x), step)[1:].astype(float), S[1:], even=True)


def _thin_out(frequency: Array, density: Array, even: bool) -> Density:
    """Return means over as many parts of the logarithm of the frequency as can be drawn."""
    part = np.unique(np.round(np.log(frequency / frequency[0]) * 60).astype(np.intp), return_inverse=True)[1]
    # no differences from the first value, as in `average_groups`: it may be 1e20 times the others
    return Density(average_groups(frequency, part), np.bincount(part, density) / np.bincount(part), even)


def _find_settled(record: Record) -> tuple[Soak, ...]:
    column = next((name for name in TEMPERATURES if name in record), None)
    if column is None or not np.isfinite(record[column]).any():
        return ()
    both = (
        np.isfinite(record[column]) & np.isfinite(record["frequency_Hz"]) if "frequency_Hz" in record else np.zeros(1)
    )
    if np.count_nonzero(both) >= NEIGHBOURS:
        return tuple(soak for soak in find_soaks([record]) if not soak.extrapolated_K)
    t, T, _ = average_evenly(record["time_s"], record[column])
    least = max(LEAST, 0.02 * (t[-1] - t[0]))
    whole = [(t[rows], float(T[rows].mean())) for rows in find_holds(T) if t[rows[-1]] - t[rows[0]] >= least]
    unknown = (np.nan,) * 4
    return tuple(Soak(record.path, float(times[0]), float(times[-1]), mean, *unknown) for times, mean in whole)


def _correlate(time: Array, one: str, x: Array, two: str, y: Array) -> dict[str, str | float | None]:
    both = np.isfinite(x) & np.isfinite(y)
    columns = [average_evenly(time[both], values[both], CHANGES)[1] for values in (x, y)]
    return {
        "one": one, "two": two, "values": _correlation(*columns), "changes": _correlation(*map(np.diff, columns)),
    }  # fmt: skip


def _correlation(x: Array, y: Array) -> float | None:
    x, y = x - x.mean() if len(x) else x, y - y.mean() if len(y) else y
    size = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / size if size > 0 and len(x) > 2 else None
