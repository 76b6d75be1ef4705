"""What records say, made ready for a fit: rows that are predicted, blocks that are compared, spikes left out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.decimation import average_groups, bend_of_means
from compensation.noise import white_rms
from compensation.spikes import find_spikes
from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.record import TABLE_COLUMNS, Record, Run, place_in_time, read_frequency_table, reading_resolution
from studies.simulation.drive import COLUMN, Drive, drive_by_record
from studies.simulation.holes import each_part

Rows = NDArray[np.intp]
RESPONSES = ("frequency_Hz", "bias_deg_per_h", "inverse_q")
QUADRATURE = "quadrature_V"
"""A response of cards with loops."""
HOUSING = "housing_temperature_degC"
SETTLED = "settled_frequency_Hz"
"""Frequencies of steady-state tables."""
UNITS = {"frequency_Hz": "Hz", "bias_deg_per_h": "°/h", "inverse_q": "1", QUADRATURE: "V", HOUSING: "K", SETTLED: "Hz"}
WORDS = {
    "frequency_Hz": "frequency",
    "bias_deg_per_h": "zero-rate output",
    "inverse_q": "1/Q",
    QUADRATURE: "quadrature control",
    HOUSING: "housing temperature",
    SETTLED: "settled frequency",
}
MOST_ROWS = 2000  # of a run that are predicted
MOST_BLOCKS = 240  # of a run that are compared
PERIOD = 90.0  # ° of azimuth, of what a turning wave of n = 2 meets
ROWS_PER_PERIOD, BLOCKS_PER_PERIOD = 120, 6  # of that; the mean over a row is then within 1e-4 of its middle
TURNED_MOST = 10  # times as many rows, and three times as many blocks, for waves that turn often
LEAST_ROWS = 10
LONGEST_HOLE = 30 * 86400.0  # s, in one run
MOST_KINKS = 24  # of a run
LEAST_KINK = 1e-3  # K
THERMOMETER = 0.3  # K, error of a settled temperature that nothing else tells
LEAST_NOISE = 1e-9  # of a frequency that is not rounded
NEIGHBOURS = 4.0  # residual over what neighbouring temperatures leave that is no noise: 1 in 1000 of pure noise
FEW = 8  # rows that do not show it
LEAST_SCATTER = 1e-5  # of a frequency, where nothing else tells


@dataclass(frozen=True)
class BlockMeans:
    """Means of one column over blocks of rows."""

    rows: Rows  # of the run's predicted rows, those with a value that is no spike
    edges: Rows  # where each block begins in `rows`
    counts: Array  # array, values in each block
    # time, value: arrays, means
    time: Array
    value: Array
    spikes: int  # number of values left out
    predicted: Array  # array, times of the predicted rows, s
    width: Array  # array, standard deviation of the times of the record's rows that each of these is the mean of, s

    def average(self, column: Array) -> Array:
        """Means of a predicted column over the same values, along the first axis; of a row that is a mean itself, of the curve behind it."""
        if self.width.any():
            column = column + bend_of_means(self.predicted, column, self.width)
        total = np.add.reduceat(column[self.rows], self.edges, axis=0)
        return np.asarray(total / self.counts.reshape(-1, *[1] * (total.ndim - 1)))

    def until(self, end: float) -> "BlockMeans":
        """Return those blocks alone whose middle is not after `end` (s)."""
        count = int(np.searchsorted(self.time, end, side="right"))
        rows = self.rows[: self.edges[count]] if count < len(self.edges) else self.rows
        of_block = {name: getattr(self, name)[:count] for name in ("edges", "counts", "time", "value")}
        return replace(self, rows=rows, **of_block)

    @property
    def span(self) -> Array:
        """Seconds of each block that have values."""
        return np.asarray(self.counts * float(np.median(np.diff(self.predicted))))


@dataclass(frozen=True)
class ObservedRun:
    """One run."""

    record: Record  # as read
    inner: Drive  # drives frequency, bias and 1/Q: by the measured housing, else by the chamber
    outer: Drive | None  # where both are measured: the chamber, which drives the housing
    # Blocks of every response that was measured, the housing among them where it has an outer drive.
    responses: Mapping[str, BlockMeans]
    # Rows of the measured housing's profile before which its chamber jumped or a hole is, and how far (K) the housing
    # may have been from the straight line midway between them.
    kinks: Mapping[int, float] = field(default_factory=dict)

    @cached_property
    def own_rows(self) -> Mapping[str, tuple[Array, Array]]:
        """Of every response the record's own rows that have a value and no spike: seconds since the first row, and values."""
        since, found = self.record["time_s"] - self.record["time_s"][0], {}
        for name in self.responses:
            own = self.record[name]
            good = np.isfinite(own) & ~find_spikes(own)
            found[name] = (since, own) if good.all() else (since[good], own[good])
        return found

    def explaining(self, names: Sequence[str]) -> "ObservedRun":
        """Return it with some responses alone; without the housing among them the chamber drives nothing."""
        kept = {name: own for name, own in self.responses.items() if name in names}
        return replace(self, outer=self.outer if HOUSING in names else None, responses=kept)


