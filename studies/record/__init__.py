"""Records of a gyro, steady-state tables and chamber profiles: columns named as in the file, with their units; NaN is missing."""

import datetime
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.errors import InputError, nearest
from studies.files.columns import Columns, read_columns, read_header
from studies.files.parquet import is_parquet, write_table
from studies.files.writing import write_rows, written_whole
from studies.progress import tell
from studies.results import Drawing

if TYPE_CHECKING:
    from pandas import DataFrame


COLUMNS = {
    "time_s": "time since the start of the run",
    "housing_temperature_degC": "temperature sensor on the housing",
    "chamber_temperature_degC": "chamber set point or air",
    "resonator_temperature_degC": "temperature of the resonator (simulated, or from its frequency)",
    "frequency_Hz": "n = 2 frequency by the gyro's clock",
    "reference_frequency_Hz": "n = 2 frequency by an external clock",
    "bias_deg_per_h": "zero-rate output",
    "measured_rate_deg_per_s": "rate output",
    "output_counts": "raw output",
    "rate_deg_per_s": "applied rate",
    "inverse_q": "1/Q of the drive mode",
    "drive_amplitude_V": "commanded vibration amplitude",
    "vibration_amplitude_V": "measured vibration amplitude, as in a run-down",
    "electrode_bias_V": "polarisation or trim voltage",
    "quadrature_V": "quadrature-control effort",
    "pattern_angle_deg": "azimuth of the standing wave",
}
PARTS = ("cos", "sin")  # pick-offs of a free decay
RAW = tuple(f"pickoff_{part}_V" for part in PARTS)
POLAR = tuple((f"amplitude_{part}_V", f"phase_{part}_deg") for part in PARTS)
CARTESIAN = tuple((f"in_phase_{part}_V", f"out_of_phase_{part}_V") for part in PARTS)
POWERS = ("power_dBm", "power_dB", "power_W")
DECAYS = (*RAW, *(name for pair in (*POLAR, *CARTESIAN) for name in pair), *POWERS)
"""Columns of `hrg fit ringdown`, beside the time."""
OUTPUTS = ("frequency_Hz", "bias_deg_per_h", "measured_rate_deg_per_s", "output_counts", "inverse_q")
LOWEST = 20.0  # Hz, of a resonator's table
FAR = 0.7  # of ln f from the median of a table: a factor of two
COMPENSATED = "compensated_"
COMMANDED = ("chamber_temperature_degC", "rate_deg_per_s", "drive_amplitude_V", "electrode_bias_V")  # may stand still
RESONATOR = "resonator_temperature_degC"
LIMITS = {
    # what a column can be, by the end of its name: lowest, highest
    "_degC": (-200.0, 200.0),
    "_Hz": (1e-6, 1e12),  # 0 is a dropout of the counter
    "_deg_per_h": (-1e10, 1e10),
    "_deg_per_s": (-1e6, 1e6),
    "_V": (-1e5, 1e5),
    "_deg": (-1e9, 1e9),
    "inverse_q": (-1e-3, 1e-2),  # noise about a small value
}
TABLE_COLUMNS = ("temperature_degC", "frequency_Hz")
PROFILE_COLUMNS = ("time_s", "chamber_temperature_degC")


@dataclass(frozen=True, repr=False)
class Record:
    """One run: its columns by name, and what its comment lines say of it."""

    columns: Mapping[str, Array]
    path: str = ""
    sha256: str = ""
    instrument: str = ""
    source: str = ""
    start: datetime.datetime | None = None
    resolution: Mapping[str, float] = field(default_factory=dict)
    comments: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Array:
        if name not in self.columns:
            raise InputError(f"{self.path or 'record'}: column '{name}' is missing; it has {', '.join(self.columns)}.")
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    def has_values(self, name: str) -> bool:
        """Whether it has a column with a value in it."""
        return name in self.columns and bool(np.isfinite(self.columns[name]).any())

    def __repr__(self) -> str:
        time = self.columns.get("time_s")
        span = f" over {(time[-1] - time[0]) / 3600:.3g} h" if time is not None and len(time) > 1 else ""
        return f"Record({self.path or self.instrument or 'in memory'!s}, {len(self)} rows{span}: {', '.join(self.columns)})"

    @property
    def moment(self) -> float | None:
        """When it starts, s, POSIX, where it says so."""
        try:
            return None if self.start is None else self.start.timestamp()
        except (OverflowError, OSError):
            return None

    @property
    def notes(self) -> list[str]:
        """What the header says of the record, a line each."""
        said = {"instrument": _one_line(self.instrument), "source": _one_line(self.source)}
        said |= {"start": self.start.isoformat() if self.start else ""}
        said |= {f"resolution {name}": repr(value) for name, value in self.resolution.items()}
        return [*self.comments, *(f"{name}: {words}" for name, words in said.items() if words)]

    def to_frame(self) -> "DataFrame":
        """Return the columns as a table; what the header says is in its `attrs`."""
        import pandas as pd

        frame = pd.DataFrame(dict(self.columns))
        frame.attrs = {"instrument": self.instrument, "source": self.source, "path": self.path, "comments": self.notes}
        return frame

    def plot(self) -> Drawing:
        """Draw every column over time."""
        from studies.reports.columns import draw_columns

        return draw_columns(self.columns)

    def _repr_html_(self) -> str:
        from html import escape

        return f"<p>{escape(repr(self))}</p>{self.to_frame().describe().to_html()}"

    def with_columns(self, more: Mapping[str, Array]) -> "Record":
        """Return a new record with further (or replaced) columns."""
        return replace(self, columns={**self.columns, **more})


