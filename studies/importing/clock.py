"""Clocks of loggers: their stamps become seconds, and seconds of several clocks become those of one."""

import datetime
import zoneinfo
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError, numbered
from studies.files.given import shorten
from studies.files.stored import PORTION, Stored, portions
from studies.importing.daylight import ahead_of_utc, find_change
from studies.importing.mapping import DURATIONS, EPOCHS, LOCAL, OWN, FileMap
from studies.importing.tables import RawTable
from studies.importing.units import SECONDS

if TYPE_CHECKING:
    import pandas as pd

_1970 = datetime.datetime(1970, 1, 1)
_LEAPS = ((2017, 1, 18), (2015, 7, 17), (2012, 7, 16), (2009, 1, 15), (2006, 1, 14), (1999, 1, 13))
"""From when on GPS time is ahead of UTC by so many seconds."""
_HALF_DAY = 43200.0
_ZONE = r"(?:[Zz]|[+-]\d\d:?\d\d)$"
LONGEST_RUN = 10 * 365.25 * 86400.0  # s


class Clock:
    """Seconds after an origin (None: the clock's own zero) of rows that are read in order, corrected by the map; what was done, in words.

    t = t' / (1 + ε) + d for a clock that is fast by ε and behind by d. A row without a time has NaN.
    """

    def __init__(self, file: FileMap) -> None:
        self.file, self.form = file, file.time_format.partition(" + ")[0] if file.added else file.time_format
        self.stamped = file.time[:-1] if file.added else file.time
        self.origin, self.notes = file.start, list[str]()
        self._begun: datetime.datetime | None = None  # of the file's own clock
        self._zero: float | None = None  # of a clock since an epoch
        self._first: pd.Timestamp | None = None
        self._zoned = False
        self._range = np.inf, -np.inf
        self._count = self._nights = 0
        self._last = np.nan

    def read(self, table: RawTable) -> Array:
        """Return the seconds of the next rows, which `finish` places in their zone and corrects."""
        file, form = self.file, self.form
        self._count += table.rows
        if file.sample_period is not None:
            return np.asarray(file.sample_period * np.arange(float(self._count - table.rows), float(self._count)))
        if file.count is not None and len(file.time) > 1:
            raise InputError(f"{table.path}: time_format = '{form}' is one column, but 'time' names {len(file.time)}.")
        if form == OWN:
            seconds, start = table.own_clock()
            if self._count == table.rows:
                self._begun, self.origin = start, file.start or start
            elif self._begun is not None and start is not None:
                seconds = seconds + (start - self._begun).total_seconds()
        elif file.count is not None:
            size, begun = file.count
            seconds = (table.numbers(file.time[0]) - (begun or 0.0)) * size
            seconds = seconds if begun is None else self._since(seconds)
        elif form in DURATIONS:
            seconds = self._read_durations(table)
        else:
            seconds = self._read_stamps(table)
        if file.added:
            seconds = seconds + table.numbers(file.time[-1]) * SECONDS[file.added]
        known = seconds[np.isfinite(seconds)]
        if known.size:
            self._range = min(self._range[0], known.min()), max(self._range[1], known.max())
            _check_span(self._range[1] - self._range[0], table, file)
        return seconds

    def finish(self, seconds: Stored, place: Callable[[int], str], folder: str | None = None) -> Stored:
        """Place the seconds of all rows in their zone, and correct the clock."""
        file = self.file
        if file.sample_period is None and self._first is not None:
            self.origin = self._first.to_pydatetime()
            if self._first.year == 1900:  # a pattern without a date: what strptime then supplies
                self.origin = _combine(file.start, self._first.to_pydatetime())
                if self._nights:
                    many = f"{self._nights} midnights passed: a day added at each"
                    self.notes.append("a midnight passed: a day added" if self._nights == 1 else many)
        zone = file.timezone if self.origin is not None and self.origin.tzinfo is None else None
        if zone and file.counts_from_zero and self.origin is not None:  # it has a local start only
            self.origin = _with_offset(self.origin, self.origin.replace(tzinfo=zoneinfo.ZoneInfo(zone)).utcoffset())
            zone = None
        local = self.origin is not None and self.origin.tzinfo is None and file.sample_period is None
        if self.origin is not None and local and not zone and not file.counts_from_zero:
            changes = (find_change(self.origin, seconds[k]) for k in portions(len(seconds), 1))
            self.notes += [f"CHECK: {change[1]}" for change in changes if change]
        rate = file.clock_rate_ppm * 1e-6 if file.sample_period is None else 0.0
        if not (zone or rate or file.clock_offset):
            return seconds
        placed, twice, origin, first = Stored(folder), 0, self.origin, None
        begin = 0
        while begin < len(seconds):
            part = seconds[begin : begin + PORTION]
            if zone and origin is not None:
                # an hour that comes twice is looked at as a whole
                while begin + part.size < len(seconds) and _utc_offsets(origin, part[-1:], zone)[1]:
                    part = seconds[begin : begin + part.size + PORTION]
                part, first, some = place_in_zone(origin, part, zone, place, begin, first)
                twice += some
            begin += part.size
            part = part / (1 + rate) if rate else part
            placed.append(part + file.clock_offset)
        if zone and origin is not None:
            self.origin = _with_offset(origin, datetime.timedelta(seconds=first or 0.0))
        if twice:
            self.notes.append(
                f"{numbered(twice, 'row')} in the hour that {zone} has twice, distinguished by their order"
            )
        if rate:
            self.notes.append(f"its clock runs {rate * 1e6:g} ppm fast: times divided by {1 + rate!r}")
        if file.clock_offset and file.sample_period is None:
            self.notes.append(f"{file.clock_offset:g} s added to its times")
        return placed

    def _since(self, seconds: Array) -> Array:
        """Move the origin to the first whole second after 1970, so that small steps keep their digits."""
        known = seconds[np.isfinite(seconds)]
        if self._zero is None and known.size:
            self._zero = float(np.floor(known[0])) if abs(known[0]) < 1e11 else 0.0
            self.origin = _1970 + datetime.timedelta(seconds=self._zero)
            if self.form == "gps-s":
                ahead = next((s for year, month, s in _LEAPS if self.origin >= datetime.datetime(year, month, 1)), 0)
                self.origin -= datetime.timedelta(seconds=ahead)
                self.notes.append(f"GPS time is {ahead} s ahead of UTC: taken off")
            if self.form not in LOCAL:
                self.origin = self.origin.replace(tzinfo=datetime.UTC)
        return seconds - (self._zero or 0.0)

    def _read_durations(self, table: RawTable) -> Array:
        text = table.joined(self.stamped)
        parts = text.str.extract(rf"^{DURATIONS[self.form]}$")
        self._refuse_bad(table, text, np.asarray(parts[2].isna()))
        sizes = (86400.0, 3600.0, 60.0, 1.0)
        values = [parts[k].replace("", "0").str.replace(",", ".").astype(float) for k in range(4)]
        known = np.asarray(parts[2].notna())
        return np.where(
            known, sum(size * np.nan_to_num(value) for size, value in zip(sizes, values, strict=True)), np.nan
        )

    def _refuse_bad(self, table: RawTable, text: "pd.Series[str]", unread: Array) -> None:
        """Refuse the first cell that holds something, but no time of the form."""
        bad = np.flatnonzero(unread & np.asarray(text != ""))
        if len(bad):
            raise InputError(
                f"{table.place(bad[0])}: '{shorten(text.iloc[bad[0]])}' in column '{' '.join(self.stamped)}' is not a time of the"
                f" form '{self.form}'; correct time_format in the map, or end the table above with last_line; a remark between rows goes into 'missing', and an elapsed time is 'h:mm:ss'."
            )

    def _read_stamps(self, table: RawTable) -> Array:
        """Parse stamps written as text; several time zones in one file are brought to UTC."""
        import pandas as pd

        name = " ".join(self.stamped)
        text = table.joined(self.stamped)
        empty = np.asarray(text == "")
        plain = text if "," in self.form else text.str.replace(",", ".", regex=False)
        form = "ISO8601" if self.form == "iso" else self.form
        plain = plain.mask(empty)
        zoned = "%z" in form or (form == "ISO8601" and bool(plain.dropna().str.contains(_ZONE).any()))
        if self._first is not None and zoned > self._zoned:
            raise InputError(f"{table.place(0)}: states a time zone, which the rows before do not; correct the stamps.")
        self._zoned |= zoned
        try:
            stamps = pd.to_datetime(plain, format=form, errors="coerce", utc=self._zoned)
        except ValueError as error:
            raise InputError(
                f"{table.path}: time_format = '{self.form}' does not fit column '{name}' ({shorten(str(error))})."
            ) from None
        self._refuse_bad(table, text, np.asarray(stamps.isna()))
        known = stamps.dropna()
        if self._first is None and len(known):
            self._first = known.iloc[0]
        if self._first is None:
            return np.full(table.rows, np.nan)
        seconds = np.array((stamps - self._first) / pd.Timedelta(seconds=1), dtype=float)
        return self._unroll_midnights(seconds) if self._first.year == 1900 else seconds

    def _unroll_midnights(self, seconds: Array) -> Array:
        """Add a day whenever a clock without a date jumps back by more than half a day."""
        known = np.flatnonzero(np.isfinite(seconds))
        if known.size:
            nights = self._nights + np.cumsum(np.diff(np.append(self._last, seconds[known])) < -_HALF_DAY)
            self._last, self._nights = float(seconds[known[-1]]), int(nights[-1])
            seconds[known] += 86400.0 * nights
        return seconds


