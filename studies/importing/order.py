"""Rows in the order of their times: those without a time, and those that repeat others, are left out, spread or refused."""

import itertools

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.errors import InputError, numbered
from studies.files.stored import Stored, portions
from studies.importing.mapping import FileMap
from studies.importing.tables import Rows


def rises(time: Stored) -> bool:
    """Whether every row has a time after the one before it."""
    known = bool(np.isfinite(time[:1]).all())
    return known and all((np.diff(time[k]) > 0).all() for k in portions(len(time), 1))


class Order:
    """Leave out rows without a time and those that repeat others, of one file or of several that continue one another."""

    def __init__(self, rows: Rows, file: FileMap, folder: str | None) -> None:
        self.rows, self.file, self.folder = rows, file, folder
        self.lost = self.same = 0
        self.first_lost: int | None = None
        self.repeated: dict[int, int] = {}  # first row of a part that repeats others, and how many do
        self._held: list[Array] = []  # rows of the last stamp, which are spread when the next is known

    def sort(self, columns: list[Stored]) -> list[Stored]:
        """Return the columns, the time the first of them, of the rows that are left, whose times increase."""
        kept = [Stored(self.folder) for _ in columns]
        edges = [*self.rows.begins, self.rows.count]
        began = 0  # place among those kept of the file before
        for begin, end in itertools.pairwise(edges):
            last, previous, began = (kept[0].at(-1) if len(kept[0]) else -np.inf), began, len(kept[0])
            for k in portions(end - begin):
                at = np.arange(begin + k.start, begin + k.stop)
                part = [column[at[0] : at[-1] + 1] for column in columns]
                fine = np.isfinite(part[0])
                self.lost += int(np.count_nonzero(~fine))
                if self.first_lost is None and not fine.all():
                    self.first_lost = int(at[~fine][0])
                fine &= ~self._repeats(kept, part, at, begin, last, previous)
                self._add(kept, [one[fine] for one in part], at[fine])
        if not len(kept[0]) and not self._held:
            raise InputError(f"{self.rows.parts[0].path}: no row has a time.")
        if self._held:
            self._spread(kept, self._held, final=True)
        return kept

    def _repeats(
        self, kept: list[Stored], part: list[Array], at: NDArray[np.intp], begin: int, last: float, previous: int
    ) -> NDArray[np.bool_]:
        """Mark rows that repeat rows of the files before theirs; rows of the same times that differ are refused."""
        t = part[0]
        again = t <= last
        if not again.any() or (begin not in self.repeated and t[again][0] < kept[0].at(previous)):
            return np.zeros(t.size, dtype=bool)
        begin_, end = kept[0].find(float(t[again].min())), kept[0].find(float(t[again].max()), right=True)
        earlier = [column[begin_ : max(end, begin_ + 1)] for column in kept]
        same = np.clip(np.searchsorted(earlier[0], t[again]), 0, earlier[0].size - 1)
        unlike = np.zeros(same.size, dtype=bool)
        for old, new in zip(earlier, part, strict=True):
            unlike |= (old[same] != new[again]) & ~(np.isnan(old[same]) & np.isnan(new[again]))
        if unlike.any():
            raise InputError(
                f"{self.rows.place(begin)}: this file overlaps the one before it by {last - t[again][0]:.6g} s, and they differ there (first at"
                f" {self.rows.place(int(at[again][np.argmax(unlike)]))}); end one of them with last_line in the map, or import them one by one."
            )
        self.repeated[begin] = self.repeated.get(begin, 0) + int(again.sum())
        return np.asarray(again)

    def _add(self, kept: list[Stored], part: list[Array], at: NDArray[np.intp]) -> None:
        if not at.size:
            return
        before = self._held[0][-1] if self._held else kept[0].at(-1) if len(kept[0]) else -np.inf
        steps = np.diff(part[0], prepend=before)
        if (steps < 0).any():
            row = int(at[np.argmax(steps < 0)])
            raise InputError(
                f"{self.rows.place(row)}: the time goes backwards (by up to {-steps.min():g} s). {_mend(self.rows, self.file, row)}"
            )
        same = steps == 0
        self.same += int(same.sum())
        if same.any() and self.file.repeated_times == "error":
            row, name = int(at[np.argmax(same)]), self.rows.parts[0].row_name
            raise InputError(
                f"{self.rows.place(row)}: this {name} repeats the time of the one before ({self.same}"
                " such rows); set repeated_times = 'first' or 'spread' in the map."
            )
        if self.file.repeated_times == "spread":
            self._spread(kept, [np.append(*two) for two in zip(self._held, part, strict=True)] if self._held else part)
            return
        for column, values in zip(kept, part, strict=True):
            column.append(values[~same])

    def _spread(self, kept: list[Stored], part: list[Array], final: bool = False) -> None:
        """Spread rows with the same stamp evenly up to the next stamp; the last group takes the usual step."""
        t = part[0]
        stamps, first, count = np.unique(t, return_index=True, return_counts=True)
        steps = np.diff(stamps)
        usual = float(np.median(steps)) if steps.size else self._usual
        self._usual = usual
        within = np.arange(len(t)) - np.repeat(first, count)
        spread = t + within * np.repeat(np.append(steps, usual) / count, count)
        ready = len(t) if final else int(first[-1])
        for column, values in zip(kept, [spread, *part[1:]], strict=True):
            column.append(values[:ready])
        self._held = [one[ready:] for one in part]

    _usual = 1.0

    @property
    def notes(self) -> list[str]:
        """What was done, in words."""
        said = []
        if self.first_lost is not None:
            said.append(
                f"{numbered(self.lost, 'row')} without a time left out (first: {self.rows.place(self.first_lost)})"
            )
        if self.same and self.file.repeated_times == "first":
            said.append(f"{numbered(self.same, 'row')} with a repeated time left out")
        elif self.same:
            said.append(f"{numbered(self.same, 'repeated time')} spread evenly up to the next stamp")
        for begin, count in self.repeated.items():
            said.append(f"{count} rows from {self.rows.place(begin)} on repeat the file before: left out")
        return said


def _mend(rows: Rows, file: FileMap, row: int) -> str:
    if row in rows.begins[1:]:
        return "Give consecutive files in the order of their times; import files whose clocks restart one by one."
    restart = (
        "If its clock restarted, split the file there, or end it with last_line in its [[file]] of the map; if rows were"
        " only written out of order, sort them by their time."
    )
    if file.timezone or file.counts_from_zero:
        return restart
    return f"{restart} If clocks changed to winter time, give 'timezone' in that [[file]]."
