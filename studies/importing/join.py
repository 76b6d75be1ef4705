"""Columns of several loggers, each with its own clock and rate, brought onto the times of one record."""

import datetime
import itertools
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError, numbered
from studies.files.stored import Stored, portions
from studies.importing.channels import read_tables
from studies.importing.clock import Clock, seconds_between
from studies.importing.doubtful import drop_doubtful
from studies.importing.mapping import OWN, TABLE_TARGETS, ColumnMap, FileMap, LoadedMap
from studies.importing.order import Order, rises
from studies.importing.raw import NotPlain
from studies.importing.resampling import ClockedFile, take_over
from studies.importing.tables import RawTable, Rows
from studies.record import Record, check_plausible, find_impossible

SHORT = 2_000_000  # rows of a record that is held in memory
LARGEST = 50_000_000  # rows of a regular grid


def import_records(paths: Sequence[str], import_map: LoadedMap, folder: str | None = None) -> dict[str, Record]:
    """Read raw files, convert and join them into one record, or one for each axis; the comments of the header list every change.

    Columns of more than `SHORT` rows are `Stored` (in the `folder`): they are read by slices.
    """
    shared = zip(share_out(paths, import_map), import_map.files, strict=True)
    series = [read_series(own, file, folder) for own, file in shared]
    base = series[0]
    shifts = [shift_between(base, other) for other in series]
    begin = base.span[0]
    time = _lay_grid(base, import_map, folder)
    notes = [f"imported with {import_map.path}; all changes are listed here"]
    columns: dict[tuple[str, str], Stored] = {}
    for number, (one, shift) in enumerate(zip(series, shifts, strict=True), 1):
        notes += [f"file {number}, {note}" for note in one.notes]
        if number > 1:
            notes.append(f"file {number}, its first row is at {one.span[0] + shift - begin:.6g} s of the record")
        notes += [f"file {number}, {note}" for note in _report_gaps(one)]
        moved = one is not base or import_map.step is not None
        for column in one.file.columns:
            values = one.columns[column.target, column.axis]
            if moved:
                values = take_over(one, values, shift - begin, time, column.resample, folder)
            columns[column.target, column.axis] = values
            notes.append(_describe(column, values, moved))
        if moved:
            notes.append(f"file {number}, nothing is interpolated across gaps longer than {one.longest_gap:.6g} s")
    if import_map.step is not None:
        notes.append(f"regular time grid of {import_map.step:g} s")
    start = None if base.origin is None else _later(base.origin, begin)
    held: dict[tuple[str, str], Any] = {("time_s", ""): time, **columns}
    if len(time) <= SHORT:
        held = {key: values[:] for key, values in held.items()}
    return {
        axis: Record(
            {name: values for (name, of), values in held.items() if of in ("", axis)},
            instrument=" ".join(filter(None, (import_map.instrument, f"axis {axis}" if axis else ""))),
            source=import_map.source,
            start=start,
            comments=tuple(" ".join(note.split()) for note in notes),
        )
        for axis in import_map.axes
    }


