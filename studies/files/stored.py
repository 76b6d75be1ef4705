"""Columns of numbers on disk, written in portions and read by slices: a record longer than the memory is a `Record` of them."""

import tempfile
import weakref
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError

PORTION = 1 << 19
"""Rows that are looked at together."""
IN_MEMORY = 1 << 23  # bytes of a column that need no file
BYTES = 8  # of a number


class Stored:
    """One column: in memory while it is short, else in a file without a name, beside the output where that is known."""

    def __init__(self, folder: str | None = None) -> None:
        beside = folder if folder is not None and Path(folder).is_dir() else None
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY, dir=beside)  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._rows = 0

    def __len__(self) -> int:
        return self._rows

    def append(self, values: Array) -> None:
        """Add values at the end."""
        try:
            self._file.seek(BYTES * self._rows)
            self._file.write(np.ascontiguousarray(values, dtype=np.float64).data)
        except OSError as error:
            raise InputError(f"the columns need more room on the disk ({error.strerror}); free some.") from error
        self._rows += len(values)

    def __getitem__(self, rows: slice) -> Array:
        begin, end, step = rows.indices(self._rows)
        if step > 1:
            parts = [self[k : min(k + PORTION * step, end)][::step] for k in range(begin, end, PORTION * step)]
            return np.concatenate(parts) if parts else np.empty(0)
        self._file.seek(BYTES * begin)
        return np.frombuffer(self._file.read(BYTES * max(end - begin, 0))).copy()

    def at(self, row: int) -> float:
        """One value."""
        return float(self[row : row + 1][0]) if row >= 0 else float(self[self._rows + row : self._rows][0])

    def thin(self, most: int) -> Array:
        """All values, or at most so many evenly picked ones."""
        return self[:: max(1, -(-self._rows // most))]

    def find(self, value: float, right: bool = False) -> int:
        """Place of a value in a column that increases: rows before it, or (`right`) up to it."""
        search = bisect_right if right else bisect_left
        return search(range(self._rows), value, key=self.at)


def portions(count: int, before: int = 0) -> Iterator[slice]:
    """Yield the portions of so many rows, each with the rows `before` it."""
    return (slice(max(begin - before, 0), min(begin + PORTION, count)) for begin in range(0, count, PORTION))
