"""The map of an import, `schema = "hrg.map/1"`: what each raw file's columns are and how they become a record."""

import datetime
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from studies.errors import nearest
from studies.importing.units import SECONDS, TARGETS, UNITS, Unit, find_spelling, split_nominal, units_of
from studies.schema.keys import Keys, number, says
from studies.schema.reader import read_file

SCHEMA = "hrg.map/1"
SEPARATORS = {";": ";", ",": ",", "tab": "\t", "|": "|", "space": " "}
EPOCHS: Mapping[str, tuple[float, float, str]] = {
    **{f"unix-{name}": (SECONDS[name], 0.0, "unix|posix|epoch") for name in ("s", "ms", "us", "ns")},
    "excel-days": (86400.0, 25569.0, "excel|serial"),
    "gps-s": (1.0, -315964800.0, "gps(?!.*week)"),
    "labview-s": (1.0, 2082844800.0, "labview|1904"),
    "ntp-s": (1.0, 2208988800.0, "ntp"),
    "matlab-days": (86400.0, 719529.0, "datenum|matlab"),
    "mjd": (86400.0, 40587.0, r"\bmjd"),
    "jd": (86400.0, 2440587.5, r"\bjd|julian"),
}
"""Counts since an epoch: seconds of one, the count at the beginning of 1970, and how headings name them."""
LOCAL = ("excel-days", "matlab-days")  # the others count from an epoch of UTC
DURATIONS = {
    "h:mm:ss": r"(?:(\d+)[ .]?(?:d|days?)?,?[ .])?(\d+):(\d+):(\d+(?:[.,]\d*)?)",
    "mm:ss": r"()()(\d+):(\d+(?:[.,]\d*)?)",
}
"""Elapsed times of any length, as "30:15:00", "1.06:15:00" or "1 day, 6:15:00": days, hours, minutes, seconds."""
OWN = "own"
"""The clock that a file of channels has itself."""
TIME_FORMATS = (*SECONDS, *EPOCHS, *DURATIONS, "iso", OWN)
TABLE_TARGETS = ("temperature_degC", "frequency_Hz")
LAST = 10**9  # line