def _check_span(span: float, table: RawTable, file: FileMap) -> None:
    """Refuse times that span longer than any run, and name the units that would make a run of them."""
    if span <= LONGEST_RUN:
        return
    size, begun = file.count or (1.0, 0.0)
    family = {name: step for name, step in SECONDS.items() if begun is None} | {
        name: one[0] for name, one in EPOCHS.items() if file.count and begun == one[1]
    }
    better = [
        f"'{name}' ({span / size * f:.3g} s)" for name, f in family.items() if 1 < span / size * f < LONGEST_RUN / 10
    ]
    hint = f" time_format = {' or '.join(better)} would be possible." if better else " Check the dates."
    raise InputError(
        f"{table.path}: with time_format = '{file.time_format}' its times span {span / 31557600:.3g} years, too long for one run.{hint}"
    )


def seconds_between(one: datetime.datetime, two: datetime.datetime, path: str) -> float:
    """Return two - one in seconds; stamps with and without a time zone cannot be compared."""
    if (one.tzinfo is None) != (two.tzinfo is None):
        raise InputError(
            f"{path}: one clock states its time zone, the other does not; give the other file timezone = 'UTC' (or its own)."
        )
    return (two - one).total_seconds()


def _combine(start: datetime.datetime | None, clock: datetime.datetime) -> datetime.datetime | None:
    """Give the first stamp of a clock without a date the date of `start`."""
    return (
        None if start is None else datetime.datetime.combine(start.date(), clock.time(), clock.tzinfo or start.tzinfo)
    )


