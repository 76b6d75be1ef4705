"""Columns of several loggers, each with its own clock and rate, brought onto the times of one record."""

import datetime
import itertools
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from compensation.decimation import average_groups
from studies.errors import InputError
from studies.importing.channels import read_parts
from studies.importing.clock import drop_repeated, read_times, seconds_between
from studies.importing.doubtful import drop_doubtful, find_repeats
from studies.importing.mapping import OWN, TABLE_TARGETS, ColumnMap, FileMap, LoadedMap
from studies.importing.tables import RawTable
from studies.record import Record, check_plausible

if TYPE_CHECKING:
    import datetime

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LARGEST = 50_000_000  # rows of a regular grid
USUAL_GAP = 10.0  # sampling steps that a gap may have before nothing is interpolated across it


@dataclass(frozen=True)
class ClockedFile:
    """One raw file after its own map: times by its clock, converted columns, and what was changed, in words."""

    file: FileMap
    path: str
    time: "Array"
    origin: "datetime.datetime | None"
    columns: "dict[tuple[str, str], Array]"
    notes: tuple[str, ...]

    @property
    def longest_gap(self) -> float:
        """The longest gap across which values are interpolated, s."""
        if self.file.longest_gap is not None:
            return self.file.longest_gap
        return USUAL_GAP * float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0


def import_records(paths: Sequence[str], import_map: LoadedMap) -> dict[str, Record]:
    """Read raw files, convert and join them into one record, or one for each axis; the comments of the header list every change."""
    series = [read_series(own, file) for own, file in zip(share_out(paths, import_map), import_map.files, strict=True)]
    base = series[0]
    shifts = [shift_between(base, other) for other in series]
    grid = _lay_grid(base, import_map)
    notes = [f"imported with {import_map.path}; all changes are listed here"]
    columns: dict[tuple[str, str], Array] = {}
    for number, (one, shift) in enumerate(zip(series, shifts, strict=True), 1):
        notes += [f"file {number}, {note}" for note in one.notes]
        if number > 1:
            notes.append(f"file {number}, its time 0 is at {shift - float(base.time[0]):.6g} s of the record")
        notes += [f"file {number}, {note}" for note in _report_gaps(one)]
        for column in one.file.columns:
            values = one.columns[column.target, column.axis]
            if one is not base or import_map.step is not None:
                values = resample(one.time + shift, values, grid, column.resample, one.longest_gap)
            columns[column.target, column.axis] = values
            notes.append(_describe(column, values, moved=one is not base or import_map.step is not None))
        if one is not base or import_map.step is not None:
            notes.append(f"file {number}, nothing is interpolated across gaps longer than {one.longest_gap:.6g} s")
    if import_map.step is not None:
        notes.append(f"regular time grid of {import_map.step:g} s")
    start = None if base.origin is None else _later(base.origin, float(grid[0]))
    return {
        axis: Record(
            {"time_s": grid - grid[0], **{name: v for (name, of), v in columns.items() if of in ("", axis)}},
            instrument=" ".join(filter(None, (import_map.instrument, f"axis {axis}" if axis else ""))),
            source=import_map.source,
            start=start,
            comments=tuple(" ".join(note.split()) for note in notes),
        )
        for axis in import_map.axes
    }


def import_table(path: str, import_map: LoadedMap) -> "tuple[dict[str, Array], tuple[str, ...]]":
    """Read settled readings, temperature (°C) and frequency (Hz), in the order of the file, and what was changed; incomplete rows go."""
    (file,) = import_map.files
    with closing(read_parts([path], file)) as table:
        columns = {column.target: convert(table, column) for column in file.columns}
        empty = _report_empty(table, file)
    whole = np.all([np.isfinite(values) for values in columns.values()], axis=0)
    if not whole.any():
        raise InputError(f"{path}: no row has both {' and '.join(columns)}.")
    notes = [
        f"imported with {import_map.path}; all changes are listed here",
        f"{_name_files(table)}, {int(whole.sum())} of {len(whole)} rows",
        *empty,
        *(_describe(column, columns[column.target], moved=False) for column in file.columns),
    ]
    notes += [f"source: {import_map.source}"] if import_map.source else []
    return {name: columns[name][whole] for name in TABLE_TARGETS}, tuple(" ".join(note.split()) for note in notes)


