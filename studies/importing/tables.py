"""What every raw table is, of text or of channels: columns by name, and where their rows stand."""

import contextlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from studies.errors import InputError, nearest

if TYPE_CHECKING:
    import datetime

    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

OVERLOAD = 1e36
"""Instruments write 9.9e37 or 1e38 where a reading overloads them."""


@dataclass(frozen=True)
class Part:
    """One raw file of a table: its path, its digest, the line of its first row, its number of rows."""

    path: str
    sha256: str
    first_line: int
    rows: int


@dataclass(frozen=True)
class RawTable:
    """The columns of one raw file, or of several that continue one another, and where their rows stood."""

    parts: tuple[Part, ...]
    missing: tuple[str, ...]
    _last: "dict[str, NDArray[np.float64]]" = field(default_factory=dict, repr=False, kw_only=True)
    _beyond: dict[str, int] = field(default_factory=dict, repr=False, kw_only=True)

    @property
    def path(self) -> str:
        """The first file's path."""
        return self.parts[0].path

    @property
    def rows(self) -> int:
        """Rows of all files."""
        return sum(part.rows for part in self.parts)

    @property
    def row_name(self) -> str:
        """What a row is called in messages."""
        return "line"

    def close(self) -> None:
        """Close its files, where they are still open."""

    def place(self, row: int) -> str:
        """Return the file and the line on which a row (from 0) stands."""
        left = int(row)
        for part in self.parts:
            if left < part.rows:
                break
            left -= part.rows
        return f"{part.path}, {self.row_name} {part.first_line + left}"

    def starts(self) -> list[int]:
        """Rows at which a file continues another."""
        return list(itertools.accumulate(part.rows for part in self.parts))[:-1]

    def read(self, column: str) -> "NDArray[np.float64]":
        """Return the values of a column as they stand in the files, in an array of its own."""
        raise NotImplementedError

    def numbers(self, column: str) -> "NDArray[np.float64]":
        """Return a column as numbers, NaN where a value is missing; only the last one read is kept."""
        if column not in self._last:
            self._last.clear()
            values = self.read(column)
            for word in self.missing:
                with contextlib.suppress(ValueError):
                    values[values == float(word)] = float("nan")
            import numpy as np

            beyond = (values >= OVERLOAD) | (values <= -OVERLOAD)
            values[beyond] = float("nan")
            self._last[column], self._beyond[column] = values, int(np.count_nonzero(beyond))
        return self._last[column]

    def count_overloads(self, column: str) -> int:
        """Return how many readings of a column stand for an overload of the instrument."""
        if column not in self._beyond:
            self.numbers(column)
        return self._beyond[column]

    def joined(self, columns: Sequence[str]) -> "pd.Series[str]":
        """Return several columns of text joined by a blank, such as a date and a time of day."""
        raise InputError(
            f"{self.path}: '{' '.join(columns)}' are numbers; time_format is a unit such as 's', or 'own'."
        )

    def is_empty(self, text: "pd.Series[str]") -> "NDArray[np.bool_]":
        """Tell which cells of text hold no value."""
        raise NotImplementedError

    def own_clock(self) -> "tuple[NDArray[np.float64], datetime.datetime | None]":
        """Return the seconds of every row by the file's own clock, and when it started."""
        raise InputError(f"{self.path}: a table of text has no clock of its own; name its time column in the map.")


@dataclass(frozen=True)
class ParsedTable(RawTable):
    """A text of plain numbers."""

    columns: "Mapping[str, NDArray[np.float64]]"

    def read(self, column: str) -> "NDArray[np.float64]":
        """Return the values of a column."""
        if column not in self.columns:
            raise InputError(f"{self.path}: there is no column '{column}'{nearest(column, self.columns)}")
        return self.columns[column].copy()