class ColumnMap(Keys, frozen=True, kw_only=True):
    """One raw column and what it becomes: sign × unit(reading × scale + offset)."""

    source: Annotated[str, says("name in the raw file", example="T Gehäuse [K]")] = msgspec.field(name="from")
    target: Annotated[str, says("column of the record", example="housing_temperature_degC")] = msgspec.field(name="to")
    stated_unit: Annotated[
        str, says(f"of the scaled reading, °C and mdps are spellings too: {UNITS}; ppm of 4432.07 Hz", example="K")
    ] = msgspec.field(name="unit")
    scale: Annotated[float, number("reading × scale + offset is in the unit")] = 1.0
    offset: Annotated[float, number("see scale")] = 0.0
    sign: Annotated[float, number("-1 reverses the sign of the converted value", least=-1, most=1)] = 1.0
    stated_resample: (
        Annotated[
            Literal["linear", "mean", "nearest", "previous"],
            says("between the times of the first file; nearest for pattern_angle_deg unless given"),
        ]
        | None
    ) = msgspec.field(name="resample", default=None)
    axis: Annotated[str, says("one record for each axis; columns without an axis go into every record")] = ""
    drop: Annotated[
        tuple[Literal["spikes", "stuck", "zeros", "impossible"], ...],
        says("readings that become missing values; the import counts them"),
    ] = ()
    clock_Hz: Annotated[float, number("clock that is counted, of unit period-counts", above=0.0)] | None = None
    periods: Annotated[float, number("periods in which it is counted, of unit period-counts", above=0.0)] | None = None
    gate_s: Annotated[float, number("gate in which periods are counted, of unit gate-counts", above=0.0)] | None = None
    nominal_Hz: Annotated[float, number("reference of the units ppm and ppb", above=0.0)] | None = None

    def __post_init__(self) -> None:
        known = (*TARGETS, "temperature_degC")
        if self.target not in known:
            raise ValueError(f"to = '{self.target}' is not a column of a record{nearest(self.target, TARGETS)}")
        if not self.unit:
            raise ValueError(
                f"unit = '{self.stated_unit}' is unknown{nearest(self.stated_unit, units_of(self.target))}"
            )
        for key in ("clock_Hz", "periods", "gate_s", "nominal_Hz"):
            wanted, given = key in self.conversion.settings, getattr(self, key) is not None
            if given and not wanted:
                raise ValueError(f"{key} cannot be combined with unit = '{self.unit}'; remove it.")
            if wanted and not given and not (key == "nominal_Hz" and self._nominal):
                raise ValueError(f"the key '{key}' is missing; add it.")
        if self.scale == 0:
            raise ValueError("scale must not be 0; write the factor by which the reading is to be multiplied.")
        if abs(self.sign) != 1:
            raise ValueError(f"sign must be 1 or -1, not {self.sign:g}.")
        if self.axis and not self.axis.isalnum():
            raise ValueError(f"axis = '{self.axis}' becomes part of a file name; use letters and digits only.")

    @property
    def unit(self) -> str:
        """The unit as the table of units spells it; "" where it has none such."""
        return find_spelling(self.target, split_nominal(self.stated_unit)[0]) or ""

    @property
    def conversion(self) -> Unit:
        """The unit's conversion."""
        return units_of(self.target)[self.unit]

    @property
    def settings(self) -> tuple[float, ...]:
        """What the conversion needs besides the reading."""
        return tuple(float(getattr(self, key) or self._nominal or 0.0) for key in self.conversion.settings)

    @property
    def resample(self) -> str:
        """How values between two readings are found: an angle may jump by a turn."""
        return self.stated_resample or ("nearest" if self.target == "pattern_angle_deg" else "linear")

    @property
    def _nominal(self) -> float | None:
        return split_nominal(self.stated_unit)[1]