def share_out(paths: Sequence[str], import_map: LoadedMap) -> list[Sequence[str]]:
    """Return the raw files of each [[file]] of the map: one, `parts` that continue one another, or all of a single one."""
    files = import_map.files
    alone = sum(not file.same_file for file in files) == 1
    counts = [0 if file.same_file else file.parts or (len(paths) if alone else 1) for file in files]
    if sum(counts) != len(paths):
        raise InputError(
            f"{import_map.path}: describes {sum(counts)} raw files, but {len(paths)} are given ('parts' in a [[file]] is"
            " its number of consecutive files)."
        )
    ends = list(itertools.accumulate(counts))
    own = [paths[end - count : end] for end, count in zip(ends, counts, strict=True)]
    return [own[max(k for k in range(place + 1) if counts[k])] for place in range(len(own))]


def _report_gaps(one: ClockedFile) -> list[str]:
    """Say where the sampling of a file has gaps."""
    steps = np.diff(one.time)
    if not len(steps):
        return []
    gaps = np.flatnonzero(steps > one.longest_gap)
    usual = f"{len(one.time)} rows, usually {float(np.median(steps)):.6g} s apart"
    if not len(gaps):
        return [f"{usual}; no gap longer than {one.longest_gap:.6g} s"]
    longest = int(gaps[np.argmax(steps[gaps])])
    return [
        f"{usual}; {len(gaps)} {'gap' if len(gaps) == 1 else 'gaps'} longer than {one.longest_gap:.6g} s, {float(steps[gaps].sum()):.6g} s together, the"
        f" longest of {float(steps[longest]):.6g} s after {float(one.time[longest] - one.time[0]):.6g} s"
    ]


def read_series(paths: Sequence[str], file: FileMap) -> ClockedFile:
    """Read a raw file, or several that continue one another: clock corrected, columns converted, rows without a time left out."""
    with closing(read_parts(paths, file)) as table:
        clock = read_times(table, file)
        columns = {(column.target, column.axis): convert(table, column) for column in file.columns}
        empty = _report_empty(table, file)
    repeated, told = find_repeats(table, clock.seconds, columns)
    times, rows = drop_repeated(table, clock, file, repeated)
    for column in file.columns:
        place = column.target, column.axis
        kept = columns[place] if len(rows) == table.rows else columns[place][rows]
        columns[place], found = drop_doubtful(column, kept)
        told += found
    _check_lone_values(table, columns, rows)
    notes = (f"{_name_files(table)}, {len(rows)} rows {_name_clock(file)}", *times.notes, *empty, *told)
    return ClockedFile(file, table.path, times.seconds, times.origin, columns, notes)


def _name_files(table: RawTable) -> str:
    return " then ".join(f"{' '.join(part.path.split())}, sha256 {part.sha256}" for part in table.parts)


def _name_clock(file: FileMap) -> str:
    if file.time_format == OWN:
        return "by the file's own clock"
    if file.sample_period is not None:
        return f"without a time, {file.sample_period!r} s apart"
    return f"from '{' '.join(file.time)}' ({file.time_format})"


def _report_empty(table: RawTable, file: FileMap) -> list[str]:
    kinds = "an instrument's overload", "0, a dropout"
    counts = {
        column.source: (
            table.count_overloads(column.source),
            int(np.count_nonzero(_reading(table, column) == 0)) if column.conversion.never_zero else 0,
        )
        for column in file.columns
    }
    return [
        f"{count[kind]} {'reading' if count[kind] == 1 else 'readings'} of '{name}' {'is' if count[kind] == 1 else 'are'} {what}: left empty"
        for kind, what in enumerate(kinds)
        for name, count in counts.items()
        if count[kind]
    ]


def _reading(table: RawTable, column: ColumnMap) -> "Array":
    return np.asarray(table.numbers(column.source) * column.scale + column.offset)


def convert(table: RawTable, column: ColumnMap) -> "Array":
    """Return a raw column in the unit of the record: sign × unit(reading × scale + offset)."""
    reading = _reading(table, column)
    if column.conversion.never_zero:
        reading[reading == 0] = np.nan
    values = column.sign * column.conversion.convert(reading, *column.settings)
    check_plausible({column.target: values}, lambda row: f"{table.place(row)}, '{column.source}'")
    return np.asarray(values, dtype=float)