Run: TypeAlias = "Record | str | Path | DataFrame"


def with_bias(record: Record) -> Record:
    """Return a record with a bias: its own, or else its rate output less the applied rate."""
    if "bias_deg_per_h" in record or "measured_rate_deg_per_s" not in record:
        return record
    applied = record.columns.get("rate_deg_per_s", 0.0)
    return record.with_columns({"bias_deg_per_h": np.asarray(3600.0 * (record["measured_rate_deg_per_s"] - applied))})


def place_in_time(records: Sequence[Record]) -> tuple[list[float], bool]:
    """Return when each run starts (s) since the first of them, and whether the records say so; else one follows the other."""
    moments = [moment for record in records if (moment := record.moment) is not None]
    if len(set(moments)) == len(records):
        return [moment - min(moments) for moment in moments], True
    offsets, now = [], 0.0
    for record in records:
        offsets.append(now)
        now += float(record["time_s"][-1] - record["time_s"][0])
    return offsets, False


def names_of(run: Run) -> list[str]:
    """Return the columns of a run or a table, without reading its numbers."""
    return [*run.columns] if isinstance(run, Record) else read_header(run)


def is_table(run: Run) -> bool:
    """Return whether it is a steady-state table (temperature_degC, no time_s)."""
    names = names_of(run)
    return "time_s" not in names and "temperature_degC" in names


def read_record(path: "Run") -> Record:
    """Read one run: from a file, or from a table as `to_frame` gives it; a record is what it is."""
    if isinstance(path, Record):
        return path
    if is_table(path):
        raise InputError(
            f"{path if isinstance(path, str | Path) else 'table'}: this is a steady-state table (no time_s), but a record in time is needed."
        )
    table = read_columns(path, COLUMNS, required=("time_s",), prefixes=(COMPENSATED,))
    table.refuse(np.isnan(table.values["time_s"]), "time_s is empty; every row needs its time.")
    time = table.values["time_s"]
    again = "time_s starts over: where a second run begins, split the file here; each run is a file of its own."
    sort = "time_s does not increase; sort the rows and remove repeated ones."
    table.check_order("time_s", lambda row: again if row > 1 and time[row] <= time[0] else sort)
    check_plausible(table.values, table.place)
    notes = _read_notes(table.path, table)
    return Record(table.values, table.path, table.sha256, **notes)  # type: ignore[arg-type]


def place_of_largest(path: str, name: str) -> str:
    """Return file and line of the largest magnitude in a column of a record or profile, for a message."""
    table = read_columns(path, COLUMNS, required=(name,), prefixes=(COMPENSATED,))
    return table.place(int(np.nanargmax(np.abs(table.values[name]))))


def read_frequency_table(path: Run) -> Columns:
    """Read a steady-state table `temperature_degC,frequency_Hz` (HRG paper, Table 1); no value may be missing."""
    if isinstance(path, Record):
        raise InputError(f"{path.path}: this is a record, but a table of settled points is needed.")
    table = read_columns(path, TABLE_COLUMNS, required=TABLE_COLUMNS)
    table.require(TABLE_COLUMNS, "a steady-state table")
    check_plausible(table.values, table.place)
    f = table.values["frequency_Hz"]
    usual = float(np.median(f))
    refuse_kilohertz(table)
    far = f"is far from the others (median {usual:.6g} Hz); correct or remove the line."
    table.refuse(np.abs(np.log(f / usual)) > FAR, lambda row: f"frequency_Hz = {f[row]:g} {far}")
    return table


