r"""How far a mode is from the exact one: what the functions that its level lacks would still change.

The stresses of a mode u leave forces on the next functions w of every element,

    r(w) = ∫ σ(u) : ε(w) dV - ω² ∫ ρ u · w dV,

which move them by x = K_ww⁻¹ r and so take xᵀ r off ω² ∫ ρ u² dV (hierarchical surplus). Every element answers with its
own stiffness; a force that falls on several elements is divided among them as their stiffness is. The functions are one
degree more in solid cells, two degrees more along the shell and two modes more through its thickness.
"""

from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import TypeAlias

import numpy as np

from shell.assembly import sections
from shell.blocks import open_edges
from shell.cells import CellTable, cell_stiffness, in_order, tabulate_cells
from shell.constraints import Index
from shell.elastic import Elastic, VaryingElastic
from shell.kernel import StrainTable, energy_weights, integrate_stiffness, shell_table, station_stiffness
from shell.levels import Level
from shell.quadrature import Array, gauss, legendre, lobatto, nodal
from shell.resonator import Resonator
from shell.solution import Constants, Solution, find_constants, total
from shell.system import ShellGroup, SolidGroup, System

ALONG = 2  # degrees added along the shell
SMOOTH = 1.2  # error over surplus where the orders' errors fall by a constant factor


def estimate_error(resonator: Resonator, elastic: Elastic | VaryingElastic, solution: Solution) -> float:
    """Relative error of the frequency of a mode.

    At a sharp corner the error falls with the degree as p^(-4 λ), λ from ½ on, and the next degree takes off about
    2/(p + 1) of it; so the surplus of solid cells counts (p + 1)/2 times.
    """
    system = solution.system
    found = 0.0
    for group, extension, q in zip(system.groups, extend(resonator, system), solution.unknowns, strict=True):
        constants = find_constants(extension.table.position, elastic, group.table.plane_stress)
        factor = SMOOTH if isinstance(group, ShellGroup) else (system.level.block + 1) / 2
        found += factor * extension.surplus(q, constants, solution.eigenvalue)
    return found / (2 * solution.eigenvalue * total(solution.kinetic))


@dataclass(frozen=True, eq=False)
class ShellExtension:
    """More functions on the elements of a chain.

    table : with the orders `through` and more functions along the meridian.
    coarse : orders and values of the level's own functions at the nodes of the new ones.
    new : (elements, functions, amplitudes), which of them the level lacks.
    """

    table: StrainTable
    through: tuple[int, ...]
    coarse: tuple[tuple[int, ...], Array]
    new: np.ndarray

    def surplus(self, q: Array, constants: Constants, eigenvalue: float) -> float:
        """xᵀ r of all elements for a mode with element unknowns q."""
        elements = len(self.new)
        stress, force = _loads(self.table, self._refine(q), constants, eigenvalue)
        jets = np.einsum("eskp,eskpdm->esdm", stress * self.table.volume[:, :, None], self.table.strain)
        jets[:, :, 0] -= np.einsum("escp,escpm->esm", force * self.table.volume[:, :, None], self.table.displacement)
        r = np.einsum("dsf,esdm->efm", self.table.along, jets)
        lam, G = (field[..., None, None] for field in constants.lame)
        trace, shear = station_stiffness(self.table)
        K = integrate_stiffness(lam * trace + G * shear, self.table.along)
        k = np.diagonal(K, axis1=1, axis2=2).reshape(r.shape)
        share = k[:-1, -1] / (k[:-1, -1] + k[1:, 0])
        at_joints = r[:-1, -1] + r[1:, 0]
        r[:-1, -1], r[1:, 0] = share * at_joints, (1 - share) * at_joints
        found = 0.0
        for stiff, load, new in zip(K, r.reshape(elements, -1), self.new.reshape(elements, -1), strict=True):
            found += _answer(stiff[np.ix_(new, new)], load[new])
        return found

    def _refine(self, q: Array) -> Array:
        orders, along = self.coarse
        here = along @ q.reshape(len(q), along.shape[1], -1)
        there = np.zeros(self.new.shape)
        of, to = 0, 0
        for few, many in zip(orders, self.through, strict=True):
            there[:, :, to : to + few + 1] = here[:, :, of : of + few + 1]
            of, to = of + few + 1, to + many + 1
        return there.reshape(len(q), -1)


