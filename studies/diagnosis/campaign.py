"""A campaign: several records of one gyro, checked, freed of outliers and put on one even time grid."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from compensation.noise import white_rms
from compensation.spikes import find_spike_groups, find_spikes, find_step
from shell.constants import zero_Celsius
from studies.diagnosis.checks import FEWEST_BINS, check_device, check_units
from studies.diagnosis.drives import drives, stretches
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.steps import Steps
from studies.effects.states import FloatArray, States, average
from studies.errors import InputError
from studies.inference.sharp import RESOLVED, fast_line
from studies.record import Record, drop_repeats, place_in_time
from studies.record.rest import LEAST_SPIKE

TEMPERATURES = ("housing_temperature_degC", "chamber_temperature_degC", "resonator_temperature_degC")
COMMANDS = ("drive_amplitude_V", "electrode_bias_V", "quadrature_V", "pattern_angle_deg")
MOST_BINS = 800
FINEST = 40
MOST_RESOLVED, LONGEST_RUN = 3 * MOST_BINS, 1200
"""Bins for which a grid may be finer for such a line: of all runs, and of one, whose noise costs their third power."""


@dataclass(frozen=True)
class Run:
    """One unbroken stretch of a record on the even grid, with its own rows beside it.

    Attributes
    ----------
    record, label : int, str
        Number of the record it comes from, and its file name.
    states : States
        Drives and thermal state on the fine grid, `group` samples to a step of the coarse one.
    time : (N,) array
        Centres of the steps of the coarse grid, s.
    responses : mapping to (N,) arrays
        Means of the responses over the steps; NaN where there is no row.
    row_time, row_responses : (M,) arrays
        The record's own rows, outliers as NaN.
    clock_error : (N,) array or None
        Frequency by the gyro's clock minus that by a reference clock, where both were recorded, Hz.
    steps : Steps
        Which rows make which step of the coarse grid.
    """

    record: int
    label: str
    states: States
    time: FloatArray
    responses: dict[str, FloatArray]
    row_time: FloatArray
    row_responses: dict[str, FloatArray]
    steps: Steps
    clock_error: FloatArray | None = None

    def without_rows(self, column: str, outlying: "np.ndarray") -> "Run":
        """Return the run without some of the rows of a response."""
        rows = np.where(outlying, np.nan, self.row_responses[column])
        return replace(
            self,
            responses=self.responses | {column: self.steps.means(rows)},
            row_responses=self.row_responses | {column: rows},
        )


@dataclass(frozen=True)
class Campaign:
    """All runs of one gyro on one grid.

    `step` is that of the coarse grid and `sampling` that of the rows, s; `temperature_noise` that of one reading of the driving
    temperature, K.
    """

    runs: tuple[Run, ...]
    step: float
    group: int
    sampling: float
    responses: tuple[str, ...]
    reference: float
    temperature_source: str
    timed: bool
    notes: tuple[str, ...] = ()
    skipped: dict[str, str] = field(default_factory=dict)
    outliers: int = 0
    temperature_noise: float = 0.0

    @property
    def clock_known(self) -> bool:
        """Whether every run has a reference clock."""
        return bool(self.runs) and all(run.clock_error is not None for run in self.runs)

    @property
    def records(self) -> tuple[int, ...]:
        """Numbers of the records, each once."""
        return tuple(dict.fromkeys(run.record for run in self.runs))

    @property
    def said(self) -> tuple[str, ...]:
        """The notes, and how many values were left out."""
        if not self.outliers:
            return self.notes
        one = self.outliers == 1
        return (
            "1 outlying value was left out." if one else f"{self.outliers} outlying values were left out.",
            *self.notes,
        )

    def without_spikes(self, column: str, rests: Sequence[FloatArray]) -> "Campaign":
        """Leave out the rows of a response that stand out from what a model leaves, run by run, alone or two or three together.

        Before there was a model, a bend of the temperature or an uneven clock of the logger may have hidden them.
        """
        steps = [find_step(run.row_responses[column]) for run in self.runs]
        spikes = [
            find_spikes(rest, step=step) | find_spike_groups(rest, step)
            for rest, step in zip(rests, steps, strict=True)
        ]
        count = sum(int(own.sum()) for own in spikes)
        if not count:
            return self
        runs = [run.without_rows(column, own) if own.any() else run for run, own in zip(self.runs, spikes, strict=True)]
        return replace(self, runs=tuple(runs), outliers=self.outliers + count)


def load_campaign(records: Sequence[Record], reference_degC: float | None = None) -> Campaign:
    """Check several records of one gyro and put them on one even grid.

    Outlying rows (see `find_spikes`) are left out of fit and score alike.

    Raises
    ------
    InputError
        If the records disagree about the gyro, lack a temperature or a response, or use another unit.
    """
    notes: list[str] = []
    if not records:
        raise InputError("no records given; a diagnosis needs at least one.")
    records, repeated = drop_repeats(records)
    notes += repeated
    source = _temperature_source(records)
    tables = [_columns(record, source) for record in records]
    check_units(records, tables)
    check_device(records, tables)
    outliers = sum(_remove_outliers(table) for table in tables)
    responses, skipped = _usable_responses(records, tables)
    offsets, timed = place_in_time(records)
    if not timed and len(records) > 1:
        notes.append("Not every record states its start; the records are treated as consecutive, with unknown gaps.")
    spans = [float(table["time_s"][-1] - table["time_s"][0]) for table in tables]
    sampling = max(float(np.median(np.diff(table["time_s"]))) if table["time_s"].size > 1 else 1.0 for table in tables)
    # whole rows to a bin: the mean of rows is then compared with the mean of the model at the same moments
    rows = max(1, round(sum(spans) / MOST_BINS / sampling))
    for name in responses:
        readings = [(table["time_s"], table[name]) for table in tables if name in table]
        line = fast_line(readings, sampling, rows * sampling, white_rms(*(values for _, values in readings)))
        if line is not None and line.period / RESOLVED > max(sum(spans) / MOST_RESOLVED, max(spans) / LONGEST_RUN):
            rows = min(rows, max(1, int(line.period / RESOLVED / sampling)))
    whole = -(-rows // FINEST)
    group = -(-rows // whole)
    step = sampling * group * whole
    temperature = np.concatenate([table["temperature"] for table in tables])
    reading = max(_reading_noise(table["temperature"]) for table in tables)
    if not np.isfinite(temperature).any():
        raise InputError(f"{records[0].path}: {source} has no values.")
    middle = 0.5 * (np.nanmin(temperature) + np.nanmax(temperature)) + zero_Celsius
    reference = middle if reference_degC is None else reference_degC + zero_Celsius
    runs: list[Run] = []
    for number, (record, table, offset) in enumerate(zip(records, tables, offsets, strict=True)):
        for begin, end in stretches(table):
            run = _grid_run(
                number,
                len(runs),
                record.path or f"run {number + 1}",
                {key: values[begin:end] for key, values in table.items()},
                sampling,
                whole,
                group,
                offset,
                reference,
                responses,
            )
            if run is not None:
                runs.append(run)
    if not runs:
        skipped |= dict.fromkeys(responses, "too few rows in every run")
        responses = ()
    parts = Counter(run.label for run in runs)
    notes += [
        f"{label}: long gaps split it into {count} parts, each with an unknown initial temperature."
        for label, count in parts.items()
        if count > 1
    ]
    drives = ("amplitude_squared", "voltage_squared", "quadrature", "pattern_angle")
    for drive, column in zip(drives, COMMANDS, strict=True):
        if len({getattr(run.states, drive) is None for run in runs}) > 1:
            notes.append(f"{column} is not in every record and was left out.")
            runs = [_without(run, drive) for run in runs]
    return Campaign(
        tuple(runs),
        step,
        group,
        sampling,
        responses,
        float(reference),
        source,
        timed,
        tuple(notes),
        skipped,
        outliers,
        reading,
    )


def longest_resolved(period: float) -> float:
    """Return the length of a record, s, whose grid resolves a line."""
    return LONGEST_RUN * period / RESOLVED


def _reading_noise(temperature: FloatArray) -> float:
    """Return the noise of one reading, K: from second differences, and at least what its rounding makes."""
    known = temperature[np.isfinite(temperature)]
    steps = np.abs(np.diff(known))
    rounding = float(steps[steps > 1e-9].min()) / np.sqrt(12.0) if (steps > 1e-9).any() else 0.0
    white = white_rms(known)
    distinct = np.unique(known).size
    return float(max(white, rounding)) if distinct < 0.5 * known.size else white


def _without(run: Run, drive: str) -> Run:
    return replace(run, states=replace(run.states, **{drive: None}))  # type: ignore[arg-type]


def _temperature_source(records: Sequence[Record]) -> str:
    for name in TEMPERATURES:
        if all(name in record and np.isfinite(record[name]).sum() > 1 for record in records):
            return name
    lacking = next(
        (r for r in records if not any(n in r and np.isfinite(r[n]).sum() > 1 for n in TEMPERATURES)), records[0]
    )
    raise InputError(
        f"{lacking.path or 'record'}: a diagnosis needs housing_temperature_degC or chamber_temperature_degC, "
        "the same one in every record."
    )


def _columns(record: Record, source: str) -> dict[str, FloatArray]:
    table = {"time_s": np.asarray(record["time_s"], dtype=float).copy(), "temperature": record[source].copy()}
    for name in (*RESPONSES, *COMMANDS):
        if name in record and np.isfinite(record[name]).any():
            table[name] = np.asarray(record[name], dtype=float).copy()
    if "bias_deg_per_h" not in table and "measured_rate_deg_per_s" in record:
        applied = record.columns.get("rate_deg_per_s", 0.0)
        table["bias_deg_per_h"] = 3600.0 * (record["measured_rate_deg_per_s"] - applied)
    if "reference_frequency_Hz" in record and np.isfinite(record["reference_frequency_Hz"]).any():
        table["reference_frequency_Hz"] = np.asarray(record["reference_frequency_Hz"], dtype=float).copy()
    table["time_s"] -= table["time_s"][0]
    return table


def _remove_outliers(table: dict[str, FloatArray]) -> int:
    """Set outlying rows of every measured column to NaN and return how many there were."""
    count = 0
    for name in ("temperature", *RESPONSES, "reference_frequency_Hz"):
        if name not in table:
            continue
        outlying = find_spikes(table[name], LEAST_SPIKE if name == "temperature" else 0.0)
        table[name][outlying] = np.nan
        count += int(outlying.sum())
    return count


def _usable_responses(
    records: Sequence[Record], tables: Sequence[dict[str, FloatArray]]
) -> tuple[tuple[str, ...], dict[str, str]]:
    usable, skipped = [], {}
    constant = np.nanmax([np.ptp(t["temperature"][np.isfinite(t["temperature"])]) for t in tables]) == 0.0
    for name in RESPONSES:
        values = np.concatenate([table[name] for table in tables if name in table] or [np.empty(0)])
        values = values[np.isfinite(values)]
        if values.size == 0:
            if any(name in record.columns for record in records):
                skipped[name] = "every value is missing"
        elif values.size < FEWEST_BINS:
            skipped[name] = f"only {values.size} values"
        elif np.ptp(values) == 0.0:
            skipped[name] = "constant"
        elif constant:
            skipped[name] = "the temperature never changes (is the sensor stuck?)"
        else:
            usable.append(name)
    if not usable and not skipped:
        raise InputError(f"{records[0].path or 'record'}: a diagnosis needs frequency_Hz, bias_deg_per_h or inverse_q.")
    return tuple(usable), skipped


def _grid_run(
    record: int,
    run: int,
    label: str,
    table: dict[str, FloatArray],
    sampling: float,
    whole: int,
    group: int,
    offset: float,
    reference: float,
    responses: Sequence[str],
) -> Run | None:
    time = table["time_s"]
    step = whole * sampling
    begin = time[0] + 0.5 * (step - sampling)  # the rows of a step lie about its centre, not before it
    slot = np.floor((time - begin) / step + 0.5).astype(int)
    fine = begin + step * np.arange(slot[-1] + 2)  # beyond the last row
    coarse = average(fine, group)
    if coarse.size < 5 or time.size < 6:
        return None
    commands = [table[name] for name in COMMANDS if name in table]
    steps = Steps.of(time, slot // group, coarse, fine.size == coarse.size * group, commands)
    clock_error = None
    if "reference_frequency_Hz" in table and "frequency_Hz" in table:
        clock_error = steps.means(table["frequency_Hz"] - table["reference_frequency_Hz"])
    return Run(
        record,
        label,
        drives(run, record, fine, whole, offset, reference, table),
        coarse,
        {name: steps.means(table[name]) if name in table else np.full(coarse.size, np.nan) for name in responses},
        time,
        {name: table.get(name, np.full(time.shape, np.nan)) for name in responses},
        steps,
        clock_error,
    )