@dataclass(frozen=True)
class SettledTable:
    """A steady-state table: temperatures (K) and frequencies (Hz), with the step of its readings (Hz)."""

    path: str
    temperature: Array
    frequency: Array
    resolution: float

    def repeats(self, other: "SettledTable") -> bool:
        """Return whether another table has the same rows."""
        return np.array_equal(self.temperature, other.temperature) and np.array_equal(self.frequency, other.frequency)

    @property
    def middled(self) -> Array:
        """Temperatures from their middle, K."""
        return np.asarray(self.temperature - 0.5 * (self.temperature.min() + self.temperature.max()))

    def averaged(self, most: int) -> "SettledTable":
        """Return it with neighbouring rows averaged where it has more than so many."""
        group = np.arange(len(self.frequency)) // -(-len(self.frequency) // most)
        T, f = (average_groups(column, group) for column in (self.temperature, self.frequency))
        return replace(self, temperature=T, frequency=f)

    @property
    def rounding(self) -> float:
        """Noise of the last digit, Hz; of readings without rounding that of the computer's digits."""
        return max(self.resolution / float(np.sqrt(12.0)), LEAST_NOISE * float(np.abs(self.frequency).max()))

    @property
    def scatter(self) -> float:
        """Largest noise that its readings can have, Hz: what they leave of their own parabola, or 0.3 K of the thermometer."""
        f, degree = self.frequency, min(2, len(np.unique(self.temperature)) - 1)
        free = len(f) - degree - 1
        if degree == 2 and free > 1:
            rest, _ = self.beside_parabola(f)
            return max(float(np.sqrt(rest @ rest / free)), self.rounding)
        rise = float(np.ptp(f) / np.ptp(self.temperature)) if degree > 0 else 0.0
        return max(THERMOMETER * rise, LEAST_SCATTER * float(np.median(f)), self.rounding)

    def between_neighbours(self, left: Array) -> float:
        """Return the white noise that residuals of neighbouring temperatures show, Hz; few rows do not show it."""
        ordered = left[np.argsort(self.temperature, kind="stable")]
        return max(white_rms(ordered), self.rounding) if left.size > FEW else np.inf

    def beside_parabola(self, values: Array) -> tuple[Array, Array]:
        """Return what a parabola leaves of values of the rows, and the leverage h of each."""
        own = np.linalg.qr(np.vander(self.middled / np.ptp(self.temperature), 3)).Q
        return values - own @ (own.T @ values), np.sum(own**2, axis=1)


def read_settled(table: Run) -> SettledTable:
    """Read a steady-state table (HRG paper, Table 1)."""
    columns = read_frequency_table(table)
    T, f = (columns.values[name] for name in TABLE_COLUMNS)
    return SettledTable(columns.path, T + zero_Celsius, f, reading_resolution(f))


def observe(
    records: Sequence[Record], responses: Sequence[str] = RESPONSES, *, turning: bool = False, blocks: int = MOST_BLOCKS
) -> tuple[ObservedRun, ...]:
    """Make runs ready; `turning` are those of a whole-angle wave, each row's the mean to the next; `blocks` of a run are compared at most."""
    starts, _ = place_in_time(records)
    return tuple(
        _observe(record, start, responses, turning, blocks) for record, start in zip(records, starts, strict=True)
    )


