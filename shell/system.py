"""Elements and their matrices: groups of one kind, and the system of all of them on the free unknowns."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from shell.blocks import Mesh
from shell.constraints import Index
from shell.eigen import Pattern, find_pattern
from shell.kernel import (
    Section,
    StrainTable,
    pair_mass,
    pair_stiffness,
    station_mass,
    station_stiffness,
)
from shell.layout import Chain
from shell.levels import Level
from shell.quadrature import Array

PORTION = 16  # elements integrated at a time
TINY = 160  # unknowns of a dense matrix


@dataclass(frozen=True, eq=False)
class ShellPart:
    """Where the elements of a chain lie: the chain, its sections at the stations, its ends."""

    chain: Chain
    section: Section


@dataclass(frozen=True, eq=False)
class SolidPart:
    """Where the cells of a solid part lie, and which of their sides (cell, side) are free or held surface."""

    mesh: Mesh
    surface: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Group:
    """Elements of one kind: their strain table, their unknowns with orientation signs, where they lie."""

    table: StrainTable
    unknowns: Index
    signs: Array
    place: ShellPart | SolidPart
    anchors: tuple[tuple[int, int], ...] = ()

    def matrices(self, integrate: Callable[[Array, Array], Array], stations: Array, first: int) -> Array:
        """Integrals over the elements from `first` on of their station matrices, in the unknowns that are solved for.

        In the small elements at a free edge these are the values at the inner node and differences from them: `anchors`
        are such (element, node). Else the layers' stiff shear would drown the bending as (R/h)³ instead of (R/h)².
        """
        found = integrate(stations, self.table.along)
        for element, node in self.anchors:
            if first <= element < first + len(stations):
                along = self.table.along.copy()
                along[0, :, node], along[1, :, node] = 1.0, 0.0
                found[element - first] = integrate(stations[[element - first]], along)[0]
        return found

    def spread(self, raw: Array) -> Array:
        """Unknowns (elements, size) of the plain basis."""
        unknowns = raw[self.unknowns]
        if isinstance(self.place, SolidPart):
            unknowns *= self.signs.reshape(self.signs.shape + (1,) * (raw.ndim - 1))
        for element, node in self.anchors:
            amplitudes = unknowns[element].reshape(self.table.along.shape[2], -1)
            inner = amplitudes[node].copy()
            amplitudes += inner
            amplitudes[node] = inner
        return np.asarray(unknowns)

    def gather(self, amplitudes: Array, raw: Array) -> None:
        """The way back for a shell: write `amplitudes` (elements, functions, amplitudes, columns) to the raw unknowns."""
        for element, node in self.anchors:
            inner = amplitudes[element, node].copy()
            amplitudes[element] -= inner
            amplitudes[element, node] = inner
        raw[self.unknowns] = amplitudes.reshape(*self.unknowns.shape, -1)


@dataclass(frozen=True, eq=False)
class System:
    """Every element of a resonator at one harmonic and level, with the constraints between raw and free unknowns.

    raw = constraint @ free. Matrices come per unit λ, G, ρ, so that a new material or temperature costs no geometry.
    """

    groups: tuple[Group, ...]
    constraint: csr_matrix
    rigid_motions: int
    n: int
    level: Level

    @cached_property
    def free(self) -> Index:
        """The raw unknown that each free one is: the first of those that follow it."""
        columns = self.constraint.tocsc()
        return np.asarray(columns.indices[columns.indptr[:-1]], dtype=np.intp)

    @property
    def pattern(self) -> Pattern:
        """The elements' free unknowns."""
        return self._elements[0]

    @property
    def maps(self) -> list["ToFree"]:
        """From the unknowns of every element to its free ones, in the order of `pattern`."""
        return self._elements[1]

    @cached_property
    def _elements(self) -> tuple[Pattern, list["ToFree"]]:
        counts = np.diff(self.constraint.indptr)
        column = np.full(len(counts), -1, dtype=np.intp)
        column[counts == 1] = self.constraint.indices[self.constraint.indptr[:-1][counts == 1]]
        follows = counts > 0
        follows[self.free] = False
        maps: list[ToFree] = []
        for group in self.groups:
            columns, tied = column[group.unknowns], np.any(follows[group.unknowns], axis=1)
            for members, own, signs, general in zip(group.unknowns, columns, group.signs, tied, strict=True):
                kept = np.flatnonzero(own >= 0)
                maps.append(self._free(members, signs) if general else ToFree(own[kept], kept, signs[kept]))
        pattern = find_pattern([at.free for at in maps], self.constraint.shape[1])
        return pattern, [at.reordered(order) for at, order in zip(maps, pattern.order, strict=True)]

    @property
    def is_small(self) -> bool:
        """Whether the matrices are worth keeping: below 24 MB."""
        return sum(len(at.free) ** 2 for at in self.maps) < 1e6

    @property
    def is_tiny(self) -> bool:
        """Whether one dense matrix costs less than the elements one by one."""
        return len(self.groups) == 1 and self.constraint.shape[1] <= TINY

    @cached_property
    def units(self) -> list[Array]:
        """Element matrices on free unknowns per unit λ, G and ρ, (3, size, size) each, the same material everywhere."""
        found: list[Array] = []
        for group, first, part, maps in self._portions():
            trace, shear = station_stiffness(part)
            kinds = (
                group.matrices(pair_stiffness, trace, first),
                group.matrices(pair_stiffness, shear, first),
                group.matrices(pair_mass, station_mass(part), first),
            )
            found += [at.collect(element) for *element, at in zip(*kinds, maps, strict=True)]
        return found

    @cached_property
    def whole(self) -> tuple[Pattern, list[Array]]:
        """The units of all elements as of one, of a small shell without solid parts: fewer and larger products."""
        size = self.pattern.size
        merged = np.zeros((3, size, size))
        for members, kinds in zip(self.pattern.unknowns, self.units, strict=True):
            merged[:, members[:, None], members] += kinds
        return find_pattern([np.arange(size)], size), [merged]

    def varying(self, lam: list[Array], G: list[Array], rho: list[Array]) -> tuple[list[Array], list[Array]]:
        """Stiffness and mass of every element with λ, G, ρ given at the stations of every group."""
        K: list[Array] = []
        M: list[Array] = []
        fields = iter(
            [
                (a[k : k + PORTION], b[k : k + PORTION], c[k : k + PORTION])
                for a, b, c in zip(lam, G, rho, strict=True)
                for k in range(0, len(a), PORTION)
            ]
        )
        for group, first, part, maps in self._portions():
            lam_there, G_there, rho_there = (field[..., None, None] for field in next(fields))
            trace, shear = station_stiffness(part)
            trace *= lam_there
            trace += G_there * shear
            stiffness = group.matrices(pair_stiffness, trace, first)
            mass = group.matrices(pair_mass, rho_there * station_mass(part), first)
            for k, m, at in zip(stiffness, mass, maps, strict=True):
                K.append(at.collect([k])[0])
                M.append(at.collect([m])[0])
        return K, M

    def _portions(self) -> Iterator[tuple[Group, int, StrainTable, list["ToFree"]]]:
        """A few elements at a time, so that the passing arrays stay small."""
        done = 0
        for group in self.groups:
            for k in range(0, len(group.unknowns), PORTION):
                part = group.table.part(slice(k, k + PORTION))
                count = len(part.volume)
                yield group, k, part, self.maps[done : done + count]
                done += count

    def spread(self, free: Array) -> list[Array]:
        """Element unknowns (elements, size) of every group from the free unknowns of one vector."""
        raw = self.constraint @ free
        return [group.spread(raw) for group in self.groups]

    def _free(self, members: Index, signs: Array) -> "ToFree":
        rows = self.constraint[members]
        free = np.unique(rows.indices).astype(np.intp)
        return ToFree(free, None, signs[:, None] * rows[:, free].toarray())


