"""How a wave went through its rows: x = 2 n θ between the angles at their ends, as far as the rows beside tell it.

Where a row turns as one beside it, it turns evenly. Where the turn per row d changes smoothly it is a parabola, x(u) = x₀ + d u + ½ a (u² − u), a the mean change of d about the row;
where it steps between two even stretches, two lines, with the turns of the rows before and after. Otherwise it is not known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
CLEAR = 0.1  # rad of x, by which a course within its row may be in doubt
STEADY = 0.1  # part of a step by which the rows on both sides of it may change
LONGEST = 8.0  # rad of x in one row, beyond which its means tell nothing


@dataclass(frozen=True)
class RowCourse:
    """Means of cos x and sin x over the rows, and whether the course of each row is known."""

    cosine: Array
    sine: Array
    known: NDArray[np.bool_]

    @classmethod
    def of(cls, x: Array) -> "RowCourse":
        """Follow a wave through the rows whose ends are at x."""
        d = np.diff(x)
        before, after = np.append(d[:1], d[:-1]), np.append(d[1:], d[-1:])
        rough = np.abs(after - 2 * d + before) / 8  # half of the largest that a parabola may be off in its middle
        same = np.abs(np.diff(d))
        level = np.append(same, same[-1:]) < CLEAR  # turns as the next row, or as the one before
        level |= np.append(same[:1], same) < CLEAR
        beside = np.concatenate([[0.0, 0.0], same[:-1]]) + np.concatenate([same[1:], [0.0, 0.0]])
        smooth = rough < CLEAR
        stepped = (beside < STEADY * np.abs(after - before)) & ((d - before) * (after - d) > 0) & ~level
        part = np.where(stepped, (d - after) / np.where(before == after, np.inf, before - after), 0.0)
        u = (NODES + 1) / 2
        a = np.where(smooth & ~level & ~stepped, (after - before) / 2, 0.0)[:, None]
        curve = _means(x[:-1, None] + d[:, None] * u + 0.5 * a * (u**2 - u))
        corner = x[:-1] + part * before
        first = _means(x[:-1, None] + (corner - x[:-1])[:, None] * u)
        second = _means(corner[:, None] + (x[1:] - corner)[:, None] * u)
        cosine, sine = np.where(stepped, part * first + (1 - part) * second, curve)
        return cls(cosine, sine, (smooth | level | stepped) & (np.abs(d) < LONGEST))


def _means(x: Array) -> Array:
    return np.array([np.cos(x) @ WEIGHTS, np.sin(x) @ WEIGHTS]) / 2
