"""Readings that a raw file should not have: rows that repeat (left out), spikes, stuck sensors, dropouts (counted; `drop` clears them)."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from compensation.spikes import find_dropouts, find_spikes, find_stuck
from studies.errors import InputError
from studies.importing.mapping import ColumnMap
from studies.importing.tables import RawTable
from studies.record import COMMANDED
from studies.record.rest import LEAST_SPIKE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FINDERS: "Mapping[str, tuple[str, Callable[[Array], NDArray[np.bool_]]]]" = {
    "spikes": ("spikes", lambda values: find_spikes(values, LEAST_SPIKE)),
    "stuck": ("readings of a sensor that is stuck", find_stuck),
    "zeros": ("dropouts to 0", find_dropouts),
}
LOOKED_AT = 1_000_000
"""Rows in which readings are looked for that the map does not drop."""


def drop_doubtful(column: ColumnMap, values: "Array") -> "tuple[Array, list[str]]":
    """Return a column without what its map drops, and what was found in it, in words."""
    notes, kept = [], values
    for kind, (words, find) in FINDERS.items():
        if column.target in COMMANDED and kind not in column.drop:
            continue
        taken = kind in column.drop
        found = find(values if taken else values[:LOOKED_AT])
        count, where = int(found.sum()), "" if len(found) == len(values) else f" in the first {LOOKED_AT:,} rows"
        if taken:
            notes.append(f"{column.target}: {words}: {count}, made missing")
            kept = np.where(found, np.nan, kept)
        elif count:
            notes.append(
                f"{column.target}: {words}{where}: {count}, left as they are (drop = ['{kind}'] makes them missing)"
            )
    return kept, notes


def find_repeats(
    table: RawTable, seconds: "Array", columns: "Mapping[tuple[str, str], Array]"
) -> "tuple[NDArray[np.bool_], list[str]]":
    """Mark rows of a file that repeat rows of the files before it, and say so."""
    repeated, notes = np.zeros(table.rows, dtype=bool), []
    edges: Sequence[int] = [0, *table.starts(), table.rows]
    for before, begin, end in zip(edges, edges[1:], edges[2:], strict=False):
        earlier = np.flatnonzero(np.isfinite(seconds[:begin]) & ~repeated[:begin])
        if (np.diff(seconds[earlier]) < 0).any():
            break  # files in another order, which is told elsewhere
        own = begin + np.flatnonzero(np.isfinite(seconds[begin:end]))
        last = seconds[earlier[-1]] if earlier.size else -np.inf
        own = own[seconds[own] <= last]
        if not own.size or seconds[own[0]] < np.nanmin(seconds[before:begin]):
            continue
        same = earlier[np.clip(np.searchsorted(seconds[earlier], seconds[own]), 0, earlier.size - 1)]
        unlike = seconds[same] != seconds[own]
        for values in columns.values():
            unlike |= (values[same] != values[own]) & ~(np.isnan(values[same]) & np.isnan(values[own]))
        if unlike.any():
            raise InputError(
                f"{table.place(begin)}: this file overlaps the one before it by {last - seconds[own[0]]:.6g} s, and they differ there (first at"
                f" {table.place(int(own[np.argmax(unlike)]))}); end one of them with last_line in the map, or import them one by one."
            )
        repeated[own] = True
        notes.append(f"{own.size} rows from {table.place(int(own[0]))} on repeat the file before: left out")
    return repeated, notes
