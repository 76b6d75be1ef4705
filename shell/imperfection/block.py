r"""One harmonic of the perfect resonator on the unknowns of its shell alone, its solid parts condensed at λ.

Inside a solid part (i) nothing but the shell's edges (I) pulls, so that x_i = W x_I,  W = -A_ii⁻¹ A_iI,  A = K - λ M,
and the shell feels A_II + A_Ii W. What an imperfection does inside a solid part is felt through the same W.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, eye, hstack, vstack
from scipy.sparse.linalg import SuperLU, splu

from shell.constraints import Index
from shell.imperfection.place import cut
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.solution import Constants
from shell.system import Inertia, ShellGroup, System

PLACES = 16  # of masses whose displacements are kept


@dataclass(frozen=True, eq=False)
class Block:
    """A harmonic k, prepared for any imperfection.

    Attributes
    ----------
    shell : the free unknowns of the shell, (size,), which are the unknowns here.
    shared : which of them the solid parts share, numbers among `shell`.
    inside, lifted : free unknowns inside the solid parts, and W, (inside, shared).
    matrix : K - λ M, condensed. mass : of all elements, times what the harmonic has around.
    kept : M times the pair's vector in the pair's own block.
    """

    system: System
    shell: Index
    shared: Index
    inside: Index
    lifted: Array
    matrix: csr_matrix
    mass: Inertia
    around: float
    kept: Array | None
    places: dict[tuple[float, float], Array] = field(default_factory=dict, repr=False)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.shell)

    @cached_property
    def spreads(self) -> dict[int, tuple[csr_matrix, csr_matrix]]:
        """From the unknowns to those of the elements of every chain of shell, in the plain basis, and the transpose."""
        found = {}
        for number, group in enumerate(self.system.groups):
            if isinstance(group, ShellGroup):
                spread = _plain(group, self.system.constraint)[:, self.shell]
                found[number] = spread, spread.T.tocsr()
        return found

    def moves(self, resonator: Resonator, position: float, height: float) -> Array:
        """Displacements u, v, w of a place per unit of every unknown, (3, size)."""
        if (position, height) not in self.places:
            here = cut(resonator, self.system, position, np.array([height]))
            table = here.table.displacement[0, 0, :, 0]
            spread = self.spreads[here.group][0]
            size = spread.shape[0] // len(self.system.groups[here.group].unknowns)
            rows = spread[here.element * size : (here.element + 1) * size]
            local = np.einsum("f,ca->cfa", here.along[0], table).reshape(3, size)
            if len(self.places) >= PLACES:
                self.places.clear()
            self.places[position, height] = np.asarray((rows.T @ local.T).T)
        return self.places[position, height]

    @cached_property
    def factor(self) -> SuperLU:
        """Of the matrix; in the pair's own block with a border that keeps the answers free of the pair."""
        if self.kept is None:
            return splu(self.matrix.tocsc())
        scale = abs(self.matrix).max() / np.abs(self.kept).max()
        border = csr_matrix(scale * self.kept[None])
        side = vstack([border.T, csr_matrix((1, 1))])
        return splu(csc_matrix(hstack([vstack([self.matrix, border]), side])))

    def answer(self, loads: Array) -> Array:
        """-(K_k - λ M_k)⁻¹ of loads (columns, size); in the pair's own block without the pair, for which it is singular."""
        if self.kept is None:
            return np.asarray(-self.factor.solve(loads.T).T)
        return np.asarray(-self.factor.solve(np.pad(loads.T, ((0, 1), (0, 0)))).T[:, :-1])

    def weigh(self, x: Array) -> Array:
        """M_k of unknowns (rows, size), what moves in the solid parts with them counted."""
        free = np.zeros((self.system.constraint.shape[1], len(x)))
        free[self.shell] = x.T
        free[self.inside] = self.lifted @ x.T[self.shared]
        moved = self.around * np.asarray(self.mass @ free)
        found = moved[self.shell]
        found[self.shared] += self.lifted.T @ moved[self.inside]
        return np.asarray(found.T)

    def inner(self, number: int) -> Array:
        """What a unit of each shared unknown moves in a solid part: (shared, cells, size) in the plain basis."""
        free = np.zeros((self.system.constraint.shape[1], len(self.shared)))
        free[self.shell[self.shared], np.arange(len(self.shared))] = 1.0
        free[self.inside] = self.lifted
        raw = self.system.constraint @ free
        return np.array([self.system.groups[number].spread(column) for column in raw.T])