def refuse_kilohertz(table: Columns) -> None:
    """Refuse a resonator's frequencies that are too low for hertz."""
    f = table.values["frequency_Hz"]
    table.refuse(f < LOWEST, lambda row: f"frequency_Hz = {f[row]:g} looks like kHz; multiply the column by 1000.")


def reading_resolution(values: Array) -> float:
    """Return the step of readings that were rounded to decimals, one unit of the last digit that any shows, or to doubles."""
    decimals = max(len(repr(float(value)).partition(".")[2].rstrip("0")) for value in values)
    return max(float(10.0**-decimals), float(np.finfo(float).eps * np.max(np.abs(values))))


def read_profile(path: "str | Path | DataFrame") -> Columns:
    """Read a chamber profile `time_s,chamber_temperature_degC`, linear between its rows."""
    table = read_columns(path, PROFILE_COLUMNS, required=PROFILE_COLUMNS)
    table.require(PROFILE_COLUMNS, "a profile")
    time = table.values["time_s"]
    twice = "time_s does not increase, it is there twice: for a jump, let the second row come a moment later, such as 0.001 s."
    table.check_order("time_s", lambda row: twice if row and time[row] == time[row - 1] else "time_s goes back; sort the rows.")  # fmt: skip
    check_plausible(table.values, table.place)
    return table


def write_record(run: Run, path: str | Path) -> None:
    """Write one run, whole or not at all, as CSV or (by the end of its name) Parquet."""
    record = read_record(run)
    notes = record.notes
    with written_whole(path) as file:
        if is_parquet(path):
            write_table(file, record.columns, notes, path)
            return
        file.write("".join(f"{note}\n" for note in [*(f"# {n}" for n in notes), ",".join(record.columns)]).encode())
        for part in write_rows(file, record.columns):
            tell(f"writing {path}", part)


def check_plausible(
    columns: Mapping[str, Array],
    where: Callable[[int], str],
    mend: str = "leave the cell empty where the value is missing",
) -> None:
    """Refuse readings that no instrument gives, naming the first; `where` tells the place of a row."""
    for name, values in columns.items():
        wrong = find_impossible(name, values)
        if wrong.any():
            low, high = _limits(name)
            row = int(wrong.argmax())
            kelvin = name.endswith("_degC") and 200 < values[row] < 500
            hint = "it looks like kelvin, subtract 273.15" if kelvin else "check its unit"
            raise InputError(
                f"{where(row)}: {name} = {values[row]:g} is not a possible reading (allowed: {low:g} to {high:g}); {hint}, or {mend}."
            )


def find_impossible(name: str, values: Array) -> NDArray[np.bool_]:
    """Mark readings (N,) of a column that no instrument gives."""
    low, high = _limits(name)
    return np.asarray((values < low) | (values > high))


def _limits(name: str) -> tuple[float, float]:
    return next((ends for ending, ends in LIMITS.items() if name.endswith(ending)), (-np.inf, np.inf))


def _read_notes(path: str | Path, table: Columns) -> dict[str, object]:
    notes: dict[str, object] = {}
    resolution: dict[str, float] = {}
    free: list[str] = []
    for comment in table.comments:
        key, colon, value = (part.strip() for part in comment.partition(":"))
        if colon and key in ("instrument", "source"):
            notes[key] = value
        elif colon and key == "start":
            try:
                notes["start"] = datetime.datetime.fromisoformat(value)
            except ValueError:
                example = "2026-01-31T12:00:00"
                raise InputError(f"{path}: '# start: {value}' is not an ISO 8601 time such as {example}.") from None
        elif colon and key.startswith("resolution "):
            column = key.removeprefix("resolution ").strip()
            if column not in COLUMNS:
                raise InputError(f"{path}: '# {comment}' names no column{nearest(column, COLUMNS)}")
            try:
                resolution[column] = float(value)
            except ValueError:
                raise InputError(f"{path}: '# {comment}' needs a number after the colon.") from None
            if not 0 < resolution[column] < float("inf"):
                raise InputError(f"{path}: '# {comment}' needs a positive number.")
        else:
            free.append(comment)
    return {**notes, "resolution": resolution, "comments": tuple(free)}


def _one_line(text: str) -> str:
    return " ".join(text.split())