def resample(time: "Array", values: "Array", grid: "Array", how: str, longest_gap: float) -> "Array":
    """Return values at the times of the grid, NaN outside and within gaps: linear, the mean of nearer samples, the nearest, the previous."""
    known = np.isfinite(values)
    t, v = time[known], values[known]
    if not len(t):
        return np.full(len(grid), np.nan)
    after = np.searchsorted(t, grid)
    left, right = np.clip(after - 1, 0, len(t) - 1), np.clip(after, 0, len(t) - 1)
    if how == "previous":
        held = np.searchsorted(t, grid, side="right") - 1
        return np.where(held >= 0, v[np.clip(held, 0, None)], np.nan)
    if how == "mean":
        return _bin_means(t, v, grid)
    if how == "nearest":
        nearest = np.where(abs(grid - t[left]) <= abs(t[right] - grid), left, right)
        return np.where(abs(t[nearest] - grid) <= longest_gap / 2, v[nearest], np.nan)
    exact = t[right] == grid
    reachable = exact | ((after > 0) & (after < len(t)) & (t[right] - t[left] <= longest_gap))
    return np.where(reachable, np.interp(grid, t, v), np.nan)


def _bin_means(t: "Array", v: "Array", grid: "Array") -> "Array":
    if len(grid) < 2:
        return np.full(len(grid), float(np.mean(v)))
    middles = (grid[1:] + grid[:-1]) / 2
    edges = np.concatenate([[grid[0] - (middles[0] - grid[0])], middles, [grid[-1] + (grid[-1] - middles[-1])]])
    which = np.searchsorted(edges, t, side="right") - 1
    inside = (which >= 0) & (which < len(grid))
    return average_groups(v[inside], which[inside], len(grid))


def _lay_grid(base: ClockedFile, import_map: LoadedMap) -> "Array":
    """Return the times of the record by the first file's clock: its own, or a regular grid over its range."""
    if import_map.step is None:
        return base.time
    count = np.floor((base.time[-1] - base.time[0]) / import_map.step) + 1
    if not count <= LARGEST:
        raise InputError(
            f"{import_map.path}: step_s = {import_map.step:g} makes {count:.3g} rows, more than the limit of {LARGEST:,}; increase step_s."
        )
    return np.asarray(base.time[0] + import_map.step * np.arange(int(count)))


def shift_between(base: ClockedFile, other: ClockedFile) -> float:
    """Return what must be added to the other file's times to bring them onto the first file's clock."""
    if base.origin is None and other.origin is None:
        return 0.0
    if base.origin is None or other.origin is None:
        lost = base if base.origin is None else other
        raise InputError(
            f"{lost.path}: its clock counts from 0 while another file has dates; give the time at which it started ('start' in the map)."
        )
    shift = seconds_between(base.origin, other.origin, other.path)
    first, last = other.time[0] + shift, other.time[-1] + shift
    if other is not base and (last < base.time[0] or first > base.time[-1]):
        raise InputError(
            f"{other.path}: is entirely {'before' if last < base.time[0] else 'after'} {base.path} (from {first - base.time[0]:g}"
            f" to {last - base.time[0]:g} s of the record); check the dates, 'start' and clock_offset_s."
        )
    return shift


def _check_lone_values(table: RawTable, columns: "dict[tuple[str, str], Array]", rows: "NDArray[np.intp]") -> None:
    """Refuse a file whose mapped columns hold no value at all."""
    for (name, _), values in columns.items():
        if not np.isfinite(values).any():
            raise InputError(f"{table.path}: the column for {name} holds no value in any of the {len(rows)} rows.")


def _describe(column: ColumnMap, values: "Array", moved: bool) -> str:
    unit = column.conversion
    steps = [f"x = '{column.source}'" + (f" (axis {column.axis})" if column.axis else "")]
    if column.scale != 1 or column.offset != 0:
        steps.append(f"x × {column.scale!r} + {column.offset!r}")
    named = dict(zip(unit.settings, column.settings, strict=True))
    stated = "".join(f", {key} = {value!r}" for key, value in named.items())
    same = unit.words == "x"
    steps.append(f"in {column.unit}" if same else f"{column.unit} to {column.target}: {unit.words}{stated}")
    if column.sign < 0:
        steps.append("sign reversed")
    if moved:
        steps.append(f"resampled: {column.resample}")
    empty = int(np.isnan(values).sum())
    if empty:
        steps.append(f"{empty} of {len(values)} values missing")
    return f"{column.target} from " + "; ".join(steps)


def _later(origin: "datetime.datetime", seconds: float) -> "datetime.datetime":
    try:
        return origin + datetime.timedelta(seconds=seconds)
    except OverflowError:
        raise InputError(
            f"the record's first time, {seconds:g} s after {origin}, is no date; check time_format."
        ) from None
