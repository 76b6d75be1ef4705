"""Elements and their matrices: groups of one kind, and the system of all of them on the free unknowns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from shell.blocks import Mesh, Support
from shell.cells import CellTable, cell_mass, cell_stiffness
from shell.eigen import Pattern, find_pattern
from shell.elastic import Constants, Elastic, VaryingElastic, find_constants
from shell.kernel import Section, StrainTable, integrate, station_mass, station_stiffness
from shell.layout import Chain, Level
from shell.quadrature import Array, gauss
from shell.sparse import Index

Pair: TypeAlias = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class ShellGroup:
    """Elements of one chain: their strain table, their unknowns, where they lie, and `anchors`; see `matrices`."""

    table: StrainTable
    unknowns: Index
    chain: Chain
    section: Section  # the middle surface at the stations
    anchors: tuple[tuple[int, int], ...] = ()

    def matrices(self, stations: Array, along: Array) -> Array:
        """Integrals over the elements of their station matrices, in the unknowns that are solved for; `along` as `integrate` takes it.

        At a free edge (`anchors`) these are differences: else stiff shear would drown the bending as (R/h)³, not (R/h)².
        """
        found = integrate(stations, along)
        for element, node in self.anchors:
            own = along.copy()
            own[0, :, node], own[1:, :, node] = 1.0, 0.0
            found[element] = integrate(stations[[element]], own)[0]
        return found

    @cached_property
    def sums(self) -> tuple[Index, Index]:
        """Unknowns (flat) of which the plain basis, where nothing is a difference, adds the second ones to the first."""
        number = np.arange(self.unknowns.size).reshape(len(self.unknowns), self.table.along.shape[2], -1)
        pairs = [(np.delete(number[element], node, axis=0), number[element, node]) for element, node in self.anchors]
        both = [np.broadcast_arrays(*pair) for pair in pairs]
        to, of = (np.concatenate([number[:0, 0, 0], *(pair[k].ravel() for pair in both)]) for k in (0, 1))
        return to, of

    def spread(self, own: Array) -> Array:
        """Unknowns of the plain basis from those that are solved for, flat."""
        to, of = self.sums
        own[to] += own[of]
        return own

    def plain(self, own: "scipy.sparse.csr_matrix") -> "scipy.sparse.csr_matrix":
        """From what `own` takes to the unknowns that are solved for to those of the plain basis."""
        to, of = (np.concatenate([np.arange(self.unknowns.size), one]) for one in self.sums)
        sums = scipy.sparse.csr_matrix((np.ones(len(to)), (to, of)), shape=(self.unknowns.size,) * 2)
        return scipy.sparse.csr_matrix(sums @ own)

    @property
    def parts(self) -> tuple[str, ...]:
        """What part of the resonator each element belongs to."""
        return ("wall",) * len(self.unknowns)

    @property
    def axes(self) -> Array:
        """Parts of the radial and of the axial direction along tangent and normal, (r or z, tangent or normal, elements, stations, 1)."""
        t_r, t_z = self.section.tangent_r[..., None], self.section.tangent_z[..., None]
        return np.array([[t_r, -t_z], [t_z, t_r]])

    @property
    def places(self) -> Array:
        """Distance of the points from the axis and height, (r or z, elements, stations, points)."""
        eta, section = gauss(self.table.volume.shape[2])[0], self.section
        out_r, out_z = (
            one[..., None] * section.thickness[..., None] * eta / 2 for one in (section.tangent_z, section.tangent_r)
        )
        return np.array([section.r[..., None] - out_r, section.z[..., None] + out_z])

    @cached_property
    def stations(self) -> tuple[Array, Array, Array]:
        """Station matrices per unit λ, G and ρ."""
        return *station_stiffness(self.table), station_mass(self.table)

    def integrals(self, lam: Array, G: Array, rho: Array, shift: float = 0.0) -> Pair:
        """Stiffness plus `shift` times mass, and mass, of all elements with λ, G, ρ at their stations."""
        dilation, shear, mass = self.stations
        stiffness = lam[..., None, None] * dilation + G[..., None, None] * shear
        M = self.matrices(rho[..., None, None] * mass, self.table.along[:1])
        return self.matrices(stiffness, self.table.along) + shift * M, M


@dataclass(frozen=True, eq=False)
class SolidGroup:
    """Cells of one solid part: the gradients of their functions, their unknowns, where they lie."""

    table: CellTable
    unknowns: Index
    mesh: Mesh
    boundary: Support
    signs: Array  # (cells, functions), which turn the cells' edges the same way

    def spread(self, own: Array) -> Array:
        """See `ShellGroup.spread`; functions are as they are in each cell."""
        return own * np.repeat(self.signs, 3, axis=1).ravel()

    def plain(self, own: "scipy.sparse.csr_matrix") -> "scipy.sparse.csr_matrix":
        """See `ShellGroup.plain`."""
        return scipy.sparse.csr_matrix(scipy.sparse.diags_array(np.repeat(self.signs, 3, axis=1).ravel()) @ own)

    @property
    def parts(self) -> tuple[str, ...]:
        """See `ShellGroup.parts`."""
        return self.mesh.parts

    axes: ClassVar[Array] = np.eye(2)[:, :, None, None, None]  # see `ShellGroup.axes`; a cell's own are r and z

    @property
    def places(self) -> Array:
        """See `ShellGroup.places`."""
        points = gauss(self.mesh.grid.shape[2] + 1)[0]
        return self.mesh.place(points, points).reshape(2, *self.table.volume.shape)

    @property
    def products(self) -> Array:
        """See `CellTable.products`."""
        return self.table.products(self.signs)

    def integrals(self, lam: Array, G: Array, rho: Array, shift: float = 0.0) -> Pair:
        """Stiffness plus `shift` times mass of all cells with λ, G, ρ, (cells, 1) each, and the mass of one component."""
        products, functions = self.products, self.table.gradients.shape[3]
        K = cell_stiffness(products, lam[:, 0], G[:, 0], self.table.n)
        K += shift * rho[..., None] * cell_mass(products) if shift else 0.0
        return K, rho[..., None] * products[:, 9].reshape(-1, functions, functions)


Group: TypeAlias = ShellGroup | SolidGroup


@dataclass(frozen=True, eq=False)
class System:
    """Every element of a resonator at one harmonic and level; raw = constraint @ free. Geometry is kept for the next material."""

    groups: tuple[Group, ...]
    constraint: "scipy.sparse.csr_matrix"
    rigid_motions: int
    n: int
    level: Level

    @cached_property
    def chains(self) -> dict[int, ShellGroup]:
        """The chains of shell elements, by their numbers among the groups."""
        return {k: group for k, group in enumerate(self.groups) if isinstance(group, ShellGroup)}

    @cached_property
    def solids(self) -> dict[int, SolidGroup]:
        """The solid parts likewise."""
        return {k: group for k, group in enumerate(self.groups) if isinstance(group, SolidGroup)}

    @cached_property
    def pattern(self) -> Pattern:
        """The elements' free unknowns."""
        columns = (columns for _, columns, _ in self._terms())
        free = [np.fromiter(dict.fromkeys(own.tolist()), dtype=np.intp) for own in columns]
        return find_pattern(free, self.constraint.shape[1])

    @cached_property
    def maps(self) -> list[NDArray[Any]]:
        """See `restrict`: from the free unknowns of every element, in the order of `pattern`, to its own."""
        found: list[NDArray[Any]] = []
        sizes = np.repeat([g.unknowns.shape[1] for g in self.groups], [len(g.unknowns) for g in self.groups])
        for free, size, (rows, columns, factors) in zip(self.pattern.unknowns, sizes, self._terms(), strict=True):
            rank = np.argsort(free)
            place = rank[np.searchsorted(free, columns, sorter=rank)]
            if len(columns) == len(free) and np.all(factors == 1):
                found.append(rows[np.argsort(place)])
            else:
                found.append(np.zeros((size, len(free))))
                found[-1][rows, place] = factors
        return found

    def _terms(self) -> Iterator[tuple[Index, Index, Array]]:
        """Of every element: its unknowns, the free ones that they follow, by what factors."""
        P, first = self._choice[0], 0
        for group in self.groups:
            for _ in group.unknowns:
                at = P.indptr[first : (first := first + group.unknowns.shape[1]) + 1]
                here = slice(at[0], at[-1])
                yield np.repeat(np.arange(len(at) - 1), np.diff(at)), P.indices[here].astype(np.intp), P.data[here]

    @property
    def memory(self) -> float:
        """Bytes of the element matrices while a system is solved: stiffness, mass, their factors."""
        return 32.0 * float(sum(group.unknowns.size * group.unknowns.shape[1] for group in self.groups))

    def constants(self, elastic: Elastic | VaryingElastic) -> tuple[Constants, ...]:
        """The material at the stations of every group."""
        return tuple(find_constants(g.table.position, elastic, g.table.plane_stress) for g in self.groups)

    def shift(self, constants: Sequence[Constants], size: float) -> float:
        """A small ω² (1/s²) which, with the mass, factors the rigid motions and leaves the elastic modes of a body of radius `size` in order."""
        wave_speed_squared = float(np.mean(constants[0].lame[1]) / np.mean(constants[0].rho))
        return 1e-2 * wave_speed_squared / size**2 if self.rigid_motions else 0.0

    def operators(
        self, constants: Sequence[Constants], shift: float = 0.0, over: float = 1.0
    ) -> tuple[list[Array], "ElementSum"]:
        """Stiffness, plus `shift` (1/s²) times mass, of every element, and the mass, `over` a divisor."""
        K: list[Array] = []
        M: list[Array] = []
        maps = iter(self.maps)
        for group, c in zip(self.groups, constants, strict=True):
            stiffness, mass = group.integrals(c.lame[0] / over, c.lame[1] / over, c.rho / over, shift)
            K += [restrict(one, to) for one, to in zip(stiffness, maps, strict=False)]
            M.append(mass)
        return K, self.sum(M)

    def sum(self, blocks: Sequence[NDArray[Any]]) -> "ElementSum":
        """The sum of the matrices of all elements, given in `blocks` for every group."""
        starts = np.cumsum([group.unknowns.size for group in self.groups[:-1]], dtype=np.intp)
        return ElementSum(*self._choice, starts, tuple(blocks))

    @cached_property
    def _choice(self) -> "tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix]":
        """From the free unknowns to those of all elements, and its transpose."""
        choice = self.constraint[np.concatenate([group.unknowns.ravel() for group in self.groups])]
        return choice, scipy.sparse.csr_matrix(choice.T)

    @cached_property
    def plain(self) -> "list[scipy.sparse.csr_matrix]":
        """From the free unknowns to those that the tables of every group take, (elements × size)."""
        ends = pairwise(np.cumsum([0, *(group.unknowns.size for group in self.groups)]))
        return [group.plain(self._choice[0][a:b]) for group, (a, b) in zip(self.groups, ends, strict=True)]

    def spread(self, free: Array) -> list[Array]:
        """Element unknowns (elements, size) of every group from the free unknowns of one vector."""
        raw = self.constraint @ free
        return [group.spread(raw[group.unknowns.ravel()]).reshape(group.unknowns.shape) for group in self.groups]

    def gather(self, loads: list[Array]) -> Array:
        """Loads on the free unknowns from those on the functions of every group."""
        return np.asarray(sum(P.T @ own.ravel() for P, own in zip(self.plain, loads, strict=True)))


