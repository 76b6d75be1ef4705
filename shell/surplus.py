r"""How far a mode is from the exact one: what the functions that its level lacks would still change.

The stresses of a mode u leave forces on the next functions w of every element,

    r(w) = ∫ σ(u) : ε(w) dV - ω² ∫ ρ u · w dV,

which move them by x = K_ww⁻¹ r and so take xᵀ r off ω² ∫ ρ u² dV (hierarchical surplus). A chain of shell elements answers
as a whole, with two degrees more along it and two modes more through its thickness; a solid cell answers by itself with
one degree more, and a force on an edge is divided among the cells there as their stiffness is.
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shell.assembly import sections
from shell.blocks import open_edges
from shell.cells import CellTable, Reference, at_gauss_points, cell_stiffness, in_order, tabulate_cells
from shell.constraints import Index
from shell.eigen import Factor, Pattern, find_pattern
from shell.elastic import Elastic, VaryingElastic
from shell.kernel import StrainTable, pair_stiffness, shell_table, station_stiffness
from shell.levels import Level
from shell.quadrature import Array, at_gauss, gauss, hierarchic, legendre, values_to_hierarchic
from shell.resonator import Resonator
from shell.solution import Solution, find_constants, total
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
    for part, extension in enumerate(extend(resonator, system)):
        factor = SMOOTH if isinstance(extension, ShellExtension) else (system.level.block + 1) / 2
        found += factor * extension.surplus(solution, part, elastic)
    return found / (2 * solution.eigenvalue * total(solution.kinetic))


@dataclass(frozen=True, eq=False)
class ShellExtension:
    """More functions on the elements of a chain, hierarchic along the meridian: those of its two ends, then the others.

    table : with more orders through the thickness and along the meridian.
    is_old : which amplitudes the level has.
    to_old : from the values at the level's nodes.
    pattern : the functions that may answer: the new ones, and the old ones inside an element, with which these go
        together in a thin shell.
    places : where these are among the functions and amplitudes of every element.
    units : their stiffness per unit λ and G.
    """

    table: StrainTable
    is_old: NDArray[np.bool_]
    to_old: Array
    pattern: Pattern
    places: tuple[Index, ...]
    units: tuple[tuple[Array, ...], ...]

    def surplus(self, solution: Solution, part: int, elastic: Elastic | VaryingElastic) -> float:
        """xᵀ r of the chain, one part of the system of a mode."""
        q = solution.unknowns[part]
        constants = find_constants(self.table.position, elastic, self.table.plane_stress)
        old = self.to_old @ q.reshape(len(q), len(self.to_old), -1)
        refined = np.zeros((len(q), len(self.to_old) + ALONG, len(self.is_old)))
        refined[:, :-ALONG, self.is_old] = old
        stress = constants.stress(self.table, self.table.strains(refined))
        force = solution.eigenvalue * constants.rho[..., None, None] * self.table.displacements(refined)
        r = self.table.loads(stress, force).reshape(len(q), -1)
        load = np.zeros(self.pattern.size)
        for members, own, places in zip(self.pattern.unknowns, r, self.places, strict=True):
            load[members] += own[places]
        lam, G = (field.mean(axis=1) for field in constants.lame)
        K = [a * trace + b * shear for a, b, (trace, shear) in zip(lam, G, self.units, strict=True)]
        return float(load @ Factor(self.pattern, K).solve(load[:, None])[:, 0])


@dataclass(frozen=True, eq=False)
class SolidExtension:
    """Functions of one more degree on the cells of a solid part, at the points of the level.

    table : the new functions.
    products : of the same.
    edges, turned : the edge of the four first ones, and the sign that turns them the same way, (cells, 4).
    are_open : whether an edge may move, (edges,).
    """

    table: CellTable
    products: Array
    edges: Index
    turned: Array
    are_open: NDArray[np.bool_]

    def surplus(self, solution: Solution, part: int, elastic: Elastic | VaryingElastic) -> float:
        """xᵀ r of all cells, one part of the system of a mode."""
        constants = solution.constants[part]
        r = self.table.loads(solution.stress[part], solution.force[part])
        lam, G = (field[:, 0] for field in constants.lame)
        K = cell_stiffness(self.products, lam, G, self.table.n)
        k = np.diagonal(K, axis1=1, axis2=2).reshape(r.shape)
        at_edges, stiffness = (np.zeros((len(self.are_open), 3)) for _ in range(2))
        np.add.at(at_edges, self.edges, self.turned * r[:, :4])
        np.add.at(stiffness, self.edges, k[:, :4])
        share = k[:, :4] / stiffness[self.edges] * self.are_open[self.edges][..., None]
        r[:, :4] = self.turned * at_edges[self.edges] * share
        load = r.reshape(len(r), -1)
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
    p, orders = level.along, level.through
    more = tuple(order + 2 for order in orders) if max(orders) > 1 else orders
    xi, weights = gauss(p + ALONG + 2)
    eta = gauss(max(more) + 2)
    chain = group.place.chain
    u, v, w = (at_gauss(legendre, order, len(eta[0])) for order in more)
    along = at_gauss(hierarchic, p + ALONG, p + ALONG + 2)
    table = shell_table(sections(resonator, chain, xi, weights), n, (u, v, w), eta, along)
    is_old = np.concatenate([np.arange(many + 1) <= few for few, many in zip(orders, more, strict=True)])
    elements, functions, width = len(chain.segments), p + ALONG + 1, len(is_old)
    asked = np.ones((elements, functions, width), dtype=bool)
    asked[:, :2] = ~is_old
    for end, (element, function) in zip(chain.ends, ((0, 0), (-1, 1)), strict=True):
        asked[element, function] &= end == "free"
    # the ends of the elements count 0 ... elements, then come the functions inside
    inside = elements + 1 + np.arange(elements * (functions - 2)).reshape(elements, -1)
    number = np.column_stack([np.arange(elements), np.arange(1, elements + 1), inside])[..., None] * width + np.arange(
        width
    )
    used = np.unique(number[asked])
    places = [np.flatnonzero(one) for one in asked.reshape(elements, -1)]
    members = [np.searchsorted(used, one[here]) for one, here in zip(number.reshape(elements, -1), places, strict=True)]
    pattern = find_pattern(members, len(used), in_order=True)
    places = [here[order] for here, order in zip(places, pattern.order, strict=True)]
    kinds = [pair_stiffness(kind, table.along).reshape(elements, -1) for kind in station_stiffness(table)]
    units = []
    for e, here in enumerate(places):
        node, amplitude = np.divmod(here, width)
        rows, columns = (node * functions * width + amplitude) * width, node * width**2 + amplitude
        where = rows[:, None] + columns
        units.append(tuple(kind[e].take(where, mode="clip") for kind in kinds))
    return ShellExtension(table, is_old, values_to_hierarchic(p), pattern, tuple(places), tuple(units))


def _extend_solid(group: SolidGroup, degree: int) -> SolidExtension:
    mesh = group.place.mesh
    table = tabulate_cells(mesh.grid, _next_functions(degree), group.table.n, group.table.position[0, 0])
    products = table.products(np.ones((len(mesh.edges), table.gradients.shape[3])))
    turned = np.where(mesh.reversed_ & bool((degree + 1) % 2), -1.0, 1.0)[..., None]
    return SolidExtension(table, products, mesh.edges, turned, open_edges(mesh, group.place.boundary))


@cache
def _next_functions(degree: int) -> Reference:
    """The functions of one degree more at the points of a degree: those of the four edges, then the ones inside."""
    top = degree + 1
    place = np.empty((top + 1, top + 1), dtype=np.intp)
    place[in_order(top)] = np.arange((top + 1) ** 2)
    low = np.arange(2)
    return at_gauss_points(top, degree, degree + 2).chosen(
        np.concatenate([place[top, low], place[low, top], place[top, 2:], place[2:top, top]])
    )
