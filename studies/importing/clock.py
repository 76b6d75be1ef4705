"""Clocks of loggers: their stamps become seconds, and seconds of several clocks become those of one."""

import datetime
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from studies.errors import InputError
from studies.importing.mapping import NUMERIC_TIMES, OWN, SECONDS, UNIX, FileMap
from studies.importing.raw import shorten
from studies.importing.tables import RawTable

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_EXCEL_EPOCH = datetime.datetime(1899, 12, 30)
_UNIX_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_HALF_DAY = 43200.0
LONGEST_RUN = 10 * 365.25 * 86400.0  # s


@dataclass(frozen=True)
class Times:
    """Seconds after an origin (None: the clock's own zero), NaN where a row has no time; what was done, in words."""

    seconds: "Array"
    origin: datetime.datetime | None
    notes: tuple[str, ...] = ()


def read_times(table: RawTable, file: "FileMap") -> Times:
    """Return times by the raw file's own clock, corrected by the map: t = t' / (1 + ε) + d for a clock that is fast by ε and behind by d."""
    form = file.time_format
    origin, notes = file.start, []
    if file.sample_period is not None:
        rows = np.arange(table.rows, dtype=np.float64)
        return Times(np.asarray(file.sample_period * rows + file.clock_offset), origin)
    if form in NUMERIC_TIMES and len(file.time) > 1:
        raise InputError(f"{table.path}: time_format = '{form}' is one column, but 'time' names {len(file.time)}.")
    if form == OWN:
        seconds, origin = table.own_clock()
        origin = file.start or origin
    elif form in SECONDS:
        seconds = table.numbers(file.time[0]) * SECONDS[form]
    elif form in UNIX:
        seconds, origin = _from_first(table.numbers(file.time[0]) * UNIX[form], _UNIX_EPOCH)
    elif form == "excel-days":
        seconds, origin = _from_first(table.numbers(file.time[0]) * 86400.0, _EXCEL_EPOCH)
    else:
        seconds, origin = _read_stamps(table, file)
        if origin.year == 1900:  # a pattern without a date: what strptime then supplies
            seconds, nights = _unroll_midnights(seconds)
            origin = _combine(file.start, origin)
            passed = (
                "a midnight passed: a day added" if nights == 1 else f"{nights} midnights passed: a day added at each"
            )
            notes += [passed] if nights else []
    _check_span(seconds, table, file)
    if file.timezone is not None and origin is not None and origin.tzinfo is None:
        origin, seconds, twice = _place(origin, seconds, table, file)
        if twice:
            notes.append(f"{twice} rows in the hour that {file.timezone} has twice, distinguished by their order")
    if file.clock_rate:
        seconds = seconds / (1 + file.clock_rate)
        notes.append(f"its clock runs {file.clock_rate * 1e6:g} ppm fast: times divided by {1 + file.clock_rate!r}")
    if file.clock_offset:
        seconds = seconds + file.clock_offset
        notes.append(f"{file.clock_offset:g} s added to its times")
    return Times(seconds, origin, tuple(notes))


def _place(
    origin: datetime.datetime, seconds: "Array", table: RawTable, file: "FileMap"
) -> "tuple[datetime.datetime, Array, int]":
    """Place local stamps in their zone; a clock that counts seconds has a local start only."""
    if file.time_format not in SECONDS:
        return place_in_zone(origin, seconds, str(file.timezone), table.place)
    import zoneinfo

    ahead = origin.replace(tzinfo=zoneinfo.ZoneInfo(str(file.timezone))).utcoffset()
    return origin.replace(tzinfo=datetime.timezone(ahead or datetime.timedelta())), seconds, 0


def _check_span(seconds: "Array", table: RawTable, file: "FileMap") -> None:
    """Refuse times that span longer than any run, and name the units that would make a run of them."""
    known = seconds[np.isfinite(seconds)]
    span = float(np.ptp(known)) if known.size else 0.0
    if span <= LONGEST_RUN:
        return
    unit, family = next(
        ((factors[file.time_format], factors) for factors in (SECONDS, UNIX) if file.time_format in factors), (1.0, {})
    )
    better = [
        f"'{name}' ({span / unit * f:.3g} s)" for name, f in family.items() if 1 < span / unit * f < LONGEST_RUN / 10
    ]
    hint = f" time_format = {' or '.join(better)} would be possible." if better else " Check the dates."
    raise InputError(
        f"{table.path}: with time_format = '{file.time_format}' its times span {span / 31557600:.3g} years, too long for one run.{hint}"
    )