def place_in_zone(
    origin: datetime.datetime, seconds: Array, zone: str, place: Callable[[int], str], begin: int, first: float | None
) -> tuple[Array, float | None, int]:
    """Return true seconds (N,) of the rows from `begin` after the origin, by how much that is ahead of UTC (`first`, else of the first row), and how many rows lie in an hour that comes twice."""
    rows = np.flatnonzero(np.isfinite(seconds))
    ahead, doubtful = _utc_offsets(origin, seconds[rows], zone)
    skipped = np.flatnonzero(np.isnan(ahead))
    if len(skipped):
        raise InputError(
            f"{place(begin + int(rows[skipped[0]]))}: this time does not exist in {zone}, whose clocks skip that hour; a logger that"
            " stays on winter time needs a fixed zone, such as timezone = 'Etc/GMT-1' for one hour ahead of UTC."
        )
    true = seconds.copy()
    first = float(ahead[0]) if first is None and ahead.size else first
    true[rows] -= ahead - (first or 0.0)
    return true, first, doubtful


def _with_offset(origin: datetime.datetime, ahead: datetime.timedelta | None) -> datetime.datetime:
    return origin.replace(tzinfo=datetime.timezone(ahead or datetime.timedelta()))


def _utc_offsets(origin: datetime.datetime, seconds: Array, zone: str) -> tuple[Array, int]:
    """Return by how many seconds the zone's clocks are ahead of UTC at each local time; NaN where the time does not exist."""
    first, second = (ahead_of_utc(origin, seconds, zone, summer=one) for one in (True, False))
    twice = np.flatnonzero(first > second)
    for block in np.split(twice, np.flatnonzero(np.diff(twice) > 1) + 1) if len(twice) else []:
        start = _second_pass(seconds, int(block[0]), int(block[-1]))
        first[start : block[-1] + 1] = second[start : block[-1] + 1]
    return first, len(twice)


def _second_pass(seconds: Array, begin: int, end: int) -> int:
    """Return the row of a block in the repeated hour that begins the second pass: where stamps step back, else by the
    smaller step beside it.
    """
    back = np.flatnonzero(np.diff(seconds[begin : end + 1]) < 0)
    if len(back):
        return begin + int(back[0]) + 1
    before = seconds[begin] - seconds[begin - 1] if begin else np.inf
    after = seconds[end + 1] - seconds[end] if end + 1 < len(seconds) else np.inf
    return begin if after < before else end + 1
