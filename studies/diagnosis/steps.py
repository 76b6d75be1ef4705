"""From the rows of a record to means over the steps of an even grid."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.effects.states import FloatArray

HOLE = 2.0
"""Steps of the grid between neighbours, in parts of the usual, that make a hole."""
SEVERAL = 5
"""Rows from which on a step has a slope of its own."""
ASIDE = 0.02
"""Part of a step by which the rows of a step that lacks some, or lies beside a hole, may lie off its centre."""
UNEVEN = 1e-4
"""Part of the square of half a step by which the rows of a step spread otherwise than usual, from which on a bend counts."""
SWITCHED = 0.01
"""Change of a command from row to row, in parts of its range, that is a step of it."""


@dataclass(frozen=True)
class Steps:
    """Which rows make which step.

    Attributes
    ----------
    time : (M,) array
        Of the rows, s.
    place : (M,) int array
        The step that a row belongs to; as many as there are or more: to none.
    grid : (N,) array
        Centres of the steps, s.
    open_end : bool
        Whether the last step goes beyond the last row.
    switched : int array
        Steps in which a command changes.
    """

    time: FloatArray
    place: "np.ndarray"
    grid: FloatArray
    open_end: bool
    switched: "np.ndarray"

    @classmethod
    def of(
        cls, time: FloatArray, place: "np.ndarray", grid: FloatArray, open_end: bool, commands: Sequence[FloatArray]
    ) -> "Steps":
        """Find the steps of the grid in which one of the `commands`, given by rows, changes."""
        changes = np.zeros(time.size, dtype=bool)
        for values in commands:
            known = np.flatnonzero(np.isfinite(values))
            jumps = np.abs(np.diff(values[known])) > SWITCHED * np.ptp(values[known])
            changes[known[1:][jumps]] = changes[known[:-1][jumps]] = True
        switched = np.unique(place[changes])
        return cls(time, place, grid, open_end, switched[switched < grid.size])

    def means(self, column: FloatArray) -> FloatArray:
        """Mean over each step, moved along the slope from the rows' mean time to the centre; NaN where it stands for none.

        A row stands for the time up to halfway to the next ones, so that missing and uneven rows do not bend it. The slope
        is that of the step's own rows where they are several, else that between its neighbours; rows that spread otherwise than
        usual see another part of a bend, which the neighbours tell. A step beside a hole stands
        only if its rows are centred, and so does one of several that lacks rows; one that lacks rows while a command changed
        is no mean over the step at all.
        """
        grid, present = self.grid, np.isfinite(column) & (self.place < self.grid.size)
        t, y, place = self.time[present], column[present], self.place[present]
        count = np.bincount(place, minlength=grid.size)
        full = count >= max(1.0, 0.34 * float(np.median(count[count > 0]))) if count.any() else count > 0
        half, between = 0.5 * (grid[1] - grid[0]), 0.5 * (t[1:] + t[:-1])
        begin = np.maximum(grid[place] - half, np.append(-np.inf, between))
        own = np.maximum(np.minimum(grid[place] + half, np.append(between, np.inf)) - begin, 1e-9 * half)

        def total(values: FloatArray) -> FloatArray:
            return np.asarray(np.bincount(place, own * values, grid.size), dtype=float)

        with np.errstate(invalid="ignore", divide="ignore"):
            weight = total(np.ones_like(t))
            mean = total(y) / weight
            lead = total(t) / weight - grid
            off = t - (grid + lead)[place]
            along = total(off * y) / total(off**2)
            spread = total((t - grid[place]) ** 2) / weight
        usual = float(np.median(count[full])) if full.any() else 0.0
        lacks = count < usual
        full[self.switched] &= ~lacks[self.switched]
        mean[~full] = np.nan
        known = np.flatnonzero(full)
        if known.size >= 2:
            gap = np.diff(known)
            slopes = np.diff(mean[known]) / np.diff((grid + lead)[known])
            slopes[gap > HOLE * np.median(gap)] = np.nan
            around = np.stack([np.append(np.nan, slopes), np.append(slopes, np.nan)])
            there = np.isfinite(around)
            aside = ~there.all(axis=0) | (lacks[known] & (usual >= SEVERAL))
            stands = ~aside | (np.abs(lead[known]) <= ASIDE * 2.0 * half)
            slope = np.where(there, around, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
            slope = np.where(count[known] >= SEVERAL, along[known], slope)
            mean[known] = np.where(stands, mean[known] - slope * lead[known], np.nan)
            wide = spread - np.median(spread[known])
            uneven = full & (count >= SEVERAL) & (np.abs(wide) > UNEVEN * half**2)
            mean = np.where(uneven, mean - 0.5 * _bend(mean) / (2.0 * half) ** 2 * wide, mean)
        if self.open_end:
            mean[-1] = np.nan
        return np.asarray(mean)


def _bend(mean: FloatArray) -> FloatArray:
    """Return second differences of the means, 0 where one of the three is missing."""
    return np.nan_to_num(np.concatenate([[0.0], np.diff(mean, 2), [0.0]])) if mean.size > 2 else np.zeros_like(mean)
