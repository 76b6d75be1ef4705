"""Interpolation of a smooth function of several numbers through as few evaluations as its smoothness allows.

Newton's form on a sparse grid of Leja points of the cube -1 ... 1 (Chkifa, Cohen, Schwab 2014; Gerstner, Griebel 2003):

    p(x) = Σ_i s_i Π_a N_{i_a}(x_a),      N_j(x) = Π_{k<j} (x − l_k)/(l_j − l_k),

over a set of indices i that holds with each index all that lie below it. l_j is where |Π_{k<j} (x − l_k)| is largest, so
that every |N_j| ≤ 1 and the surplus s_i, the function at the new point minus what is known of it there, bounds what
its term adds anywhere. One evaluation buys one term; the next index is the one whose surplus was the largest.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from shell.quadrature import Array

Index = tuple[int, ...]
MOST_POINTS = 33  # along one axis


@cache
def leja_points() -> Array:
    """The sequence 0, 1, −1, …, each where the product of the distances to those before is largest."""
    grid = np.cos(np.linspace(0.0, np.pi, 20_001))
    points, product = [0.0, 1.0, -1.0], abs(grid * (grid - 1) * (grid + 1))
    while len(points) < MOST_POINTS:
        points.append(float(grid[np.argmax(product)]))
        product = product * abs(grid - points[-1])
    return np.array(points)


def tabulate(x: Array, count: int) -> Array:
    """N_0 … N_{count−1} at points (m,), (count, m)."""
    points = leja_points()[: count - 1, None]
    products = np.cumprod(np.concatenate([np.ones((1, len(x))), x - points]), axis=0)
    return np.asarray(products / [[np.prod(point - points[:j])] for j, point in enumerate(leja_points()[:count])])


@dataclass(frozen=True, eq=False)
class SparsePolynomial:
    """The interpolant of a vector function."""

    indices: tuple[Index, ...]  # in lexical order
    surpluses: Array  # (terms, outputs)

    def __call__(self, x: Array) -> Array:
        """Values (m, outputs) at points (m, dimensions); no point depends on the others."""
        counts = (1 + max(index[axis] for index in self.indices) for axis in range(x.shape[1]))
        tables = [tabulate(column, count) for column, count in zip(x.T, counts, strict=True)]
        found = np.zeros((self.surpluses.shape[1], len(x)))
        products = [np.ones(len(x))]  # of the factors up to each axis: neighbours share the first ones
        last: Index = ()
        for index, surplus in zip(self.indices, self.surpluses, strict=True):
            same = next((k for k, (a, b) in enumerate(zip(index, last, strict=False)) if a != b), len(last))
            del products[same + 1 :]
            for axis in range(same, len(index)):
                products.append(products[-1] * tables[axis][index[axis]])
            found += surplus[:, None] * products[-1]
            last = index
        return found.T


@dataclass
class Exploration:
    """A sparse grid that grows where the first output of a function needs it."""

    function: Callable[[Array], Array]  # point (dimensions,) -> outputs (k,)
    dimensions: int
    surpluses: dict[Index, Array] = field(default_factory=dict)  # of every index evaluated so far
    _settled: set[Index] = field(default_factory=set)

    @property
    def frontier(self) -> list[Index]:
        """Indices evaluated whose neighbours above are not."""
        return [index for index in self.surpluses if index not in self._settled]

    @property
    def pending(self) -> float:
        """The largest surplus of the first output on the frontier."""
        return max((abs(float(self.surpluses[index][0])) for index in self.frontier), default=0.0)

    def refine(self, threshold: float, most: int) -> bool:
        """Grow by at most about `most` evaluations until no surplus on the frontier exceeds the threshold; False where it still does."""
        self.polynomial()
        zero = (0,) * self.dimensions
        for index in (zero, *(_above(zero, axis) for axis in range(self.dimensions))):  # all terms of the second degree
            if index not in self._settled:
                self._settle(index)
        while self.pending > threshold:
            largest = max(self.frontier, key=lambda index: abs(float(self.surpluses[index][0])))
            if len(self.surpluses) >= most or max(largest) + 1 == MOST_POINTS:
                return False
            self._settle(largest)
        return True

    def polynomial(self) -> SparsePolynomial:
        """The interpolant through everything evaluated so far; at first through the middle alone."""
        if not self.surpluses:
            self._evaluate((0,) * self.dimensions)
        indices = tuple(sorted(self.surpluses))
        return SparsePolynomial(indices, np.array([self.surpluses[index] for index in indices]))

    def _settle(self, index: Index) -> None:
        self._settled.add(index)
        for axis in range(self.dimensions):
            new = _above(index, axis)
            below = [_above(new, other, -1) for other in range(self.dimensions) if new[other]]
            if all(one in self._settled for one in below):
                self._evaluate(new)

    def _evaluate(self, index: Index) -> None:
        point = leja_points()[list(index)]
        value = np.asarray(self.function(point), dtype=float)
        self.surpluses[index] = value - (self.polynomial()(point[None])[0] if self.surpluses else 0.0)


def _above(index: Index, axis: int, by: int = 1) -> Index:
    return (*index[:axis], index[axis] + by, *index[axis + 1 :])
