"""An applied rate between the rows of a run: straight lines and jumps, and what of them a row shows that is a mean."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array

SNAP = 1e-5  # of a sample, within which a corner is at it


@dataclass(frozen=True)
class AppliedRate:
    """Ω(t): straight lines through (time, value), arrays (N,), s and rad/s; a time given twice is a jump; held beyond its ends."""

    time: Array
    value: Array

    @classmethod
    def of(cls, rate: "ArrayLike | AppliedRate", rows: Array) -> "AppliedRate":
        """Return a rate that is one already, or a number, or values at rows (s) with straight lines between."""
        if isinstance(rate, cls):
            return rate
        return cls(rows, np.broadcast_to(np.asarray(rate, dtype=float), rows.shape))

    @classmethod
    def steps(cls, rows: Array, means: Array) -> "AppliedRate":
        """Return the rate that keeps from each row (s) to the next what the row says."""
        return cls(np.repeat(rows, 2)[1:], np.repeat(means, 2)[:-1])

    def at(self, time: Array, before: bool = False) -> Array:
        """Value at times (s); at a jump that after it, or before."""
        t = np.concatenate([[self.time[0] - 1.0], self.time, [self.time[-1] + 1.0]])
        value = np.concatenate([self.value[:1], self.value, self.value[-1:]])
        k = np.searchsorted(self.time, time, side="left" if before else "right")
        return np.asarray(value[k] + (value[k + 1] - value[k]) * ((time - t[k]) / (t[k + 1] - t[k])))

    def pieces(self, rows: Array) -> tuple[Array, NDArray[np.intp], Array, Array]:
        """Return times (s) that cut rows where the rate bends, which of them are the rows, and the rate where each piece begins and ends."""
        edges = np.union1d(rows, self.time[(self.time > rows[0]) & (self.time < rows[-1])])
        return edges, np.searchsorted(edges, rows), self.at(edges[:-1]), self.at(edges[1:], before=True)

    def means(self, rows: Array) -> Array:
        """Return the mean from each row (s) to the next; of the last, its value."""
        edges, first, begin, end = self.pieces(rows)
        turned = np.add.reduceat(np.diff(edges) * (begin + end) / 2, first[:-1])
        return np.append(turned / np.diff(rows), self.at(rows[-1:]))

    def largest(self, rows: Array) -> Array:
        """Return the rate of the largest size from each row (s) to the next; of the last, its value."""
        _, first, begin, end = self.pieces(rows)
        most = np.maximum.reduceat(np.maximum(begin, end), first[:-1])
        least = np.minimum.reduceat(np.minimum(begin, end), first[:-1])
        return np.append(np.where(most > -least, most, least), self.at(rows[-1:]))

    def plus(self, rows: Array, values: ArrayLike) -> "AppliedRate":
        """Return the sum with values at rows (s), linear between."""
        edges, _, begin, end = self.pieces(rows)
        more = np.interp(edges, rows, np.broadcast_to(values, rows.shape))
        return AppliedRate(np.repeat(edges, 2)[1:-1], np.stack([begin + more[:-1], end + more[1:]], axis=1).ravel())

    def in_samples(self, rows: int, samples: int, start: float, step: float) -> tuple[NDArray[np.intp], Array, Array]:
        """Cut rows of so many samples (s) where the rate bends; return the edges in samples, and the rate where pieces begin and end.

        The last row has its samples too; a sample in which the rate bends has its mean.
        """
        place = (self.time - start) / step
        place = np.where(np.abs(place - np.rint(place)) < SNAP, np.rint(place), place)
        inside = place[(place > 0) & (place < rows * samples)]
        edges = np.unique(np.concatenate([np.arange(rows + 1) * samples, np.floor(inside), np.ceil(inside)]))
        over = replace(self, time=place)
        begin, end = over.at(edges[:-1]), over.at(edges[1:], before=True)
        bent = np.unique(np.searchsorted(edges, inside[inside != np.rint(inside)], side="left") - 1)
        begin[bent] = end[bent] = over.means(edges)[bent]
        return edges.astype(np.intp), begin, end
