"""Harmonics of the perfect resonator side by side; a vector is of cos kθ and sin kθ at once: (unknowns, vectors, 2)."""

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy

from shell.elastic import Constants
from shell.imperfection.block import Block
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.system import ShellGroup

WORKSPACE = 1 << 19  # numbers that a solve uses and frees again
PLACES = 16  # of masses whose displacements are kept


class Together:
    """Harmonics that take part, one after the other."""

    def __init__(self, blocks: Sequence[Block], resonator: Resonator, constants: tuple[Constants, ...]) -> None:
        self.blocks, self.resonator, self.constants = tuple(blocks), resonator, constants
        self.harmonics = tuple(block.system.n for block in blocks)
        ends = np.cumsum([0, *(block.size for block in blocks)])
        self.size = int(ends[-1])
        self.rows = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        self.groups = blocks[0].system.groups
        np.empty(WORKSPACE)  # freed at once, so that the process keeps the memory of each solve for the next
        self._places: dict[tuple[float, float], tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix]] = {}

    @cached_property
    def spreads(self) -> "dict[int, tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix]]":
        """From the unknowns to those of the elements of every chain of shell, in the plain basis, and the transpose."""
        found = {}
        for number in self.blocks[0].spreads:
            whole = scipy.sparse.csr_matrix(scipy.sparse.block_diag([block.spreads[number] for block in self.blocks]))
            found[number] = whole, scipy.sparse.csr_matrix(whole.T)
        return found

    def plain(self, number: int, X: Array) -> Array:
        """Unknowns of a chain's elements, (amplitudes, elements, functions, vectors, harmonics, 2)."""
        found = self.spreads[number][0] @ X.reshape(self.size, -1)
        table, (elements, _) = self._chain(number).table, self._chain(number).unknowns.shape
        found = found.reshape(len(self.harmonics), elements, table.along.shape[2], -1, X.shape[1], 2)
        return np.ascontiguousarray(found.transpose(3, 1, 2, 4, 0, 5))

    def gather(self, number: int, loads: Array) -> Array:
        """Loads on the unknowns from those on a chain's elements, which are laid out as in `plain`."""
        vectors = loads.shape[3]
        rows = loads.transpose(4, 1, 2, 0, 3, 5).reshape(-1, 2 * vectors)
        return np.asarray(self.spreads[number][1] @ rows).reshape(self.size, vectors, 2)

    def moves(self, position: float, height: float) -> "tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix]":
        """Displacements u, v, w of a place in every harmonic per unit of every unknown, (3 harmonics, size), and the transpose."""
        if (position, height) not in self._places:
            if len(self._places) >= PLACES:
                self._places.clear()
            rows = [block.moves(self.resonator, position, height) for block in self.blocks]
            whole = scipy.sparse.csr_matrix(scipy.sparse.block_diag([scipy.sparse.csr_matrix(one) for one in rows]))
            self._places[position, height] = whole, scipy.sparse.csr_matrix(whole.T)
        return self._places[position, height]

    def answer(self, loads: Array) -> Array:
        """-(K - λ M)⁻¹ of loads in every harmonic; in the pair's own without the pair, for which it is singular."""
        parts = [one.answer(loads[at].reshape(one.size, -1)) for one, at in zip(self.blocks, self.rows, strict=True)]
        return -np.concatenate(parts).reshape(loads.shape)

    def weigh(self, X: Array) -> Array:
        """M of every harmonic times vectors."""
        parts = [one.weigh(X[at].reshape(one.size, -1)) for one, at in zip(self.blocks, self.rows, strict=True)]
        return np.concatenate(parts).reshape(X.shape)

    def _chain(self, number: int) -> ShellGroup:
        group = self.groups[number]
        assert isinstance(group, ShellGroup)
        return group
