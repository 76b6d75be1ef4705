"""Readings of one file, by its own clock, at the times of another."""

import datetime
from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.decimation import average_groups
from studies.files.stored import Stored, portions
from studies.importing.doubtful import LOOKED_AT
from studies.importing.mapping import FileMap

USUAL_GAP = 10.0  # sampling steps that a gap may have before nothing is interpolated across it


@dataclass(frozen=True)
class ClockedFile:
    """One raw file after its own map: times by its clock, converted columns, and what was changed, in words."""

    file: FileMap
    path: str
    time: Stored
    origin: datetime.datetime | None
    columns: dict[tuple[str, str], Stored]
    notes: tuple[str, ...]

    @property
    def longest_gap(self) -> float:
        """The longest gap across which values are interpolated, s."""
        if self.file.longest_gap is not None:
            return self.file.longest_gap
        return USUAL_GAP * self.usual_step if len(self.time) > 1 else 0.0

    @property
    def usual_step(self) -> float:
        """The median step of the (first million) rows, s."""
        return float(np.median(np.diff(self.time[:LOOKED_AT])))

    @property
    def span(self) -> tuple[float, float]:
        """The first and the last time, s."""
        return self.time.at(0), self.time.at(-1)


def take_over(one: ClockedFile, values: Stored, shift: float, time: Stored, how: str, folder: str | None) -> Stored:
    """Return a column of a file, whose clock is `shift` ahead of the record's, at the times of the record."""
    found, held, done = Stored(folder), np.full((2, 1), np.nan), 0
    for k in portions(len(time)):
        before, after = min(k.start, 1), min(len(time) - k.stop, 1)
        grid = time[k.start - before : k.stop + after]
        # what lies farther than a gap tells nothing, but for the value that is held
        begin = one.time.find(float(grid[0]) - shift - one.longest_gap)
        end = one.time.find(float(grid[-1]) - shift + one.longest_gap, right=True)
        if how == "previous" and done < begin:
            held = _last_known(one, values, slice(done, begin), held)
            done = begin
        t, v = (np.append(old, new) for old, new in zip(held, (one.time[begin:end], values[begin:end]), strict=True))
        part = resample(t + shift, v, grid, how, one.longest_gap)
        found.append(part[before : part.size - after])
    return found


def _last_known(one: ClockedFile, values: Stored, rows: slice, held: Array) -> Array:
    """Return time and value (2, 1) of the last reading among rows, or what was held before."""
    for k in portions(rows.stop - rows.start):
        at = slice(rows.start + k.start, rows.start + k.stop)
        if (known := np.flatnonzero(np.isfinite(part := values[at]))).size:
            held = np.array([[one.time.at(at.start + int(known[-1]))], [part[known[-1]]]])
    return held


def resample(time: Array, values: Array, grid: Array, how: str, longest_gap: float) -> Array:
    """Return values at the times of the grid, NaN outside and within gaps: linear, the mean of nearer samples, the nearest, the previous."""
    known = np.isfinite(values)
    t, v = time[known], values[known]
    if not len(t):
        return np.full(len(grid), np.nan)
    after = np.searchsorted(t, grid)
    left, right = np.clip(after - 1, 0, len(t) - 1), np.clip(after, 0, len(t) - 1)
    if how == "previous":
        held = np.searchsorted(t, grid, side="right") - 1
        return np.where(held >= 0, v[np.clip(held, 0, None)], np.nan)
    if how == "mean":
        return _bin_means(t, v, grid)
    if how == "nearest":
        nearest = np.where(abs(grid - t[left]) <= abs(t[right] - grid), left, right)
        return np.where(abs(t[nearest] - grid) <= longest_gap / 2, v[nearest], np.nan)
    exact = t[right] == grid
    reachable = exact | ((after > 0) & (after < len(t)) & (t[right] - t[left] <= longest_gap))
    return np.where(reachable, np.interp(grid, t, v), np.nan)


def _bin_means(t: Array, v: Array, grid: Array) -> Array:
    if len(grid) < 2:
        return np.full(len(grid), float(np.mean(v)))
    middles = (grid[1:] + grid[:-1]) / 2
    edges = np.concatenate([[grid[0] - (middles[0] - grid[0])], middles, [grid[-1] + (grid[-1] - middles[-1])]])
    which = np.searchsorted(edges, t, side="right") - 1
    inside = (which >= 0) & (which < len(grid))
    return average_groups(v[inside], which[inside], len(grid))