def drop_repeated(
    table: RawTable, times: Times, file: "FileMap", repeated: "NDArray[np.bool_]"
) -> "tuple[Times, NDArray[np.intp]]":
    """Return strictly increasing times and the rows that they belong to; rows without a time, and those `repeated`, are left out."""
    rule = file.repeated_times

    rows = np.flatnonzero(np.isfinite(times.seconds) & ~repeated)
    if not len(rows):
        raise InputError(f"{table.path}: no row has a time.")
    t = times.seconds[rows]
    notes = list(times.notes)
    lost = int(np.count_nonzero(~np.isfinite(times.seconds)))
    if lost:
        first = int(np.flatnonzero(~np.isfinite(times.seconds))[0])
        notes.append(f"{lost} rows without a time left out (first: {table.place(first)})")
    steps = np.diff(t)
    if (steps < 0).any():
        row = int(rows[int(np.flatnonzero(steps < 0)[0]) + 1])
        raise InputError(
            f"{table.place(row)}: the time goes backwards (by up to {-steps.min():g} s). {_mend(table, file, row)}"
        )
    same = np.flatnonzero(steps == 0)
    if len(same) and rule == "error":
        raise InputError(
            f"{table.place(int(rows[same[0] + 1]))}: this {table.row_name} repeats the time of the one before ({len(same)}"
            " such rows); set repeated_times = 'first' or 'spread' in the map."
        )
    if len(same) and rule == "first":
        notes.append(f"{len(same)} rows with a repeated time left out")
        kept = np.concatenate([[True], steps > 0])
        rows, t = rows[kept], t[kept]
    elif len(same):
        notes.append(f"{len(same)} repeated times spread evenly up to the next stamp")
        t = _spread(t)
    return Times(t, times.origin, tuple(notes)), rows


def _mend(table: RawTable, file: "FileMap", row: int) -> str:
    if row in table.starts():
        return "Give consecutive files in the order of their times; import files whose clocks restart one by one."
    restart = "If its clock restarted, split the file there, or end it with last_line in its [[file]] of the map."
    if file.timezone or file.time_format in SECONDS:
        return restart
    return f"{restart} If clocks changed to winter time, give 'timezone' in that [[file]]."


def seconds_between(one: datetime.datetime, two: datetime.datetime, path: str) -> float:
    """Return two - one in seconds; stamps with and without a time zone cannot be compared."""
    if (one.tzinfo is None) != (two.tzinfo is None):
        raise InputError(f"{path}: one clock states its time zone, the other does not; give 'start' or %z.")
    return (two - one).total_seconds()


def _from_first(seconds: "Array", epoch: datetime.datetime) -> "tuple[Array, datetime.datetime]":
    """Move the origin to the first whole second, so that small steps keep their digits."""
    known = seconds[np.isfinite(seconds)]
    if not len(known) or not abs(known[0]) < 1e11:
        return seconds, epoch
    first = float(np.floor(known[0]))
    return seconds - first, epoch + datetime.timedelta(seconds=first)


def _read_stamps(table: RawTable, file: "FileMap") -> "tuple[Array, datetime.datetime]":
    """Parse stamps written as text; several time zones in one file are brought to UTC."""
    import pandas as pd

    name = " ".join(file.time)
    text = table.joined(file.time)
    empty = table.is_empty(text)
    plain = text.str.replace(",", ".", regex=False) if file.decimal == "," else text
    form = "ISO8601" if file.time_format == "iso" else file.time_format
    stamps = _parse(plain.mask(empty), form, table, file)
    bad = np.flatnonzero(np.asarray(stamps.isna()) & ~empty)
    if len(bad):
        raise InputError(
            f"{table.place(bad[0])}: '{shorten(text.iloc[bad[0]])}' in column '{name}' is not a time"
            f" of the form '{file.time_format}'; correct time_format in the map."
        )
    known = stamps.dropna()
    if not len(known):
        raise InputError(f"{table.path}: no row has a time in column '{name}'.")
    origin = known.iloc[0]
    seconds = np.asarray((stamps - origin) / pd.Timedelta(seconds=1), dtype=float)
    return seconds, origin.to_pydatetime()