def import_table(path: str, import_map: LoadedMap) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Read settled readings, temperature (°C) and frequency (Hz), in the order of the file, and what was changed; incomplete rows go."""
    (file,) = import_map.files
    read = _read_columns([path], file, None)
    columns = {name: values[:] for (name, _), values in read.columns.items()}
    whole = np.all([np.isfinite(values) for values in columns.values()], axis=0)
    if not whole.any():
        raise InputError(f"{path}: no row has both {' and '.join(columns)}.")
    notes = [
        f"imported with {import_map.path}; all changes are listed here",
        f"{_name_files(read.rows)}, {int(whole.sum())} of {len(whole)} rows",
        *read.empty,
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
    if len(one.time) < 2:
        return []
    limit, gaps = one.longest_gap, np.empty((0, 2))  # when they begin, and how long they last
    for k in portions(len(one.time), 1):
        t = one.time[k]
        gaps = np.append(gaps, np.column_stack([t[:-1], np.diff(t)])[np.diff(t) > limit], axis=0)
    usual = f"{len(one.time)} rows, usually {one.usual_step:.6g} s apart"
    if not len(gaps):
        return [f"{usual}; no gap longer than {limit:.6g} s"]
    after, most = gaps[np.argmax(gaps[:, 1])]
    return [
        f"{usual}; {numbered(len(gaps), 'gap')} longer than {limit:.6g} s, {gaps[:, 1].sum():.6g} s together, the"
        f" longest of {most:.6g} s after {after - one.span[0]:.6g} s"
    ]


@dataclass(frozen=True)
class _Columns:
    """The columns of a [[file]] as they stand in its raw files, with the clock that reads their times."""

    rows: Rows
    clock: Clock
    time: Stored
    columns: dict[tuple[str, str], Stored]
    empty: list[str]  # readings that are none, in words


def _read_columns(paths: Sequence[str], file: FileMap, folder: str | None, plain: bool = True) -> _Columns:
    clock, rows, time, counts = Clock(file), Rows(), Stored(folder), Counter[tuple[int, str]]()
    columns = {(column.target, column.axis): Stored(folder) for column in file.columns}
    timed = bool(file.time_format or file.sample_period)
    try:
        with closing(read_tables(paths, file, plain)) as tables:
            for table in tables:
                rows.add(table)
                if timed:
                    time.append(clock.read(table))
                found: Counter[tuple[int, str]] = Counter()
                for column in file.columns:
                    values, zeros, impossible = convert(table, column)
                    columns[column.target, column.axis].append(values)
                    found[0, column.source] = table.overloads[column.source]
                    found[1, column.source] += zeros
                    found[2, column.source] += impossible
                counts.update(found)
    except NotPlain:
        return _read_columns(paths, file, folder, plain=False)
    kinds = "an instrument's overload", "0, a dropout", "impossible"
    return _Columns(rows, clock, time, columns, [
        f"{numbered(n, 'reading')} of '{name}' {'is' if n == 1 else 'are'} {kinds[kind]}: left empty"
        for (kind, name), n in sorted(counts.items(), key=lambda one: one[0][0])
        if n
    ])  # fmt: skip


def read_series(paths: Sequence[str], file: FileMap, folder: str | None = None) -> ClockedFile:
    """Read a raw file, or several that continue one another: clock corrected, columns converted, rows without a time left out."""
    read = _read_columns(paths, file, folder)
    time, columns = read.clock.finish(read.time, read.rows.place, folder), dict(read.columns)
    order = Order(read.rows, file, folder)
    if not rises(time):
        time, *left = order.sort([time, *columns.values()])
        columns = dict(zip(columns, left, strict=True))
    told: list[str] = []
    for column in file.columns:
        place = column.target, column.axis
        columns[place], found = drop_doubtful(column, columns[place], folder)
        told += found
    path = read.rows.parts[0].path
    for (name, _), values in columns.items():
        if all(np.isnan(values[k]).all() for k in portions(len(values))):
            raise InputError(f"{path}: the column for {name} holds no value in any of the {len(time)} rows.")
    end = "" if file.last_line is None else f" down to line {file.last_line}"
    first = f"{_name_files(read.rows)}, {len(time)} rows{end} {_name_clock(file)}"
    notes = (first, *read.clock.notes, *order.notes, *read.empty, *told)
    return ClockedFile(file, path, time, read.clock.origin, columns, notes)


def _name_files(rows: Rows) -> str:
    return " then ".join(f"{' '.join(part.path.split())}, sha256 {part.sha256}" for part in rows.parts)


def _name_clock(file: FileMap) -> str:
    if file.time_format == OWN:
        return "by the file's own clock"
    if file.sample_period is not None:
        return f"without a time, {file.sample_period!r} s apart"
    return f"from '{' '.join(file.time)}' ({file.time_format})"


def convert(table: RawTable, column: ColumnMap) -> tuple[Array, int, int]:
    """Return a raw column in the unit of the record, sign × unit(reading × scale + offset), and how many readings of 0 and impossible ones are none."""
    reading, zeros = np.asarray(table.numbers(column.source) * column.scale + column.offset), 0
    if column.conversion.never_zero:
        none = reading == 0
        zeros = int(np.count_nonzero(none))
        reading[none] = np.nan
    values = column.sign * column.conversion.convert(reading, *column.settings)
    wrong = find_impossible(column.target, values) if "impossible" in column.drop else np.zeros(0, dtype=bool)
    values[: wrong.size][wrong] = np.nan
    mend = "make it missing by drop = ['impossible'] of the column in the map"
    check_plausible({column.target: values}, lambda row: f"{table.place(row)}, '{column.source}'", mend)
    return np.asarray(values, dtype=float), zeros, int(np.count_nonzero(wrong))


def _lay_grid(base: ClockedFile, import_map: LoadedMap, folder: str | None) -> Stored:
    """Return the times of the record, from 0 on, by the first file's clock: its own, or a regular grid over its range."""
    first, last = base.span
    count = len(base.time)
    if import_map.step is not None:
        rows = np.floor((last - first) / import_map.step) + 1
        if not rows <= LARGEST:
            raise InputError(
                f"{import_map.path}: step_s = {import_map.step:g} makes {rows:.3g} rows, more than the limit of {LARGEST:,}; increase step_s."
            )
        count = int(rows)
    elif first == 0:
        return base.time
    grid = Stored(folder)
    for k in portions(count):
        even = import_map.step
        grid.append(base.time[k] - first if even is None else even * np.arange(float(k.start), float(k.stop)))
    return grid


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
    (first, last), (begin, end) = (time + shift for time in other.span), base.span
    if other is not base and (last < begin or first > end):
        raise InputError(
            f"{other.path}: is entirely {'before' if last < begin else 'after'} {base.path} (from {first - begin:g}"
            f" to {last - begin:g} s of the record); check the dates, 'start' and clock_offset_s."
        )
    return shift


def _describe(column: ColumnMap, values: Array | Stored, moved: bool) -> str:
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
    empty = sum(int(np.isnan(values[k]).sum()) for k in portions(len(values)))
    if empty:
        steps.append(f"{empty} of {len(values)} values missing")
    return f"{column.target} from " + "; ".join(steps)


def _later(origin: datetime.datetime, seconds: float) -> datetime.datetime:
    try:
        return origin + datetime.timedelta(seconds=seconds)
    except OverflowError:
        raise InputError(
            f"the record's first time, {seconds:g} s after {origin}, is no date; check time_format."
        ) from None
