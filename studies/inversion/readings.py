"""A table of measured modes: `harmonic` (empty where n is not known), `index`, `frequency_Hz`, `sd_Hz`, `temperature_degC`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.files.columns import read_columns
from studies.record import Run, names_of, refuse_kilohertz

if TYPE_CHECKING:
    from pandas import DataFrame

COLUMNS = ("harmonic", "index", "frequency_Hz", "sd_Hz", "temperature_degC")
USUAL = 1e-6  # relative standard deviation of a frequency where the table states none
HIGHEST = 20


@dataclass(frozen=True, eq=False)
class ModeReadings:
    """Measured frequencies of modes of one resonator: the mean of a pair counts as one."""

    path: str
    # harmonic, index: NaN where not known.
    harmonic: Array
    index: Array
    frequency: Array
    sd: Array
    temperature: Array  # K, NaN for the card's reference temperature
    lines: tuple[int, ...]  # of the file
    assumed: bool  # whether the standard deviations are `USUAL`

    def __len__(self) -> int:
        return len(self.frequency)


def is_mode_table(path: Run) -> "TypeGuard[str | Path | DataFrame]":
    """Return whether it is a table of modes."""
    names = names_of(path)
    return "time_s" not in names and not {"harmonic", "index", "sd_Hz"}.isdisjoint(names)


def read_modes(data: "str | Path | DataFrame") -> ModeReadings:
    """Read a table of modes."""
    table = read_columns(data, COLUMNS, required=("harmonic", "frequency_Hz"))
    path = table.path
    count = len(table.values["frequency_Hz"])
    n, k, f, sd, T = (table.values.get(name, np.full(count, np.nan)) for name in COLUMNS)
    if not count:
        raise InputError(f"{path}: it has no modes; give one row per mode.")
    for column, name, most in ((n, "harmonic", HIGHEST), (k, "index", HIGHEST)):
        wrong = ~np.isnan(column) & ((column < 0) | (column != np.round(column)) | (column > most))
        table.refuse(wrong, f"{name} must be a whole number from 0 to {most}, or empty where it is not known.")
    table.refuse(~(f > 0), "frequency_Hz must be a positive number.")
    refuse_kilohertz(table)
    table.refuse(~np.isnan(sd) & ~(sd > 0), "sd_Hz must be positive, or empty.")
    named = [(a, b, c) for a, b, c in zip(n, k, T, strict=True) if not np.isnan(a) and not np.isnan(b)]
    if len({tuple(map(repr, one)) for one in named}) < len(named):
        raise InputError(f"{path}: a mode is listed twice; give the mean of its readings, and of a split pair.")
    stated = np.where(np.isnan(sd), USUAL * f, sd)
    lines = tuple(table.line(row) for row in range(count))
    return ModeReadings(path, n, k, f, stated, T + zero_Celsius, lines, bool(np.isnan(sd).any()))
