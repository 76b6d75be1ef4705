"""What every stretch of a raw table is, of text or of channels: columns by name, and where their rows stand."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError

if TYPE_CHECKING:
    import datetime

    import pandas as pd


OVERLOAD = 1e36
"""Instruments write 9.9e37 or 1e38 where a reading overloads them."""


@dataclass(frozen=True)
class Part:
    """One raw file of a table: its path, its digest, the line of its first row, and what a row is called in messages."""

    path: str
    sha256: str
    first_line: int
    row_name: str = "line"

    def place(self, row: int) -> str:
        """Return the file and the line on which a row (from 0) stands."""
        return f"{self.path}, {self.row_name} {self.first_line + int(row)}"


@dataclass(frozen=True)
class RawTable:
    """Consecutive rows of one raw file: columns by name, from the row `first` of the file on."""

    part: Part
    missing: tuple[str, ...]
    first: int
    rows: int
    overloads: dict[str, int] = field(default_factory=dict, repr=False, kw_only=True)  # of the columns that were read

    @property
    def path(self) -> str:
        """The file's path."""
        return self.part.path

    def place(self, row: int) -> str:
        """Return the file and the line on which a row (from 0) stands."""
        return self.part.place(self.first + int(row))

    def read(self, column: str) -> Array:
        """Return the values of a column as they stand in the file, in an array of its own."""
        raise NotImplementedError

    def numbers(self, column: str) -> Array:
        """Return a column as numbers, NaN where a value is missing."""
        values = self.read(column)
        for word in self.missing:
            with contextlib.suppress(ValueError):
                values[values == float(word)] = np.nan
        beyond = (values >= OVERLOAD) | (values <= -OVERLOAD)
        self.overloads[column] = int(np.count_nonzero(beyond))
        if self.overloads[column]:
            values[beyond] = np.nan
        return values

    def joined(self, columns: Sequence[str]) -> "pd.Series[str]":
        """Return several columns of text joined by a blank, such as a date and a time of day."""
        raise InputError(
            f"{self.path}: '{' '.join(columns)}' are numbers; time_format is a unit such as 's', or 'own'."
        )

    def own_clock(self) -> "tuple[Array, datetime.datetime | None]":
        """Return the seconds of every row by the file's own clock, and when it started."""
        raise InputError(f"{self.path}: a table of text has no clock of its own; name its time column in the map.")


@dataclass(frozen=True)
class ParsedTable(RawTable):
    """Rows of a text of plain numbers."""

    columns: Mapping[str, Array]

    def read(self, column: str) -> Array:
        """Return the values of a column."""
        return self.columns[column].copy()


@dataclass
class Rows:
    """Rows of files that continue one another, counted through: the files, and the first row of each."""

    parts: list[Part] = field(default_factory=list)
    begins: list[int] = field(default_factory=list)
    count: int = 0

    def add(self, table: RawTable) -> None:
        """Add the next rows."""
        if not self.parts or self.parts[-1] is not table.part:
            self.parts.append(table.part)
            self.begins.append(self.count)
        self.count += table.rows

    def place(self, row: int) -> str:
        """Return the file and the line on which a row stands."""
        k = int(np.searchsorted(self.begins, row, side="right")) - 1
        return self.parts[k].place(row - self.begins[k])
