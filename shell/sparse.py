"""Sparse matrices: sums of element matrices and their factors, and which raw unknowns are free and which follow others."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from shell.quadrature import Array

Index = NDArray[np.intp]
PIVOTING = 0.01  # of matrices that are not definite


def assemble_elements(
    unknowns: Sequence[Index] | Index, elements: Sequence[NDArray[Any]] | NDArray[Any], size: int
) -> "scipy.sparse.csc_matrix":
    """The sum of element matrices, each on its unknowns, (size, size)."""
    numbers = [np.asarray(own, dtype=np.int32) for own in unknowns]
    rows = np.concatenate([np.repeat(own, len(own)) for own in numbers])
    columns = np.concatenate([np.tile(own, len(own)) for own in numbers])
    values = np.concatenate([np.ravel(one) for one in elements])
    return scipy.sparse.csc_matrix((values, (rows, columns)), shape=(size, size))


def factor_symmetric(
    matrix: "scipy.sparse.csc_matrix", pivoting: float = 0.0, is_ordered: bool = False
) -> Callable[[NDArray[Any]], NDArray[Any]]:
    """The solution of A x = b as a function of b; an indefinite A needs some `pivoting`, up to 1."""
    from scipy.sparse.linalg import splu

    order: Literal["NATURAL", "MMD_AT_PLUS_A"] = "NATURAL" if is_ordered else "MMD_AT_PLUS_A"
    options = {"SymmetricMode": True}
    return splu(scipy.sparse.csc_matrix(matrix), permc_spec=order, diag_pivot_thresh=pivoting, options=options).solve


def dissect(places: NDArray[np.intp], least: int = 150) -> Index:
    """An order of the nodes (count, axes) of a grid in which a factor fills least: halves first, the even plane between last."""
    if len(places) < least:
        return np.arange(len(places))
    axis = int(np.argmax(np.ptp(places, axis=0)))
    x = places[:, axis]
    middle = int(np.median(x)) // 2 * 2
    middle += 2 * (middle <= x.min())
    if middle >= x.max():
        return np.arange(len(places))
    halves = [np.flatnonzero(side) for side in (x < middle, x > middle)]
    return np.concatenate([*(one[dissect(places[one], least)] for one in halves), np.flatnonzero(x == middle)])


class Rows:
    """Raw unknowns that are not free: each is nothing, or a sum of factors times free ones."""

    def __init__(self) -> None:
        self._held: list[Index] = []
        self._terms: list[tuple[Index, Index, Array]] = []  # followers, masters, factors

    def hold(self, unknowns: Index) -> None:
        """Take unknowns out."""
        self._held.append(unknowns.ravel())

    def follow(self, unknowns: Index, masters: Index, factors: Array) -> None:
        """Let unknowns follow masters; the terms of one that appears several times add up."""
        self.hold(unknowns)
        self._terms.append((unknowns.ravel(), masters.ravel(), factors.ravel()))

    def extend(self, more: "Rows") -> None:
        """Take over the rows of others."""
        self._held += more._held
        self._terms += more._terms

    def matrix(self, size: int) -> "scipy.sparse.csr_matrix":
        """The sparse matrix from free to raw unknowns; an unknown without a row is free."""
        is_free = np.ones(size, dtype=bool)
        is_free[np.concatenate([np.zeros(0, dtype=np.intp), *self._held])] = False
        free = np.flatnonzero(is_free)
        terms = zip((free, free, np.ones(len(free))), *self._terms, strict=True)
        rows, masters, values = (np.concatenate(column) for column in terms)
        return scipy.sparse.csr_matrix((values, (rows, np.searchsorted(free, masters))), shape=(size, len(free)))
