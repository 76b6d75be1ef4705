"""The map of an import, `schema = "hrg.map/1"`: what each raw file's columns are and how they become a record.

```toml
schema = "hrg.map/1"
instrument = "unit 7"            # optional: goes into the record's header, as does source = "..."
step_s = 1.0                     # optional: a regular time grid; without it the times of the first file
target = "record"                # "record", or "table": settled readings temperature_degC, frequency_Hz without a time

[[file]]                         # one table for each raw file, in the order of the command line
separator = ";"                  # ";" "," "tab" "|" "space"
decimal = ","                    # "." or ","
encoding = "utf-8"               # utf-8, utf-16, cp1252, latin-1
header_line = 1                  # the line with the column names; 0: there is none, the columns are "column 1", "column 2" …
data_line = 2                    # the first line with numbers; default: the line after the header
last_line = 9000                 # optional: what follows is not data
sheet = "Sheet1"                 # Excel workbooks only
missing = ["---", "OVL"]         # cells that mean "no value", besides empty ones
time = "Zeit"                    # the column with the time; ["Datum", "Zeit"] joins two with a blank
time_format = "s"                # s, ms, us, ns, min, h, days, unix-s, unix-ms, unix-us, unix-ns, excel-days, iso, or a pattern such as
                                 # "%d.%m.%Y %H:%M:%S"
sample_period_s = 0.1            # instead of time and time_format: rows without a time, evenly spaced
timezone = "Europe/Berlin"       # optional: of stamps that do not state one; the hour that comes twice is told by the order of rows
parts = 3                        # files that continue one another, such as days; default: 1, or all files with a single [[file]]
start = 2026-01-31T12:00:00      # optional: when a clock that counts from 0 was started
clock_offset_s = 0.0             # added to this file's times: positive when its clock is behind
clock_rate_ppm = 0.0             # by how much its clock runs fast
repeated_times = "error"         # error | first (keep the first row) | spread (evenly up to the next time)
longest_gap_s = 10.0             # nothing is interpolated across longer gaps; default: 10 sampling steps

[[file.column]]
from = "T Gehäuse [K]"           # the name in the raw file
to = "housing_temperature_degC"  # the column of the record
unit = "K"                       # see studies.importing.units, or as people write it: "°C", "°/s", "mdps", "ppm of 4432.07 Hz";
                                 # (reading × scale + offset) is in this unit
scale = 1.0
offset = 0.0
sign = 1                         # -1 turns the converted value's sign
resample = "linear"              # linear | mean | nearest | previous
axis = "x"                       # optional: one record for each axis, with the columns that have none in all of them
# unit "period-counts" needs clock_Hz and periods, "gate-counts" needs gate_s, "ppm" and "ppb" need nominal_Hz
```
"""

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, cast

from studies.errors import InputError, nearest
from studies.files.toml import TomlTable
from studies.importing.units import SETTINGS, TARGETS, Unit, find_spelling, split_nominal, units_of
from studies.schema.reader import read_toml

SCHEMA = "hrg.map/1"
SEPARATORS = {";": ";", ",": ",", "tab": "\t", "|": "|", "space": r"\s+"}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "days": 86400.0}
UNIX = {"unix-s": 1.0, "unix-ms": 1e-3, "unix-us": 1e-6, "unix-ns": 1e-9}
NUMERIC_TIMES = (*SECONDS, *UNIX, "excel-days")
TIME_FORMATS = (*NUMERIC_TIMES, "iso")
ENCODINGS = ("utf-8", "utf-16", "cp1252", "latin-1")
FILE_KEYS = (
    "separator",
    "decimal",
    "encoding",
    "header_line",
    "data_line",
    "last_line",
    "sheet",
    "missing",
    "time",
    "time_format",
    "sample_period_s",
    "timezone",
    "start",
    "clock_offset_s",
    "clock_rate_ppm",
    "repeated_times",
    "longest_gap_s",
    "parts",
    "column",
)
COLUMN_KEYS = ("from", "to", "unit", "scale", "offset", "sign", "resample", "axis", *SETTINGS)
TABLE_TARGETS = ("temperature_degC", "frequency_Hz")
RESAMPLING = ("linear", "mean", "nearest", "previous")

Resampling = Literal["linear", "mean", "nearest", "previous"]