def _parse(text: "pd.Series[str]", form: str, table: RawTable, file: "FileMap") -> "pd.Series[pd.Timestamp]":
    import pandas as pd

    zoned = "%z" in form or (form == "ISO8601" and bool(text.dropna().str.contains(r"(?:[Zz]|[+-]\d\d:?\d\d)$").any()))
    try:
        return pd.to_datetime(text, format=form, errors="coerce", utc=zoned)
    except ValueError as error:
        raise InputError(
            f"{table.path}: time_format = '{file.time_format}' does not fit column '{' '.join(file.time)}' ({shorten(str(error))})."
        ) from None


def _unroll_midnights(seconds: "Array") -> "tuple[Array, int]":
    """Add a day whenever a clock without a date jumps back by more than half a day."""
    known = np.flatnonzero(np.isfinite(seconds))
    jumps = np.diff(seconds[known]) < -_HALF_DAY
    unrolled = seconds.copy()
    unrolled[known[1:]] += 86400.0 * np.cumsum(jumps)
    return unrolled, int(jumps.sum())


def _combine(start: datetime.datetime | None, clock: datetime.datetime) -> datetime.datetime | None:
    """Give the first stamp of a clock without a date the date of `start`."""
    return (
        None if start is None else datetime.datetime.combine(start.date(), clock.time(), clock.tzinfo or start.tzinfo)
    )


def _spread(t: "Array") -> "Array":
    """Spread rows with the same stamp evenly up to the next stamp; the last group takes the usual step."""
    stamps, first, count = np.unique(t, return_index=True, return_counts=True)
    usual = float(np.median(np.diff(stamps))) if len(stamps) > 1 else 1.0
    width = np.append(np.diff(stamps), usual)
    within = np.arange(len(t)) - np.repeat(first, count)
    return np.asarray(t + within * np.repeat(width / count, count))


def place_in_zone(
    origin: datetime.datetime, seconds: "Array", zone: str, place: Callable[[int], str]
) -> "tuple[datetime.datetime, Array, int]":
    """Return the origin with its offset from UTC, true seconds (N,) after it, and how many rows lie in an hour that comes twice."""
    rows = np.flatnonzero(np.isfinite(seconds))
    ahead, doubtful = _utc_offsets(origin, seconds[rows], zone)
    skipped = np.flatnonzero(np.isnan(ahead))
    if len(skipped):
        raise InputError(
            f"{place(int(rows[skipped[0]]))}: this time does not exist in {zone}, whose clocks skip that hour; a logger that"
            " stays on winter time needs a fixed zone, such as timezone = 'Etc/GMT-1' for one hour ahead of UTC."
        )
    true = seconds.copy()
    true[rows] -= ahead - ahead[0]
    return origin.replace(tzinfo=datetime.timezone(datetime.timedelta(seconds=float(ahead[0])))), true, doubtful


def _utc_offsets(origin: datetime.datetime, seconds: "Array", zone: str) -> "tuple[Array, int]":
    """Return by how many seconds the zone's clocks are ahead of UTC at each local time; NaN where the time does not exist."""
    import pandas as pd

    wall = pd.DatetimeIndex(np.datetime64(origin, "us") + np.round(1e6 * seconds).astype("timedelta64[us]"))

    def ahead(summer: bool) -> "Array":
        placed = wall.tz_localize(zone, ambiguous=np.full(len(wall), summer), nonexistent="NaT")
        return np.asarray((wall - placed.tz_convert(None)) / pd.Timedelta(seconds=1), dtype=float)

    first, second = ahead(summer=True), ahead(summer=False)
    twice = np.flatnonzero(first > second)
    for block in np.split(twice, np.flatnonzero(np.diff(twice) > 1) + 1) if len(twice) else []:
        start = _second_pass(seconds, int(block[0]), int(block[-1]))
        first[start : block[-1] + 1] = second[start : block[-1] + 1]
    return first, len(twice)


def _second_pass(seconds: "Array", begin: int, end: int) -> int:
    """Return the row of a block in the repeated hour that begins the second pass: where stamps step back, else by the
    smaller step beside it.
    """
    back = np.flatnonzero(np.diff(seconds[begin : end + 1]) < 0)
    if len(back):
        return begin + int(back[0]) + 1
    before = seconds[begin] - seconds[begin - 1] if begin else np.inf
    after = seconds[end + 1] - seconds[end] if end + 1 < len(seconds) else np.inf
    return begin if after < before else end + 1