def _observe(record: Record, start: float, named: Sequence[str], turning: bool, most: int) -> ObservedRun:
    _check_holes(record)
    periods = _periods(record)
    fewest = min(MOST_ROWS, MOST_ROWS * most // MOST_BLOCKS)
    most_rows = int(np.clip(ROWS_PER_PERIOD * periods, fewest, TURNED_MOST * fewest))
    most_blocks = int(np.clip(BLOCKS_PER_PERIOD * periods, most, 3 * most))
    time, width, columns = _fine_rows(record, (*named, HOUSING), most_rows)
    if len(time) < LEAST_ROWS:
        raise InputError(
            f"{record.path}: has {len(time)} of the {LEAST_ROWS} rows that a run needs at least; give a longer record."
        )
    centre = time + 0.5 * float(np.median(np.diff(record["time_s"]))) if turning else time
    inner = replace(drive_by_record(record, time=np.minimum(centre, record["time_s"][-1])), start=start)
    outer = None
    if inner.boundary == "housing" and COLUMN["chamber"] in record and np.isfinite(record[COLUMN["chamber"]]).sum() > 1:
        outer = replace(drive_by_record(record, "chamber", time=time), start=start)
    wanted = [name for name in named if name in columns] + ([HOUSING] if outer is not None else [])
    responses = {
        name: blocks for name in wanted if (blocks := _block(time, width, columns[name], most_blocks)) is not None
    }
    if not any(name in responses for name in named):
        raise InputError(f"{record.path}: none of {', '.join(named)} has values; there is nothing to calibrate with.")
    kinks = {} if outer is None else _find_kinks(inner, outer)
    return ObservedRun(record, inner, outer, responses, kinks | each_part(inner.holes))


def _check_holes(record: Record) -> None:
    """Refuse a run whose clock leaps by more than anybody records."""
    apart = np.diff(record["time_s"])
    if apart.size and apart.max() > LONGEST_HOLE:
        k = int(np.argmax(apart))
        raise InputError(
            f"{record.path}: time_s leaps by {apart[k] / 86400:.3g} days after {record['time_s'][k]:.6g} s (row {k + 1});"
            " split the record there, each run a file of its own, or correct its clock."
        )


def _find_kinks(inner: Drive, outer: Drive) -> dict[int, float]:
    """Rows of the housing's profile before which the chamber jumped, and a quarter of how its slope changes there."""
    t, T = inner.profile.time, inner.profile.value
    bend = np.abs(np.diff(T, 2, prepend=T[0], append=T[-1]))
    after = [k for at in outer.profile.jumps if 1 < (k := int(np.searchsorted(t, at))) < len(t) - 1]
    sizes = {k: float(bend[k - 2 : k + 2].max()) / 4 for k in after[:MOST_KINKS]}
    return {k: size for k, size in sizes.items() if size > LEAST_KINK}


def _periods(record: Record) -> float:
    """How many periods of a standing wave's azimuth a run goes through."""
    if "pattern_angle_deg" not in record:
        return 0.0
    return float(np.nansum(np.abs(np.diff(record["pattern_angle_deg"])))) / PERIOD


def _fine_rows(record: Record, named: Sequence[str], most: int) -> tuple[Array, Array, dict[str, Array]]:
    """Rows to predict: those of the record, of very many rows the means of groups of equal duration, and how wide these are."""
    time = record["time_s"]
    names = [name for name in named if name in record]
    if len(time) <= most:
        return time, np.zeros(len(time)), {name: record[name] for name in names}
    width = float(np.ptp(time)) / most
    group = np.minimum(((time - time[0]) / width).astype(np.intp), most - 1)
    present = np.unique(group)
    columns = {}
    for name in names:
        values = record[name]
        keep = np.isfinite(values) & ~find_spikes(values)
        if not keep.any():
            columns[name] = np.full(len(present), np.nan)
            continue
        # what is missing of a group is on the line between its neighbours: else its mean would be of another moment
        whole = average_groups(np.interp(time, time[keep], values[keep]), group)[present]
        columns[name] = np.where(np.bincount(group[keep], minlength=most)[present] > 0, whole, np.nan)
    middle = average_groups(time, group)
    variance = average_groups((time - middle[group]) ** 2, group)
    return middle[present], np.sqrt(variance[present]), columns


def _block(time: Array, grouped: Array, column: Array, most: int) -> BlockMeans | None:
    keep = np.isfinite(column)
    if np.count_nonzero(keep) < LEAST_ROWS:
        return None
    spikes = find_spikes(column)
    rows = np.flatnonzero(keep & ~spikes)
    width = max(float(np.ptp(time)) / most, 1e-9)
    group = ((time[rows] - time[0]) / width).astype(np.intp)
    edges = np.flatnonzero(np.diff(group, prepend=-1) > 0)
    counts = np.diff(np.append(edges, len(rows))).astype(float)

    def mean(values: Array) -> Array:
        return np.asarray(np.add.reduceat(values, edges) / counts)

    middle = float(np.median(column[rows]))
    return BlockMeans(
        rows,
        edges,
        counts,
        mean(time[rows]),
        middle + mean(column[rows] - middle),
        int(spikes.sum()),
        time,
        grouped,
    )