@dataclass(frozen=True, eq=False)
class SolidExtension:
    """Functions of one more degree on the cells of a solid part.

    table : all functions; `new` : places of the new ones, `old` : of the level's own.
    products : of the new ones.
    edges, turned : the edge of the four first new ones, and the sign that turns them the same way, (cells, 4).
    are_open : whether an edge may move, (edges,).
    """

    table: CellTable
    new: Index
    old: Index
    products: Array
    edges: Index
    turned: Array
    are_open: np.ndarray

    def surplus(self, q: Array, constants: Constants, eigenvalue: float) -> float:
        """xᵀ r of all cells for a mode with cell unknowns q."""
        cells = len(q)
        refined = np.zeros((cells, self.table.gradients.shape[3], 3))
        refined[:, self.old] = q.reshape(cells, -1, 3)
        stress, force = _loads(self.table, refined, constants, eigenvalue)
        r = self.table.loads(stress[:, 0], force[:, 0], self.new)
        lam, G = (field[:, 0] for field in constants.lame)
        K = cell_stiffness(self.products, lam, G, self.table.n)
        k = np.diagonal(K, axis1=1, axis2=2).reshape(r.shape)
        at_edges, stiffness = (np.zeros((len(self.are_open), 3)) for _ in range(2))
        np.add.at(at_edges, self.edges, self.turned * r[:, :4])
        np.add.at(stiffness, self.edges, k[:, :4])
        share = k[:, :4] / stiffness[self.edges] * self.are_open[self.edges][..., None]
        r[:, :4] = self.turned * at_edges[self.edges] * share
        load = r.reshape(cells, -1)
        return float(np.sum(load * np.linalg.solve(K, load[..., None])[..., 0]))


Extension: TypeAlias = ShellExtension | SolidExtension


@lru_cache(maxsize=6)
def extend(resonator: Resonator, system: System) -> tuple[Extension, ...]:
    """The next functions of every group of a system; they cost geometry, so they are kept for the next material."""
    return tuple(
        _extend_shell(resonator, group, system.n, system.level)
        if isinstance(group, ShellGroup)
        else _extend_solid(group, system.level.block)
        for group in system.groups
    )


def _extend_shell(resonator: Resonator, group: ShellGroup, n: int, level: Level) -> ShellExtension:
    p, orders = level.along + ALONG, level.through
    more = tuple(order + 2 for order in orders) if max(orders) > 1 else orders
    xi, weights = gauss(p + 2)
    eta = gauss(max(more) + 2)
    chain = group.place.chain
    u, v, w = (legendre(order, eta[0]) for order in more)
    table = shell_table(sections(resonator, chain, xi, weights), n, (u, v, w), eta, nodal(p, xi))
    new = np.ones((len(chain.segments), p + 1, sum(more) + 3), dtype=bool)
    ends = np.concatenate([np.arange(many + 1) > few for few, many in zip(orders, more, strict=True)])
    new[:, [0, -1]] = ends
    for end, (element, node) in zip(chain.ends, ((0, 0), (-1, -1)), strict=True):
        new[element, node] &= end == "free"
    return ShellExtension(table, more, (orders, _at_nodes(level.along, p)), new)


def _extend_solid(group: SolidGroup, degree: int) -> SolidExtension:
    mesh = group.place.mesh
    table = tabulate_cells(mesh.grid, degree + 1, group.table.n, group.table.position[0, 0])
    place = np.empty((degree + 2, degree + 2), dtype=np.intp)
    place[in_order(degree + 1)] = np.arange(table.gradients.shape[3])
    low, top = np.arange(2), degree + 1
    sides = [place[top, low], place[low, top]]
    new = np.concatenate([*sides, place[top, 2:], place[2:-1, top]])
    products = replace(table, gradients=table.gradients[..., new]).products(np.ones((len(mesh.edges), len(new))))
    turned = np.where(mesh.reversed_ & bool(top % 2), -1.0, 1.0)[..., None]
    return SolidExtension(
        table, new, place[in_order(degree)], products, mesh.edges, turned, open_edges(mesh, group.place.boundary)
    )


def _loads(
    table: StrainTable | CellTable, unknowns: Array, constants: Constants, eigenvalue: float
) -> tuple[Array, Array]:
    """Stress and inertial force ω² ρ u at the points."""
    lam, G = (field[..., None] for field in constants.lame)
    strain = table.strains(unknowns)
    stress = G[:, :, None] * energy_weights(table.transverse_shear)[:, None] * strain
    stress[:, :, :3] += (lam * strain[:, :, :3].sum(axis=2))[:, :, None]
    return stress, eigenvalue * constants.rho[..., None, None] * table.displacements(unknowns)


def _answer(K: Array, r: Array) -> float:
    """xᵀ r with K x = r, in a scale in which K has a diagonal of ones."""
    scale = 1 / np.sqrt(np.diagonal(K))
    load = r * scale
    return float(load @ np.linalg.solve(K * scale * scale[:, None], load))


@cache
def _at_nodes(few: int, many: int) -> Array:
    """Values of the functions of a lower degree at the nodes of a higher one."""
    return nodal(few, lobatto(many)).values
