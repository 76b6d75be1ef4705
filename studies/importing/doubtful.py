"""Readings that a raw file should not have: spikes, stuck sensors, dropouts (counted; `drop` clears them)."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.spikes import find_dropouts, find_spikes, find_stuck
from studies.files.stored import Stored
from studies.importing.mapping import ColumnMap
from studies.record import COMMANDED
from studies.record.rest import LEAST_SPIKE

FINDERS: Mapping[str, tuple[str, Callable[[Array], NDArray[np.bool_]]]] = {
    "spikes": ("spikes", lambda values: find_spikes(values, LEAST_SPIKE)),
    "stuck": ("readings of a sensor that is stuck", find_stuck),
    "zeros": ("dropouts to 0", find_dropouts),
}
LOOKED_AT = 1_000_000
"""Rows in which readings are looked for that the map does not drop, and rows that are judged together."""
BESIDE = 1000


def drop_doubtful(column: ColumnMap, values: Stored, folder: str | None) -> tuple[Stored, list[str]]:
    """Return a column without what its map drops, and what was found in it, in words."""
    notes, kept = [], values
    for kind, (words, find) in FINDERS.items():
        if kind in column.drop:
            kept, count = _drop(kept, find, folder)
            notes.append(f"{column.target}: {words}: {count}, made missing")
        elif column.target not in COMMANDED and (count := int(find(values[:LOOKED_AT]).sum())):
            where = "" if len(values) <= LOOKED_AT else f" in the first {LOOKED_AT:,} rows"
            notes.append(
                f"{column.target}: {words}{where}: {count}, left as they are (drop = ['{kind}'] makes them missing)"
            )
    return kept, notes


def _drop(values: Stored, find: Callable[[Array], NDArray[np.bool_]], folder: str | None) -> tuple[Stored, int]:
    """Make the marked readings missing; a long column is judged a portion at a time, with the rows beside it."""
    kept, count = Stored(folder), 0
    for begin in range(0, len(values), LOOKED_AT):
        before = min(begin, BESIDE)
        part = values[begin - before : begin + LOOKED_AT + BESIDE]
        found = find(part)[before : before + LOOKED_AT]
        count += int(found.sum())
        kept.append(np.where(found, np.nan, part[before : before + LOOKED_AT]))
    return kept, count
