r"""Error estimate of a mode, from the functions that its level lacks.

The stresses of a mode u leave forces on the next functions w of every element,

    r(w) = ∫ σ(u) : ε(w) dV - ω² ∫ ρ u · w dV,

which move them by x = K_ww⁻¹ r and so take xᵀ r off ω² ∫ ρ u² dV (hierarchical surplus). A chain of shell elements answers
as a whole, with two degrees more along it and two modes more through its thickness; a solid cell answers by itself with
one degree more, and a force on an edge is divided among the cells there as their stiffness is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shell.assembly import sections
from shell.blocks import open_edges
from shell.cells import CellTable, Reference, at_gauss_points, cell_stiffness, in_order, tabulate_cells
from shell.eigen import Factor, Pattern, find_pattern
from shell.elastic import Elastic, VaryingElastic, find_constants
from shell.kernel import StrainTable, integrate, shell_table, station_stiffness
from shell.layout import Chain, Level
from shell.quadrature import Array, at_gauss, gauss, hierarchic, values_to_hierarchic
from shell.resonator import Resonator
from shell.solution import Solution, total
from shell.sparse import Index
from shell.system import ShellGroup, SolidGroup, System

ALONG = 2  # degrees added along the shell
# error over surplus where the orders' errors fall by a constant factor: measured 1.2, in one of 50 cards 1.7;
# above degree 12 two more degrees are a smaller step
SMOOTH = 1.8
NAGHDI = 1.45  # and more in shell theory, where only the degrees along the meridian rise
HIGHER = 0.05  # and by how much more for each mode below: its neighbours above are not known
TIED = 1.2  # and more beside a corner, whose singularity reaches over
SINGULAR = 1.4  # what the rule for corners still lacks, measured
SLOPE = 1e-3  # a jump of dh/ds that is felt
BLUNT = 2.0  # 4 λ of the blunt corner where the slope of the thickness jumps


def estimate_errors(resonator: Resonator, elastic: Elastic | VaryingElastic, solutions: Sequence[Solution]) -> Array:
    """Relative errors of the frequencies of modes of one system, by what they come from (`layout.KINDS`): (kinds, modes)."""
    answers = [one.answer(solutions, part, elastic) for part, one in enumerate(extend(resonator, solutions[0].system))]
    S, C, T, shares = (np.sum(kind, axis=0) for kind in zip(*answers, strict=True))
    values = np.array([solution.eigenvalue for solution in solutions])
    mass = np.array([total(solution.kinetic) for solution in solutions])
    errors = [
        (1 + HIGHER * k) * _correction(k, values, mass, S, C, T) / (2 * values[k] * mass[k]) for k in range(len(values))
    ]
    return np.asarray(np.array(errors) * shares / shares.sum(axis=0))


def _correction(k: int, values: Array, mass: Array, S: Array, C: Array, T: Array) -> float:
    """What the answers x and the other modes u take off λ_k ∫ ρ u² dV: bᵀ A⁻¹ b, A of K - λ_k M, b of (K - λ_k M) u_k."""
    others = np.delete(np.arange(len(values)), k)
    apart = (values - values[k])[others]
    held = S[others] + apart[:, None] * C[others]
    A = np.block([[np.diag(apart * mass[others]), held], [held.T, S - values[k] * T]])
    b = np.concatenate([np.zeros(len(others)), S[:, k]])
    scale = 1 / np.sqrt(np.concatenate([values[others] * mass[others], np.diagonal(S)]) + 1e-300)
    found = np.linalg.lstsq(A * scale[:, None] * scale, b * scale, rcond=1e-13)[0]
    return max(abs(float(found @ (b * scale))), float(S[k, k]))


# Of one part of a system: x_jᵀ r_k, ∫ ρ u_j · x_k dV and ∫ ρ x_j · x_k dV of all pairs of modes; and x_kᵀ r_k by kind.
Answer: TypeAlias = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, eq=False)
class ShellExtension:
    """More functions on the elements of a chain, hierarchic along the meridian: those of its two ends, then the others."""

    table: StrainTable  # with more orders through the thickness and along the meridian
    is_old: NDArray[np.bool_]  # which amplitudes the level has
    is_deep: NDArray[np.bool_]  # which of these have a new order through the thickness
    to_old: Array  # from the values at the level's nodes
    # the functions that may answer: the new ones, and the old ones inside an element, with which these go together in a
    # thin shell
    pattern: Pattern
    places: tuple[Index, ...]  # where these are among the functions and amplitudes of every element
    stations: tuple[Array, Array]  # stiffness of the stations per unit λ and G
    factor: float  # error over surplus

    def answer(self, solutions: Sequence[Solution], part: int, elastic: Elastic | VaryingElastic) -> Answer:
        """See `Answer`; the chain is one part of the system."""
        constants = find_constants(self.table.position, elastic, self.table.plane_stress)
        loads, moved = np.zeros((self.pattern.size, len(solutions))), []
        for k, solution in enumerate(solutions):
            q = solution.unknowns[part]
            refined = np.zeros((len(q), len(self.to_old) + ALONG, len(self.is_old)))
            refined[:, :-ALONG, self.is_old] = self.to_old @ q.reshape(len(q), len(self.to_old), -1)
            stress = constants.stress(self.table, self.table.strains(refined))
            moved.append(self.table.displacements(refined))
            force = solution.eigenvalue * constants.rho[..., None, None] * moved[-1]
            r = self.table.loads(stress, force).reshape(len(q), -1)
            for members, own, places in zip(self.pattern.unknowns, r, self.places, strict=True):
                loads[members, k] += own[places]
        lam, G = (field[..., None, None] for field in constants.lame)
        whole = integrate(lam * self.stations[0] + G * self.stations[1], self.table.along)
        K = [one[np.ix_(here, here)] for one, here in zip(whole, self.places, strict=True)]
        x = Factor(self.pattern, K).solve(loads)
        answers = []
        for column in x.T:
            spread = np.zeros((len(self.places), len(self.is_old) * self.table.along.shape[2]))
            for own, members, places in zip(spread, self.pattern.unknowns, self.places, strict=True):
                own[places] = column[members]
            answers.append(self.table.displacements(spread))
        energies = x * loads
        deep = energies[self.is_deep].sum(axis=0)
        shares = np.stack([energies.sum(axis=0) - deep, deep, 0 * deep])
        return _inner(x.T @ loads, shares, moved, answers, constants.rho[..., None] * self.table.volume, self.factor)


@dataclass(frozen=True, eq=False)
class SolidExtension:
    """Functions of one more degree on the cells of a solid part, at the points of the level."""

    table: CellTable  # the new functions
    products: Array  # of the same
    # edges, turned: the edge of the four first ones, and the sign that turns them the same way, (cells, 4)
    edges: Index
    turned: Array
    are_open: NDArray[np.bool_]  # whether an edge may move, (edges,)
    factor: float  # error over surplus

    def answer(self, solutions: Sequence[Solution], part: int, elastic: Elastic | VaryingElastic) -> Answer:
        """See `Answer`; the cells are one part of the system."""
        constants = solutions[0].constants[part]
        lam, G = (field[:, 0] for field in constants.lame)
        K = cell_stiffness(self.products, lam, G, self.table.n)
        loads = np.stack([self._load(solution, part, K) for solution in solutions], axis=-1)
        x = np.linalg.solve(K, loads)
        answers = [self.table.displacements(np.ascontiguousarray(x[..., k])) for k in range(len(solutions))]
        moved = [solution.displacement[part] for solution in solutions]
        strained = np.einsum("cij,cik->jk", x, loads)
        shares = np.stack([0 * np.diagonal(strained), 0 * np.diagonal(strained), np.diagonal(strained)])
        return _inner(strained, shares, moved, answers, constants.rho[..., None] * self.table.volume, self.factor)

    def _load(self, solution: Solution, part: int, K: Array) -> Array:
        """Forces on the functions of every cell, (cells, functions x 3)."""
        r = self.table.loads(solution.stress[part], solution.force[part])
        k = np.diagonal(K, axis1=1, axis2=2).reshape(r.shape)
        at_edges, stiffness = (np.zeros((len(self.are_open), 3)) for _ in range(2))
        np.add.at(at_edges, self.edges, self.turned * r[:, :4])
        np.add.at(stiffness, self.edges, k[:, :4])
        share = k[:, :4] / stiffness[self.edges] * self.are_open[self.edges][..., None]
        r[:, :4] = self.turned * at_edges[self.edges] * share
        return np.asarray(r.reshape(len(r), -1))


def _inner(
    strained: Array, shares: Array, moved: list[Array], answers: list[Array], weight: Array, factor: float
) -> Answer:
    """An `Answer` from fields at points; `factor` is what the energies count, √factor the fields."""
    u, x = np.stack(moved), np.stack(answers)
    heavy = (x * weight[:, :, None]).reshape(len(x), -1)
    return (
        factor * strained,
        sqrt(factor) * u.reshape(len(u), -1) @ heavy.T,
        factor * x.reshape(len(x), -1) @ heavy.T,
        factor * shares,
    )


Extension: TypeAlias = ShellExtension | SolidExtension


@lru_cache(maxsize=6)
def extend(resonator: Resonator, system: System) -> tuple[Extension, ...]:
    """The next functions of every group of a system; they cost geometry, so they are kept for the next material."""
    return tuple(
        _extend_shell(resonator, group, system.n, system.level)
        if isinstance(group, ShellGroup)
        else _extend_solid(group, system.level.block, bool(resonator.stem and resonator.stem.fillet))
        for group in system.groups
    )


def _extend_shell(resonator: Resonator, group: ShellGroup, n: int, level: Level) -> ShellExtension:
    p, orders = level.along, level.through
    more = (orders[0] + 2, orders[1] + 2, orders[2] + 2) if max(orders) > 1 else orders
    xi, weights = gauss(p + ALONG + 2)
    eta = gauss(max(more) + 2)
    chain = group.chain
    along = at_gauss(hierarchic, p + ALONG, p + ALONG + 2)
    table = shell_table(sections(resonator, chain, xi, weights), n, more, eta, along)
    is_old = np.concatenate([np.arange(many + 1) <= few for few, many in zip(orders, more, strict=True)])
    elements, functions, width = len(chain.segments), p + ALONG + 1, len(is_old)
    asked = np.ones((elements, functions, width), dtype=bool)
    for end, (element, function) in zip(chain.ends, ((0, 0), (-1, 1)), strict=True):
        asked[element, function] = ~is_old if end == "free" else False
    if n == 0 and chain.ends == ("pole", "pole"):  # or the sphere would turn about its axis
        asked[0, 1] = asked[1, 0] = ~is_old
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
    is_deep = ~is_old[used % width]
    return ShellExtension(
        table, is_old, is_deep, values_to_hierarchic(p), pattern, tuple(places), station_stiffness(table),
        _count(resonator, chain, level),
    )  # fmt: skip


def _count(resonator: Resonator, chain: Chain, level: Level) -> float:
    """How often the surplus of a chain counts: more where faces have corners, of which two more modes take off but a share."""
    smooth = (
        SMOOTH
        * max(1.0, level.along / 12)
        * (TIED if "tied" in chain.ends else 1.0)
        * (NAGHDI if max(level.through) == 1 else 1.0)
    )
    if all(abs(jump) < SLOPE for jump in resonator.slope_jumps(chain.breaks[0], chain.breaks[-1])):
        return smooth
    order = max(level.through)
    return float(smooth / (1 - (order / (order + 2)) ** BLUNT))


def _extend_solid(group: SolidGroup, degree: int, is_rounded: bool) -> SolidExtension:
    mesh = group.mesh
    table = tabulate_cells(mesh.grid, _next_functions(degree), group.table.n, group.table.position[0, 0])
    products = table.products(np.ones((len(mesh.edges), table.gradients.shape[3])))
    factor = (degree + 1) / 2 * (1.0 if is_rounded else SINGULAR)
    turned = np.where(mesh.reversed_ & bool((degree + 1) % 2), -1.0, 1.0)[..., None]
    return SolidExtension(table, products, mesh.edges, turned, open_edges(mesh, group.boundary), factor)


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
