r"""One harmonic of the perfect resonator on the unknowns of its shell alone, its solid parts condensed at λ.

Inside a solid part (i) nothing but the shell's edges (I) pulls, so that x_i = W x_I,  W = -A_ii⁻¹ A_iI,  A = K - λ M,
and the shell feels A_II + A_Ii W. What an imperfection does inside a solid part is felt through the same W.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import pi

import numpy as np
import scipy

from shell.cross_section import cut
from shell.elastic import Constants
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.sparse import PIVOTING, Index, assemble_elements, factor_symmetric
from shell.system import ElementSum, ShellGroup, System


@dataclass(frozen=True, eq=False)
class Block:
    """A harmonic k, prepared for any imperfection."""

    system: System
    shell: Index  # the free unknowns of the shell, (size,), which are the unknowns here
    shared: Index  # which of them the solid parts share, numbers among `shell`
    inside: Index  # inside, lifted: free unknowns inside the solid parts, and W, (inside, shared)
    lifted: Array
    elements: tuple[tuple[Index, Array], ...]  # (unknowns, matrix) of K - λ M, the condensed solid parts as one element
    around: float  # ∫ cos² kθ dθ
    mass: ElementSum  # of all free unknowns, over `around`
    kept: Array | None  # M times the pair's vector in the pair's own block

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.shell)

    @cached_property
    def spreads(self) -> "dict[int, scipy.sparse.csr_matrix]":
        """From the unknowns to those of the elements of every chain of shell, in the plain basis."""
        return {number: self.system.plain[number][:, self.shell] for number in self.system.chains}

    def moves(self, resonator: Resonator, position: float, height: float) -> Array:
        """Displacements u, v, w of a place, at a height -1 (inner) ... 1 (outer face), per unit of every unknown, (3, size)."""
        here = cut(resonator, self.system, position, np.array([resonator.outward * height]))
        return here.rows(self.spreads[here.group])

    @cached_property
    def answer(self) -> Callable[[Array], Array]:
        """(K - λ M)⁻¹ of loads (size, columns); in the pair's own block without the pair, for which it is singular."""
        unknowns, matrices = zip(*self.elements, strict=True)
        A = assemble_elements(unknowns, matrices, self.size)
        if self.kept is None:
            return factor_symmetric(A, PIVOTING)
        border = abs(A).max() / np.abs(self.kept).max() * self.kept[:, None]  # it keeps the answers free of the pair
        solve = factor_symmetric(scipy.sparse.bmat([[A, border], [border.T, None]]), PIVOTING)
        return lambda loads: np.asarray(solve(np.vstack([loads, np.zeros((1, loads.shape[1]))]))[:-1])

    def weigh(self, X: Array) -> Array:
        """M times vectors (size, columns), the solid parts moved along."""
        y = self.mass @ self._moved(X)
        found = y[self.shell]
        found[self.shared] += self.lifted.T @ y[self.inside]
        return np.asarray(self.around * found)

    def inner(self, number: int) -> Array:
        """What a unit of each shared unknown moves in a solid part: (shared, cells, size) in the plain basis."""
        moved = self.system.plain[number] @ self._moved(np.eye(self.size)[:, self.shared])
        return np.asarray(moved.T.reshape(-1, *self.system.groups[number].unknowns.shape))

    def _moved(self, X: Array) -> Array:
        """All free unknowns of vectors."""
        free = np.zeros((self.system.constraint.shape[1], X.shape[1]))
        free[self.shell] = X
        free[self.inside] = self.lifted @ X[self.shared]
        return free