class FileMap(Keys, frozen=True, kw_only=True):
    """One raw file: its notation, its clock, its columns; in the order of the command line."""

    separator: Annotated[Literal[";", ",", "tab", "|", "space"], says("between cells")] = ","
    decimal: Annotated[Literal[".", ","], says("of numbers")] = "."
    thousands: Annotated[Literal["", ".", ",", "'", " "], says("between groups of three digits")] = ""
    encoding: Annotated[
        Literal["utf-8", "utf-16", "cp1252", "latin-1", "cp1250", "cp1251", "cp850", "gb18030", "cp932", "cp949"],
        says("of the file; gb18030 reads GBK, cp932 Shift-JIS"),
    ] = "utf-8"
    header_line: Annotated[int, number("with column names; 0: 'column 1', 'column 2', ...", least=0, most=LAST)] = 1
    first_line: (
        Annotated[int, number("first line with numbers; the one after the header unless given", least=1, most=LAST)]
        | None
    ) = msgspec.field(name="data_line", default=None)
    last_line: Annotated[int, number("last line of the data", least=1, most=LAST)] | None = None
    sheet: Annotated[str, says("of an Excel workbook")] = ""
    group: (
        Annotated[str, says("of a TDMS, MDF, HDF5 or MATLAB file; without it channels are named group/channel")] | None
    ) = None
    same_file: Annotated[bool, says("raw file of the previous [[file]]: another group or another clock")] = False
    missing: Annotated[tuple[str, ...], says('cells that mean "no value", besides empty ones')] = ()
    time_columns: Annotated[
        str | Annotated[tuple[str, ...], says("", least=1)],
        says("column with the time; a list joins columns with a space", example="Zeit"),
    ] = msgspec.field(name="time", default=())
    time_format: Annotated[
        str,
        says(
            f"{', '.join(TIME_FORMATS)}, a multiple such as '0.1 s', or a pattern such as '%d.%m.%Y %H:%M:%S'; + ms behind it adds a last column",
            example="s",
        ),
    ] = ""
    sample_period: Annotated[float, number("instead of time and time_format: evenly spaced rows", above=0.0)] | None = (
        msgspec.field(name="sample_period_s", default=None)
    )
    timezone: Annotated[str, says("of stamps that do not state one, such as Europe/Berlin")] | None = None
    parts: (
        Annotated[int, number("number of consecutive files; 1, or all files with one [[file]]", least=1, most=LAST)]
        | None
    ) = None
    start: Annotated[datetime.datetime, says("when a clock that counts from 0 was started")] | None = None
    clock_offset: Annotated[
        float, number("added to its times: positive when its clock is behind", least=-1e9, most=1e9)
    ] = msgspec.field(name="clock_offset_s", default=0.0)
    clock_rate_ppm: Annotated[float, number("by how much its clock runs fast", least=-1e5, most=1e5)] = 0.0
    repeated_times: Annotated[
        Literal["error", "first", "spread"], says("first keeps one row, spread spaces them evenly up to the next time")
    ] = "error"
    longest_gap: (
        Annotated[float, number("longer gaps are not interpolated; 10 steps unless given", above=0.0)] | None
    ) = msgspec.field(name="longest_gap_s", default=None)
    columns: Annotated[tuple[ColumnMap, ...], says("of the raw file, for the record")] = msgspec.field(
        name="column", default=()
    )

    def __post_init__(self) -> None:
        if self.sample_period is not None and (self.time or self.time_format):
            raise ValueError("sample_period_s is given; remove time and time_format.")
        if not self.columns:
            raise ValueError(
                "it has no [[file.column]]. In a draft no column was recognised then: take the # off the blocks of those that belong to the record, and fill in 'to' and 'unit' (hrg keys map)."
            )
        if self.decimal == self.thousands:
            raise ValueError(f"decimal and thousands are both '{self.decimal}'.")
        if self.time_format and "%" not in self.time_format and self.time_format not in TIME_FORMATS and not self.count:
            raise ValueError(
                f"time_format = '{self.time_format}' is unknown{nearest(self.time_format, TIME_FORMATS)} A pattern needs %,"
                " such as '%d.%m.%Y %H:%M:%S'."
            )
        if " %f" in self.time_format:
            raise ValueError(
                "time_format: %f takes 55 for 0.55; of a column of its own write '+ ms', or '+ us', at the end."
            )
        if self.data_line <= self.header_line or (self.last_line is not None and self.last_line < self.data_line):
            lines = f"{self.header_line}, {self.data_line}, {self.last_line}"
            raise ValueError(f"header_line, data_line and last_line must follow each other ({lines}).")
        if self.timezone is not None:
            _check_zone(self.timezone)

    @property
    def time(self) -> tuple[str, ...]:
        """The columns that make the time."""
        return (self.time_columns,) if isinstance(self.time_columns, str) else self.time_columns

    @property
    def sources(self) -> tuple[str, ...]:
        """All columns of the raw file that are read."""
        return (*self.time, *(column.source for column in self.columns))

    @property
    def added(self) -> str:
        """The unit of a last time column that holds a fraction of a second; "" where there is none."""
        unit = self.time_format.partition(" + ")[2]
        return unit if unit in SECONDS and len(self.time) > 1 else ""

    @property
    def count(self) -> tuple[float, float | None] | None:
        """What a numeric time counts: seconds of one, and the count in 1970 (None: from its own zero); None of other times."""
        number, _, unit = self.time_format.rpartition(" ")
        if unit in EPOCHS and not number:
            return EPOCHS[unit][:2]
        try:
            size = float(number or 1) * SECONDS.get(unit, 0.0)
        except ValueError:
            return None
        return (size, None) if 0 < size < float("inf") else None

    @property
    def counts_from_zero(self) -> bool:
        """Whether its times tell no date: numbers, or elapsed times."""
        return self.time_format in DURATIONS or (self.count is not None and self.count[1] is None)

    @property
    def data_line(self) -> int:
        """The first line with numbers."""
        return self.header_line + 1 if self.first_line is None else self.first_line


