"""Elements and their matrices: groups of one kind, and the system of all of them on the free unknowns."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_matrix

from shell.blocks import Boundary, Mesh
from shell.cells import CellTable, cell_mass, cell_stiffness
from shell.constraints import Index
from shell.eigen import Pattern, find_pattern
from shell.kernel import (
    Section,
    StrainTable,
    integrate_mass,
    integrate_stiffness,
    station_mass,
    station_stiffness,
)
from shell.layout import Chain
from shell.levels import Level
from shell.quadrature import Array

Pair: TypeAlias = tuple[Array, Array]
PORTION = 16  # elements integrated at a time
TINY = 160  # unknowns of a dense matrix
KEPT = 3_000_000  # numbers that a system may keep for the next material (24 MB)


@dataclass(frozen=True, eq=False)
class ShellPart:
    """Where the elements of a chain lie: the chain, its sections at the stations, its ends."""

    chain: Chain
    section: Section


@dataclass(frozen=True, eq=False)
class SolidPart:
    """Where the cells of a solid part lie, and the signs (cells, functions) that turn their edges the same way."""

    mesh: Mesh
    boundary: Boundary
    signs: Array


@dataclass(frozen=True, eq=False)
class ShellGroup:
    """Elements of one chain: their strain table, their unknowns, where they lie, and `anchors`; see `matrices`."""

    table: StrainTable
    unknowns: Index
    place: ShellPart
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
        for element, node in self.anchors:
            amplitudes = unknowns[element].reshape(self.table.along.shape[2], -1)
            inner = amplitudes[node].copy()
            amplitudes += inner
            amplitudes[node] = inner
        return np.asarray(unknowns)

    def units(self, maps: list["ToFree"]) -> list[Array]:
        """Element matrices on free unknowns per unit λ, G and ρ, (3, size, size) each, the same material everywhere."""
        found: list[Array] = []
        for first, part in self._portions():
            trace, shear = station_stiffness(part)
            kinds = (
                self.matrices(integrate_stiffness, trace, first),
                self.matrices(integrate_stiffness, shear, first),
                self.matrices(integrate_mass, station_mass(part), first),
            )
            here = maps[first : first + len(trace)]
            found += [
                np.stack([at.restrict(kind) for kind in element]) for *element, at in zip(*kinds, here, strict=True)
            ]
        return found

    def varying(self, maps: list["ToFree"], lam: Array, G: Array, rho: Array) -> Iterator[Pair]:
        """Stiffness and mass of every element with λ, G, ρ at its stations."""
        for first, part in self._portions():
            here = slice(first, first + len(part.volume))
            lam_there, G_there, rho_there = (field[here, :, None, None] for field in (lam, G, rho))
            trace, shear = station_stiffness(part)
            trace *= lam_there
            trace += G_there * shear
            stiffness = self.matrices(integrate_stiffness, trace, first)
            mass = self.matrices(integrate_mass, rho_there * station_mass(part), first)
            for k, m, at in zip(stiffness, mass, maps[here], strict=True):
                yield at.restrict(k), at.restrict(m)

    def _portions(self) -> Iterator[tuple[int, StrainTable]]:
        """A few elements at a time, so that the passing arrays stay small."""
        for first in range(0, len(self.unknowns), PORTION):
            yield first, self.table.part(slice(first, first + PORTION))


@dataclass(frozen=True, eq=False)
class SolidGroup:
    """Cells of one solid part: the gradients of their functions, their unknowns, where they lie."""

    table: CellTable
    unknowns: Index
    place: SolidPart

    def spread(self, raw: Array) -> Array:
        """Unknowns (cells, size) of functions as they are in each cell."""
        return np.asarray(raw[self.unknowns] * np.repeat(self.place.signs, 3, axis=1))

    @cached_property
    def products(self) -> Array:
        """See `CellTable.products`."""
        return self.table.products(self.place.signs)

    def stiffness(self, maps: list["ToFree"], lam: Array, G: Array, keep: bool) -> Iterator[Array]:
        """Stiffness of every cell with its λ and G, (cells, 1) each."""
        for here, products in self._portions(keep):
            whole = cell_stiffness(products, lam[here, 0], G[here, 0], self.table.n)
            yield from (at.restrict(matrix) for matrix, at in zip(whole, maps[here], strict=True))

    def mass(self, maps: list["ToFree"], keep: bool) -> Iterator[Array]:
        """Mass of every cell per unit density."""
        for here, products in self._portions(keep):
            yield from (at.restrict(matrix) for matrix, at in zip(cell_mass(products), maps[here], strict=True))

    def _portions(self, keep: bool) -> Iterator[tuple[slice, Array]]:
        for first in range(0, len(self.unknowns), PORTION):
            here = slice(first, first + PORTION)
            yield here, self.products[here] if keep else self.table.part(here).products(self.place.signs[here])


Group: TypeAlias = ShellGroup | SolidGroup


@dataclass(frozen=True, eq=False)
class System:
    """Every element of a resonator at one harmonic and level, with the constraints between raw and free unknowns.

    raw = constraint @ free. What costs geometry is kept for the next material or temperature where it is not too large.
    """

    groups: tuple[Group, ...]
    constraint: csr_matrix
    rigid_motions: int
    n: int
    level: Level

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
        by_column = self.constraint.tocsc()
        free = by_column.indices[
            by_column.indptr[:-1]
        ]  # the raw unknown that each free one is: the first that follows it
        follows = counts > 0
        follows[free] = False
        maps: list[ToFree] = []
        for group in self.groups:
            columns, tied = column[group.unknowns], np.any(follows[group.unknowns], axis=1)
            for members, own, general in zip(group.unknowns, columns, tied, strict=True):
                kept = np.flatnonzero(own >= 0)
                maps.append(self._free(members) if general else ToFree(own[kept], kept, None))
        pattern = find_pattern([at.free for at in maps], self.constraint.shape[1])
        return pattern, [at.reordered(order) for at, order in zip(maps, pattern.order, strict=True)]

    def _free(self, members: Index) -> "ToFree":
        rows = self.constraint[members]
        free = np.unique(rows.indices).astype(np.intp)
        return ToFree(free, None, rows[:, free].toarray())

    def _by_group(self) -> Iterator[tuple[Group, list["ToFree"]]]:
        first = 0
        for group in self.groups:
            yield group, self.maps[first : first + len(group.unknowns)]
            first += len(group.unknowns)

    @cached_property
    def is_small(self) -> bool:
        """Whether what costs geometry is worth keeping."""
        numbers = 0
        for group in self.groups:
            size = group.unknowns.shape[1] ** 2
            numbers += len(group.unknowns) * (3 * size if isinstance(group, ShellGroup) else size + 10 * size // 9)
        return numbers < KEPT

    @property
    def is_tiny(self) -> bool:
        """Whether one dense matrix costs less than the elements one by one."""
        return len(self.groups) == 1 and self.constraint.shape[1] <= TINY

    def operators(
        self, lam: list[Array], G: list[Array], rho: list[Array], uniform: bool
    ) -> tuple[list[Array], list[Array]]:
        """Stiffness and mass of every element with λ, G, ρ at the stations of every group; `uniform`: the same in a group."""
        K: list[Array] = []
        M: list[Array] = []
        for k, (group, maps) in enumerate(self._by_group()):
            if isinstance(group, SolidGroup):
                K += group.stiffness(maps, lam[k], G[k], self.is_small)
                unit = self._unit_masses[k] if self.is_small else group.mass(maps, False)
                M += [m if density == 1 else density * m for m, density in zip(unit, rho[k][:, 0], strict=True)]
            elif uniform and self.is_small:
                moduli = np.array([lam[k][0, 0], G[k][0, 0]])
                K += [(moduli @ unit[:2].reshape(2, -1)).reshape(unit.shape[1:]) for unit in self._units[k]]
                density = rho[k][0, 0]
                M += [unit[2] if density == 1 else density * unit[2] for unit in self._units[k]]
            else:
                for stiff, heavy in group.varying(maps, lam[k], G[k], rho[k]):
                    K.append(stiff)
                    M.append(heavy)
        return K, M

    @cached_property
    def _units(self) -> list[list[Array]]:
        return [group.units(maps) if isinstance(group, ShellGroup) else [] for group, maps in self._by_group()]

    @cached_property
    def _unit_masses(self) -> list[list[Array]]:
        return [
            list(group.mass(maps, True)) if isinstance(group, SolidGroup) else [] for group, maps in self._by_group()
        ]

    @cached_property
    def whole(self) -> tuple[Pattern, Array]:
        """The units of a small shell without solid parts as of one element, (3, size, size): fewer and larger products."""
        size = self.pattern.size
        merged = np.zeros((3, size, size))
        for members, kinds in zip(self.pattern.unknowns, self._units[0], strict=True):
            merged[:, members[:, None], members] += kinds
        return find_pattern([np.arange(size)], size), merged

    def spread(self, free: Array) -> list[Array]:
        """Element unknowns (elements, size) of every group from the free unknowns of one vector."""
        raw = self.constraint @ free
        return [group.spread(raw) for group in self.groups]


@dataclass(frozen=True, eq=False)
class ToFree:
    """From an element's unknowns to free ones: a choice, or (kept None) a full matrix of factors."""

    free: Index
    kept: Index | None
    factors: Array | None

    def reordered(self, order: Index) -> "ToFree":
        """The same with the free unknowns in another order."""
        if self.kept is None:
            assert self.factors is not None
            return ToFree(self.free[order], None, self.factors[:, order])
        return ToFree(self.free[order], self.kept[order], None)

    def restrict(self, matrix: Array) -> Array:
        """The element's matrix on the free unknowns."""
        if self.kept is None:
            assert self.factors is not None
            return np.asarray(self.factors.T @ matrix @ self.factors)
        if len(self.kept) == len(matrix) and np.all(self.kept[1:] > self.kept[:-1]):
            return matrix
        return np.asarray(matrix.ravel().take(self.kept[:, None] * len(matrix) + self.kept, mode="clip"))
