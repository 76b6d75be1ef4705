"""Which raw unknowns are free and which follow others: poles, clamps, edges that solids share with shells."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from shell.quadrature import Array

Index = NDArray[np.intp]


class Rows:
    """Raw unknowns that are not free: each is nothing, or a sum of factors times free ones."""

    def __init__(self) -> None:
        self._held: list[Index] = []
        self._followers: list[Index] = []
        self._masters: list[Index] = []
        self._factors: list[Array] = []

    def hold(self, unknowns: Index) -> None:
        """Take unknowns out."""
        self._held.append(unknowns.ravel())

    def follow(self, unknowns: Index, masters: Index, factors: Array) -> None:
        """Let unknowns follow masters; the terms of one that appears several times add up."""
        self.hold(unknowns)
        self._followers.append(unknowns.ravel())
        self._masters.append(masters.ravel())
        self._factors.append(factors.ravel())

    def extend(self, more: "Rows") -> None:
        """Take over the rows of others."""
        self._held += more._held
        self._followers += more._followers
        self._masters += more._masters
        self._factors += more._factors

    def matrix(self, size: int) -> csr_matrix:
        """The sparse matrix from free to raw unknowns; an unknown without a row is free."""
        is_free = np.ones(size, dtype=bool)
        is_free[np.concatenate([np.zeros(0, dtype=np.intp), *self._held])] = False
        column = np.cumsum(is_free) - 1
        free = np.flatnonzero(is_free)
        rows = np.concatenate([free, *self._followers])
        columns = column[np.concatenate([free, *self._masters])]
        values = np.concatenate([np.ones(len(free)), *self._factors])
        return csr_matrix((values, (rows, columns)), shape=(size, len(free)))