def condense(system: System, constants: tuple[Constants, ...], value: float, pair: Array | None = None) -> Block:
    """One harmonic with its solid parts condensed at λ = value; `pair` is the pair's vector in its own."""
    lam, G = ([one.lame[which] for one in constants] for which in (0, 1))
    matrices, mass = system.operators(lam, G, [one.rho for one in constants], False, -value)
    numbers = system.pattern.unknowns
    of_shell = [isinstance(group, ShellGroup) for group in system.groups for _ in group.unknowns]
    shell = np.unique(np.concatenate([one for one, mine in zip(numbers, of_shell, strict=True) if mine]))
    size = system.pattern.size

    def assemble(of: bool) -> csr_matrix:
        kept = [(n, m) for n, m, mine in zip(numbers, matrices, of_shell, strict=True) if mine is of]
        return _assemble(kept, size)

    matrix = assemble(True)[shell][:, shell]
    shared = inside = np.zeros(0, dtype=np.intp)
    lifted = np.zeros((0, 0))
    if not all(of_shell):
        solid = np.unique(np.concatenate([one for one, mine in zip(numbers, of_shell, strict=True) if not mine]))
        inside, edge = np.setdiff1d(solid, shell), np.intersect1d(solid, shell)
        shared = np.searchsorted(shell, edge)
        core = assemble(False)
        coupling = core[inside][:, edge].toarray()
        lifted = -splu(core[inside][:, inside].tocsc()).solve(coupling)
        felt = core[edge][:, edge].toarray() + coupling.T @ lifted
        rows, columns = np.meshgrid(shared, shared, indexing="ij")
        matrix = matrix + csr_matrix(((felt + felt.T).ravel() / 2, (rows.ravel(), columns.ravel())), shape=matrix.shape)
    kept = None
    if pair is not None:
        moved = np.asarray(mass @ pair[:, None])[:, 0]
        kept = moved[shell]
        kept[shared] += lifted.T @ moved[inside]
    around = pi * (2 if system.n == 0 else 1)
    return Block(system, shell, shared, inside, lifted, around * matrix, mass, around, kept)


def _assemble(elements: Iterable[tuple[NDArray[np.intp], Array]], size: int) -> csr_matrix:
    rows, columns, values = [], [], []
    for numbers, matrix in elements:
        rows.append(np.repeat(numbers, len(numbers)))
        columns.append(np.tile(numbers, len(numbers)))
        values.append(matrix.ravel())
    place = (np.concatenate(rows), np.concatenate(columns))
    return coo_matrix((np.concatenate(values), place), shape=(size, size)).tocsr()


def _plain(group: ShellGroup, constraint: csr_matrix) -> csr_matrix:
    """Rows of the constraint for the unknowns of a chain's elements, its small elements out of their differences."""
    rows = constraint[group.unknowns.ravel()]
    elements, size = group.unknowns.shape
    functions = group.table.along.shape[2]
    amplitudes = size // functions
    for element, node in group.anchors:
        others = np.delete(np.arange(functions), node)
        to = (element * size + others[:, None] * amplitudes + np.arange(amplitudes)).ravel()
        of = np.tile(element * size + node * amplitudes + np.arange(amplitudes), len(others))
        more = csr_matrix((np.ones(len(to)), (to, of)), shape=(elements * size,) * 2)
        rows = (eye(elements * size, format="csr") + more) @ rows
    return rows