def restrict(matrix: NDArray[Any], to: NDArray[Any]) -> NDArray[Any]:
    """An element's matrix on its free unknowns: `to` is a choice of its own, or the matrix from the free ones to them."""
    if to.ndim == 2:
        return np.asarray(to.T @ matrix @ to)
    if len(to) == len(matrix) and np.all(to[1:] > to[:-1]):
        return matrix
    return np.asarray(matrix.ravel().take(to[:, None] * len(matrix) + to, mode="clip"))


@dataclass(frozen=True, eq=False)
class ElementSum:
    """A sum over all elements, such as the mass: M x = Pᵀ m P x."""

    choice: "scipy.sparse.csr_matrix"  # P, from the free unknowns to those of the elements
    back: "scipy.sparse.csr_matrix"  # Pᵀ
    starts: Index  # the first rows of P of the second group and on
    # m of the elements of every group, (elements, functions, functions), the same for each component of a solid.
    blocks: tuple[NDArray[Any], ...]

    def __matmul__(self, x: NDArray[Any]) -> NDArray[Any]:
        """M x of a vector or of several columns."""
        local = self.choice @ x
        for block, rows in zip(self.blocks, np.split(local, self.starts), strict=True):
            rows[:] = (block @ rows.reshape(*block.shape[:2], -1)).reshape(rows.shape)
        return np.asarray(self.back @ local)
