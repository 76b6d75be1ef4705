"""Many decays of one resonator: a table of what they gave, its laws, and a record of it for calibration and diagnosis.

A table of decays has a row for each reading and the columns `frequency_Hz`, `inverse_q` (either or both), and what is known of
`time_s`, `housing_temperature_degC`, `pressure_Pa` and `vibration_amplitude_V` (any unit). With the column `decay`, a
number, several rows are readings of one decay, as a counter gives while the amplitude falls; without it every row is a decay.
"""

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.ringdown.laws import Law, Rows, fit_law
from studies.errors import InputError, naming
from studies.files.columns import read_columns
from studies.fits.ringdown import Decay, header_of
from studies.record import COLUMNS as RUN
from studies.record import POWERS, Record, check_plausible, write_record

TEMPERATURE, AMPLITUDE = "housing_temperature_degC", "vibration_amplitude_V"
RESPONSES = ("frequency_Hz", "inverse_q")
COLUMNS = ("decay", "time_s", *RESPONSES, TEMPERATURE, "pressure_Pa", AMPLITUDE)
LEAST = 4
SMOOTHED = 8
"""Readings of a decay from which their amplitudes are replaced by a parabola of their logarithm: a reading errs, a decay does not jump."""


@dataclass(frozen=True)
class Decays:
    """Readings under the names of a table's columns, NaN where nothing is known, with standard deviations of frequency and 1/Q (relative)."""

    columns: Mapping[str, Array]
    sd: Mapping[str, Array]
    start: float | None = None
    path: str = ""


def is_table(path: str | Path) -> bool:
    """Return whether a file is a table of decays."""
    header = header_of(path)
    return bool(header & set(RESPONSES)) and not header & set(POWERS)


def read_table(path: str | Path) -> Decays:
    """Read a table of decays."""
    if others := sorted(header_of(path) & set(RUN) - set(COLUMNS)):
        raise InputError(f"{path}: the column {others[0]} is one of a run, and this command takes free decays: give a run to hrg calibrate or hrg diagnose; of a table of decays leave it out.")  # fmt: skip
    table = read_columns(path, COLUMNS)
    check_plausible(table.values, table.place)
    if "time_s" in table.values:
        table.check_order("time_s", "time_s is empty or does not increase; sort the rows.")
    return Decays(dict(table.values), {}, path=str(path))


def table_of(decays: Sequence[Decay]) -> Decays:
    """Return what decays gave, a row each, in the order of time where all say when they began."""
    starts = [decay.notes.get("start_s") for decay in decays]
    known = [start for start in starts if start is not None]
    first = min(known) if len(known) == len(decays) else None
    if first is not None:
        decays = sorted(decays, key=lambda decay: decay.notes["start_s"])

    def column(values: Sequence[float | None]) -> Array:
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    columns = {
        "time_s": column([None if first is None else decay.notes["start_s"] - first for decay in decays]),
        "frequency_Hz": column([decay.frequency for decay in decays]),
        "inverse_q": column([None if decay.inverse_q is None else decay.inverse_q.value for decay in decays]),
        TEMPERATURE: column([decay.notes.get("temperature_degC") for decay in decays]),
        "pressure_Pa": column([decay.notes.get("pressure_Pa") for decay in decays]),
    }
    estimates = {
        "frequency_Hz": [decay.estimates.get("frequency_Hz") for decay in decays],
        "inverse_q": [decay.inverse_q for decay in decays],
    }
    sds = {name: column([0.0 if one is None else one.sd for one in found]) for name, found in estimates.items()}
    return Decays(columns, sds, first)


def fit_laws(decays: Decays) -> dict[str, Law]:
    """Fit the laws of ln f and of 1/Q, `fitted` in their own units; none where there are fewer than four readings or nothing varies."""
    found = {}
    for name in RESPONSES:
        value = decays.columns.get(name)
        if value is None:
            continue
        known = {key: x for key, x in decays.columns.items() if key == name or np.isfinite(x).any()}
        keep = np.all([np.isfinite(x) for key, x in known.items() if key not in RESPONSES or key == name], axis=0)
        if name == "inverse_q":
            keep &= value > 0
        if np.count_nonzero(keep) < LEAST:
            continue
        decay = (known["decay"][keep] if "decay" in known else np.flatnonzero(keep)).astype(np.int64)
        time = known["time_s"][keep] if "time_s" in known else np.zeros(len(decay))
        named = (("temperature", TEMPERATURE), ("pressure", "pressure_Pa"))
        conditions = {key: known[column][keep] for key, column in named if column in known}
        if AMPLITUDE in known:
            conditions["energy"] = _smooth(known[AMPLITUDE][keep], decay) ** 2
        y, sd = value[keep], decays.sd.get(name, np.zeros_like(value))[keep]
        if not (np.ptp(y) > 0 and (np.ptp(time) > 0 or any(np.ptp(x) > 0 for x in conditions.values()))):
            continue
        rows = Rows(y, sd, decay, time, conditions)
        if name == "frequency_Hz":
            rows = replace(rows, value=np.log(y), sd=sd / y)
        with naming(decays.path):
            law = fit_law(rows, loss=name == "inverse_q")
        fitted = np.full(len(value), np.nan)
        fitted[keep] = np.exp(law.fitted) if name == "frequency_Hz" else law.fitted
        found[name] = replace(law, fitted=fitted)
    return found


def write_decays(decays: Decays, path: str | Path) -> None:
    """Write decays as a record, a row each, that `hrg calibrate` and `hrg diagnose` take: temperature, frequency, 1/Q."""
    columns = decays.columns
    for name, comment in (("time_s", "start"), (TEMPERATURE, "temperature_degC")):
        if not np.isfinite(columns.get(name, np.array([np.nan]))).all():
            asked = f"give every decay its comment '# {comment}: …'"
            raise InputError(f"--out writes a record over time and temperature; {asked}.")
    if not np.all(np.diff(columns["time_s"]) > 0):
        raise InputError("--out writes a record over time, but two decays begin at one moment; correct '# start: …'.")
    names = ("time_s", TEMPERATURE, *RESPONSES)
    kept = {key: columns[key] for key in names if key in columns and np.isfinite(columns[key]).any()}
    start = None if decays.start is None else datetime.datetime.fromtimestamp(decays.start, datetime.UTC)
    write_record(Record(kept, source="free decays, hrg fit ringdown", start=start), path)


def _smooth(amplitude: Array, decay: NDArray[np.int64]) -> Array:
    """Return the amplitudes of every long decay as a parabola of their logarithm, in which outliers count little."""
    found = amplitude.copy()
    for one in np.unique(decay):
        rows = np.flatnonzero(decay == one)
        if len(rows) < SMOOTHED:
            continue
        a = amplitude[rows]
        usual = float(np.median(a))
        fine = (a > 0.2 * usual) & (a < 5 * usual) if usual > 0 else a > 0
        x = np.linspace(-1, 1, len(rows))
        for _ in range(3):
            if np.count_nonzero(fine) < SMOOTHED:
                break
            line = np.polyval(np.polyfit(x[fine], np.log(a[fine]), 2), x)
            left = np.abs(np.log(np.maximum(a, 1e-300)) - line)
            fine &= left <= 6 * float(np.median(left[fine])) + 1e-12
        else:
            found[rows] = np.exp(line)
    return found