@dataclass(frozen=True)
class ColumnMap:
    """One raw column and what it becomes: sign × unit(reading × scale + offset)."""

    source: str
    target: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    sign: float = 1.0
    resample: Resampling = "linear"
    settings: tuple[float, ...] = ()
    axis: str = ""

    @property
    def conversion(self) -> Unit:
        """The unit's conversion."""
        return units_of(self.target)[self.unit]


@dataclass(frozen=True)
class FileMap:
    """One raw file: its notation, its clock, its columns. The keys are those of the module's docstring."""

    columns: tuple[ColumnMap, ...]
    time: tuple[str, ...]
    time_format: str
    separator: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    header_line: int = 1
    data_line: int = 2
    last_line: int | None = None
    sheet: str | None = None
    missing: tuple[str, ...] = ()
    start: datetime.datetime | None = None
    clock_offset: float = 0.0
    clock_rate: float = 0.0
    repeated_times: str = "error"
    longest_gap: float | None = None
    sample_period: float | None = None
    timezone: str | None = None
    parts: int | None = None


@dataclass(frozen=True)
class ImportMap:
    """A whole map: the files in the order of the command line, and what the record's header shall say."""

    files: tuple[FileMap, ...]
    step: float | None = None
    instrument: str = ""
    source: str = ""
    is_table: bool = False
    path: str = field(default="", compare=False)

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that columns name, in their order; ("",) where none does."""
        named = dict.fromkeys(column.axis for file in self.files for column in file.columns if column.axis)
        return tuple(named) or ("",)


def load_map(path: str | Path) -> ImportMap:
    """Read a map.

    Raises
    ------
    InputError
        Unknown keys, units or columns, missing or impossible values: the message names the place and the mend.
    """
    top = TomlTable(read_toml(path, SCHEMA), str(path), ("schema", "instrument", "source", "step_s", "target", "file"))
    is_table = top.text("target", "record", ("record", "table")) == "table"
    files = tuple(_read_file(section, is_table) for section in top.sections("file", FILE_KEYS))
    if not files:
        raise InputError(f"{path}: a table [[file]] is missing; 'hrg import RAW --draft MAP.toml' drafts one.")
    step = top.number("step_s", above=0.0) if "step_s" in top else None
    if is_table and (len(files) > 1 or step is not None):
        raise InputError(f"{path}: target = 'table' needs exactly one [[file]] and no step_s.")
    seen: dict[tuple[str, str], int] = {}
    for number, file in enumerate(files, 1):
        for column in file.columns:
            for axis in {"", column.axis}:
                if (column.target, axis) in seen and (axis or not column.axis):
                    raise InputError(
                        f"{path}: '{column.target}' is assigned twice, by [[file]] {seen[column.target, axis]} and {number}."
                    )
            seen[column.target, column.axis] = number
    return ImportMap(files, step, _text(top, "instrument"), _text(top, "source"), is_table, str(path))


def _read_file(section: TomlTable, is_table: bool) -> FileMap:
    where = section.where
    targets = TABLE_TARGETS if is_table else TARGETS
    columns = tuple(_read_column(part, targets) for part in section.sections("column", COLUMN_KEYS))
    if not columns:
        raise InputError(f"{where}: a [[file.column]] table that assigns a column is missing; add one.")
    missing = [target for target in TABLE_TARGETS if target not in {column.target for column in columns}]
    if is_table and missing:
        raise InputError(f"{where}: a table needs a column that becomes {' and one that becomes '.join(missing)}.")
    period = section.number("sample_period_s", above=0.0) if "sample_period_s" in section else None
    timed = period is None and not is_table
    if not timed and ("time" in section or "time_format" in section):
        why = "sample_period_s is given" if period else "a table has no time"
        raise InputError(f"{where}: {why}; remove time and time_format.")
    if is_table and period is not None:
        raise InputError(f"{where}: a table has no time; remove sample_period_s.")
    header = _line(section, "header_line", 1, least=0)
    data = _line(section, "data_line", header + 1)
    last = _line(section, "last_line", 0) if "last_line" in section else None
    if data <= header or (last is not None and last < data):
        raise InputError(
            f"{where}: header_line, data_line and last_line must follow each other ({header}, {data}, {last})."
        )
    return FileMap(
        columns,
        _read_time(section) if timed else (),
        _read_time_format(section) if timed else "s",
        section.text("separator", ",", tuple(SEPARATORS)),
        section.text("decimal", ".", (".", ",")),
        section.text("encoding", "utf-8", ENCODINGS),
        header,
        data,
        last,
        _text(section, "sheet") or None,
        _read_missing(section),
        _read_start(section),
        section.number("clock_offset_s", 0.0, least=-1e9, most=1e9),
        section.number("clock_rate_ppm", 0.0, least=-1e5, most=1e5) * 1e-6,
        section.text("repeated_times", "error", ("error", "first", "spread")),
        section.number("longest_gap_s", above=0.0) if "longest_gap_s" in section else None,
        period,
        _read_timezone(section),
        _line(section, "parts", 1) if "parts" in section else None,
    )


def _read_column(section: TomlTable, targets: Sequence[str]) -> ColumnMap:
    target = section.text("to")
    if target not in targets:
        what = "table" if targets is TABLE_TARGETS else "record"
        raise InputError(f"{section.where}: to = '{target}' is not a column of a {what}{nearest(target, targets)}")
    units: Mapping[str, Unit] = units_of(target)
    stated, nominal = split_nominal(section.text("unit"))
    unit = find_spelling(target, stated) or section.text("unit", choices=tuple(units))
    settings = tuple(
        nominal if nominal and key not in section else section.number(key, above=0.0) for key in units[unit].settings
    )
    for key in SETTINGS:
        if key in section and key not in units[unit].settings:
            raise InputError(f"{section.where}: {key} cannot be combined with unit = '{unit}'; remove it.")
    scale = section.number("scale", 1.0)
    if scale == 0:
        raise InputError(f"{section.where}: scale must not be 0.")
    sign = section.number("sign", 1.0)
    if sign not in (1.0, -1.0):
        raise InputError(f"{section.where}: sign must be 1 or -1, not {sign:g}.")
    usual = "nearest" if target == "pattern_angle_deg" else "linear"  # an angle may jump by a turn
    resample = cast("Resampling", section.text("resample", usual, RESAMPLING))
    offset = section.number("offset", 0.0)
    axis = section.text("axis") if "axis" in section else ""
    if axis and not axis.isalnum():
        raise InputError(f"{section.where}: axis = '{axis}' becomes part of a file name; use letters and digits only.")
    return ColumnMap(section.text("from"), target, unit, scale, offset, sign, resample, settings, axis)


def _read_time(section: TomlTable) -> tuple[str, ...]:
    value = section.raw("time")
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(f"{section.where}: time must be a column name, or a list of names to join, not {value!r}.")
    return tuple(names)


def _read_time_format(section: TomlTable) -> str:
    found = section.text("time_format")
    if "%" not in found and found not in TIME_FORMATS:
        raise InputError(
            f"{section.where}: time_format = '{found}' is unknown{nearest(found, TIME_FORMATS)} A pattern needs %, such as"
            " '%d.%m.%Y %H:%M:%S'."
        )
    return found


def _read_missing(section: TomlTable) -> tuple[str, ...]:
    cells = section.raw("missing", [])
    if not isinstance(cells, list) or not all(isinstance(cell, str) for cell in cells):
        raise InputError(f"{section.where}: missing must be a list of texts, such as ['---'], not {cells!r}.")
    return tuple(cells)


def _read_start(section: TomlTable) -> datetime.datetime | None:
    if "start" not in section:
        return None
    value = section.raw("start")
    if isinstance(value, str):
        try:
            value = datetime.datetime.fromisoformat(value)
        except ValueError:
            value = None
    if not isinstance(value, datetime.datetime):
        raise InputError(f"{section.where}: start must be a time such as 2026-01-31T12:00:00.")
    return value


def _read_timezone(section: TomlTable) -> str | None:
    if "timezone" not in section:
        return None
    import zoneinfo

    name = section.text("timezone")
    try:
        zoneinfo.ZoneInfo(name)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise InputError(
            f"{section.where}: timezone = '{name}' is unknown; use a name such as 'Europe/Berlin' or 'UTC'"
            " (a machine without a time zone database needs 'pip install tzdata')."
        ) from None
    return name


def _line(section: TomlTable, key: str, default: int, least: int = 1) -> int:
    value = section.raw(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= 10**9:
        raise InputError(f"{section.where}: {key} must be a whole number from {least} up, not {value!r}.")
    return value


def _text(section: TomlTable, key: str) -> str:
    return " ".join(section.text(key).split()) if key in section else ""