class ImportMap(Keys, frozen=True, kw_only=True):
    """A whole map."""

    schema: Annotated[str, says("kind of file")] = SCHEMA
    instrument: Annotated[str, says("goes into the record's header")] = ""
    source: Annotated[str, says("goes into the record's header")] = ""
    step: Annotated[float, number("regular time grid; without it the times of the first file", above=0.0)] | None = (
        msgspec.field(name="step_s", default=None)
    )
    target: Annotated[
        Literal["record", "table"], says("table: settled readings temperature_degC, frequency_Hz without a time")
    ] = "record"
    files: Annotated[tuple[FileMap, ...], says("one table for each raw file", least=1)] = msgspec.field(name="file")

    def __post_init__(self) -> None:
        if self.is_table and (len(self.files) > 1 or self.step is not None):
            raise ValueError("target = 'table' needs exactly one [[file]] and no step_s.")
        if self.files[0].same_file:
            raise ValueError("[[file]] number 1: there is no file before it; remove same_file.")
        for place, file in enumerate(self.files, 1):
            where, found = f"[[file]] number {place}", [column.target for column in file.columns]
            wrong = [one for one in found if one not in (TABLE_TARGETS if self.is_table else TARGETS)]
            lacking = [one for one in TABLE_TARGETS if one not in found]
            if wrong:
                known = nearest(wrong[0], TABLE_TARGETS if self.is_table else TARGETS)
                raise ValueError(f"{where}: to = '{wrong[0]}' is not a column of a {self.target}{known}")
            if self.is_table and lacking:
                raise ValueError(f"{where}: a table needs a column that becomes {' and one for '.join(lacking)}.")
            if self.is_table and (file.time or file.time_format or file.sample_period):
                raise ValueError(f"{where}: a table has no time; remove time, time_format and sample_period_s.")
            if not self.is_table and file.sample_period is None:
                for key in ("time", "time_format"):
                    if not getattr(file, key) and not (key == "time" and file.time_format == OWN):
                        raise ValueError(f"{where}: the key '{key}' is missing; add it.")
        self._check_single()

    def _check_single(self) -> None:
        """Refuse a column of the record that two columns fill."""
        seen: dict[tuple[str, str], int] = {}
        for place, file in enumerate(self.files, 1):
            for column in file.columns:
                for axis in {"", column.axis}:
                    if (column.target, axis) in seen and (axis or not column.axis):
                        raise ValueError(
                            f"'{column.target}' is assigned twice, by {seen[column.target, axis]} and {place}."
                        )
                seen[column.target, column.axis] = place

    @property
    def is_table(self) -> bool:
        """Whether it makes a table of settled readings."""
        return self.target == "table"

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that columns name, in their order; ("",) where none does."""
        named = dict.fromkeys(column.axis for file in self.files for column in file.columns if column.axis)
        return tuple(named) or ("",)


class LoadedMap(ImportMap, frozen=True, kw_only=True):
    """A map and the file that it came from."""

    path: str


def load_map(path: str | Path) -> LoadedMap:
    """Read a map."""
    keys = msgspec.structs.asdict(read_file(path, ImportMap, SCHEMA))
    texts: Mapping[str, str] = {key: " ".join(keys[key].split()) for key in ("instrument", "source")}
    return LoadedMap(**{**keys, **texts}, path=str(path))


def _check_zone(name: str) -> None:
    import zoneinfo

    try:
        zoneinfo.ZoneInfo(name)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise ValueError(
            f"timezone = '{name}' is unknown; use a name such as 'Europe/Berlin' or 'UTC' (a machine without a time"
            " zone database needs 'pip install tzdata')."
        ) from None
