"""Records of one run: which repeat another, wholly or in their noise, and which overlap in time."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from compensation.arrays import Array
from studies.record import OUTPUTS, Record, place_in_time

REPEATED = 0.5  # part of the rows of a record that stand in another of the same run
PICKED = 500  # rows that are compared
ALIKE, AS_LARGE = 0.9, 0.02
"""Correlation of the noise of two columns, and ln of its sizes: of another gyro it is scaled."""
SAME_NOISE = ": their noise is the same row by row (simulated runs need a --seed each)"
FEWEST_ALIKE, MOST_ALIKE = 50, 20_000  # rows that show it


def drop_repeats(records: Sequence[Record]) -> tuple[list[Record], list[str]]:
    """Return the records without those that repeat most of a longer one, and a sentence for each that was left out and for those that overlap in time."""
    kept: list[Record] = []
    said = []
    for record in records:
        twin, how = next(((other, how) for other in kept if (how := _likeness(record, other)) is not None), (None, ""))
        if twin is None:
            kept.append(record)
            continue
        if len(record) > len(twin):
            place = next(k for k, one in enumerate(kept) if one is twin)
            kept[place], record, twin = record, twin, record
        said.append(f"{record.path or 'a record'} repeats {twin.path or 'another'} and is left out{how}.")
    return kept, said + _overlaps(kept)


def _overlaps(records: Sequence[Record]) -> list[str]:
    """Sentences on runs of which one starts before another ends, whether a start is that of the clock or of the first row."""
    starts, placed = place_in_time(records)
    order = sorted(zip(starts, records, strict=True), key=lambda pair: pair[0]) if placed else []
    found = []
    for (start, one), (later, two) in pairwise(order):
        end, begins = float(one["time_s"][-1]), float(two["time_s"][0])
        early = start - later + min(end - float(one["time_s"][0]), end - begins)
        if early > 0:
            found.append(
                f"{two.path or 'a record'} starts {early:.6g} s before {one.path or 'another'} ends, and one gyro makes one run at a time:"
                " check '# start' (its date and time zone), and that both are of this gyro."
            )
    return found


def repeats(one: Record, two: Record) -> bool:
    """Whether two records are of one run: of the shorter, most rows stand in the other too, whatever their time, or one output scatters as the other does; noise never repeats itself."""
    return _likeness(one, two) is not None


def _likeness(one: Record, two: Record) -> str | None:
    """How two records are of one run, in words where it is not seen in their rows; None where they are not."""
    if (one.sha256 and one.sha256 == two.sha256) or _same_rows(one, two):
        return ""
    shared = (key for key in OUTPUTS if key in one and key in two)
    alike = len(one) == len(two) and any(_same_noise(one[key], two[key]) for key in shared)
    return SAME_NOISE if alike else None


def _same_rows(one: Record, two: Record) -> bool:
    """Whether most rows of the shorter stand in the other."""
    short, long = (dict(own.columns) for own in sorted((one, two), key=len))
    if not set(short) <= set(long):
        return False
    if len(one) == len(two) and all(np.array_equal(short[name], long[name], equal_nan=True) for name in short):
        return True
    names = [name for name in short if name != "time_s"]
    picked = np.unique(np.linspace(0, min(len(one), len(two)) - 1, PICKED).astype(int))
    busiest = max(names, key=lambda name: np.unique(short[name][picked]).size, default="time_s")
    places = (short, picked), (long, np.isin(long[busiest], short[busiest][picked]))
    columns = ([np.nan_to_num(own[name][at], nan=np.inf).tolist() for name in names] for own, at in places)
    rows, there = (set(zip(*one, strict=True)) for one in columns)
    return len(rows & there) > REPEATED * len(picked)


def _same_noise(one: Array, two: Array) -> bool:
    """Whether the second differences of two columns are noise, and the same: one was rounded, moved or turned."""
    both = np.diff([one[:MOST_ALIKE], two[:MOST_ALIKE]], 2)
    both = both[:, np.isfinite(both).all(axis=0)]
    spread = 1.4826 * np.median(np.abs(both), axis=1, keepdims=True) if both.size else np.zeros((2, 1))
    if both.shape[1] < FEWEST_ALIKE or not spread.all() or abs(np.log(spread[0] / spread[1])) > AS_LARGE:
        return False
    both = np.clip(both / spread, -5.0, 5.0)
    rough = [np.corrcoef(own[1:], own[:-1])[0, 1] for own in both]  # of white noise −2/3
    return max(rough) < -0.5 and min(rough) > -0.8 and bool(abs(np.corrcoef(both)[0, 1]) > ALIKE)