@dataclass(frozen=True, eq=False)
class ToFree:
    """From an element's unknowns to free ones: a choice with signs, or (kept None) a full matrix of factors."""

    free: Index
    kept: Index | None
    factors: Array

    def reordered(self, order: Index) -> "ToFree":
        """The same with the free unknowns in another order."""
        if self.kept is None:
            return ToFree(self.free[order], None, self.factors[:, order])
        return ToFree(self.free[order], self.kept[order], self.factors[order])

    def restrict(self, matrix: Array) -> Array:
        """The element's matrix on the free unknowns."""
        if self.kept is None:
            return np.asarray(self.factors.T @ matrix @ self.factors)
        return self._signed(matrix[self.kept[:, None], self.kept])

    def collect(self, pairs: list[Array]) -> Array:
        """Some matrices on the free unknowns from their integrals (functions², amplitudes²), (kinds, free, free)."""
        functions, m = (round(x**0.5) for x in pairs[0].shape)
        local = np.arange(functions * m) if self.kept is None else self.kept
        function, amplitude = np.divmod(local, m)
        rows, columns = (function * functions * m + amplitude) * m, function * m * m + amplitude
        where = rows[:, None] + columns
        found = np.empty((len(pairs), *where.shape))
        for matrix, integrals in zip(found, pairs, strict=True):
            integrals.ravel().take(where, out=matrix, mode="clip")  # this mode takes without a copy
        if self.kept is None:
            return np.asarray(self.factors.T @ found @ self.factors)
        return self._signed(found)

    def _signed(self, matrices: Array) -> Array:
        if np.any(self.factors < 0):
            matrices *= self.factors
            matrices *= self.factors[:, None]
        return matrices