def condense(system: System, constants: tuple[Constants, ...], value: float, pair: Array | None = None) -> Block:
    """One harmonic with its solid parts condensed at λ = value; `pair` is the pair's vector in its own."""
    matrices, mass = system.operators(constants, -value)
    around = pi * (2 if system.n == 0 else 1)
    of_shell = [isinstance(group, ShellGroup) for group in system.groups for _ in group.unknowns]
    known = list(zip(system.pattern.unknowns, matrices, of_shell, strict=True))
    walls, cells = ([(own, A) for own, A, mine in known if mine is kind] for kind in (True, False))
    shell = np.unique(np.concatenate([own for own, _ in walls]))
    elements = [(np.searchsorted(shell, own), around * A) for own, A in walls]
    shared = inside = np.zeros(0, dtype=np.intp)
    lifted = np.zeros((0, 0))
    if cells:
        solid = np.unique(np.concatenate([own for own, _ in cells]))
        inside, edge = np.setdiff1d(solid, shell), np.intersect1d(solid, shell)
        shared = np.searchsorted(shell, edge)
        members, stiff = zip(*cells, strict=True)
        core = assemble_elements(members, stiff, system.pattern.size)
        coupling = core[inside][:, edge].toarray()
        lifted = -factor_symmetric(core[inside][:, inside], PIVOTING)(coupling)
        felt = core[edge][:, edge].toarray() + coupling.T @ lifted
        elements.append((shared, around * (felt + felt.T) / 2))
    kept = None
    if pair is not None:
        pull = mass @ pair
        kept = pull[shell]
        kept[shared] += lifted.T @ pull[inside]
    return Block(system, shell, shared, inside, lifted, tuple(elements), around, mass, kept)


WORKSPACE = 1 << 19  # numbers that a solve uses and frees again
PLACES = 16  # of masses whose displacements are kept


class Together:
    """Harmonics that take part, side by side; a vector is of cos kθ and sin kθ at once: (unknowns, vectors, 2)."""

    def __init__(self, blocks: Sequence[Block], resonator: Resonator, constants: tuple[Constants, ...]) -> None:
        self.blocks, self.resonator, self.constants = tuple(blocks), resonator, constants
        self.harmonics = tuple(block.system.n for block in blocks)
        ends = np.cumsum([0, *(block.size for block in blocks)])
        self.size = int(ends[-1])
        self.rows = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        np.empty(WORKSPACE)  # freed at once, so that the process keeps the memory of each solve for the next
        self.moves = lru_cache(PLACES)(self._find_moves)

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
        group = self.blocks[0].system.chains[number]
        functions = group.table.along.shape[2]
        found = found.reshape(len(self.harmonics), len(group.unknowns), functions, -1, X.shape[1], 2)
        return np.ascontiguousarray(found.transpose(3, 1, 2, 4, 0, 5))

    def gather(self, number: int, loads: Array) -> Array:
        """Loads on the unknowns from those on a chain's elements, which are laid out as in `plain`."""
        vectors = loads.shape[3]
        rows = loads.transpose(4, 1, 2, 0, 3, 5).reshape(-1, 2 * vectors)
        return np.asarray(self.spreads[number][1] @ rows).reshape(self.size, vectors, 2)

    def _find_moves(self, position: float, height: float) -> "tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix]":
        """Displacements u, v, w of a place in every harmonic per unit of every unknown, (3 harmonics, size), and the transpose."""
        rows = [scipy.sparse.csr_matrix(block.moves(self.resonator, position, height)) for block in self.blocks]
        whole = scipy.sparse.csr_matrix(scipy.sparse.block_diag(rows))
        return whole, scipy.sparse.csr_matrix(whole.T)

    def answer(self, loads: Array) -> Array:
        """-(K - λ M)⁻¹ of loads in every harmonic; in the pair's own without the pair, for which it is singular."""
        parts = [one.answer(loads[at].reshape(one.size, -1)) for one, at in zip(self.blocks, self.rows, strict=True)]
        return -np.concatenate(parts).reshape(loads.shape)

    def weigh(self, X: Array) -> Array:
        """M of every harmonic times vectors."""
        parts = [one.weigh(X[at].reshape(one.size, -1)) for one, at in zip(self.blocks, self.rows, strict=True)]
        return np.concatenate(parts).reshape(X.shape)
