"""Rising polynomial orders: solve one level, carry its vectors to the next, and compare the frequencies."""

from functools import cache
from math import sqrt

import numpy as np

from shell.assembly import build_system
from shell.eigen import Iteration, Pattern
from shell.elastic import Elastic, VaryingElastic
from shell.levels import LEVELS, Level, Theory
from shell.quadrature import Array, lobatto, nodal
from shell.resonator import Resonator
from shell.solution import Constants, Solution, total
from shell.system import ShellPart, System

TRUE_DIFFERENCE = 0.1  # error of the difference between two levels over the difference
MOST_SOLID = 0.1  # share of the kinetic energy in solid parts up to which a vector is carried to the next level


def refine(
    resonator: Resonator,
    elastic: Elastic | VaryingElastic,
    n: int,
    count: int,
    theory: Theory,
    tolerance: float,
) -> tuple[list[Solution], list[float]]:
    """The `count` lowest elastic modes of the first level within `tolerance` of the next, and these distances.

    The finer level is only asked for its frequencies, in a few steps of inverse iteration from the coarser vectors. Only
    where the distance is too large are its own vectors iterated to the end, to be compared with the level after.
    """
    levels = LEVELS[theory]
    accuracy = max(1e-6 * tolerance, 1e-13)
    coarse = _Stage(resonator, elastic, n, count, theory, levels[0])
    coarse.converge(None, accuracy)
    for level in levels[1:]:
        fine = _Stage(resonator, elastic, n, count, theory, level)
        if coarse.solid_share < MOST_SOLID:
            start = prolong(coarse.system, fine.system, coarse.vectors)
            errors = fine.compare(start[:, : fine.wanted], coarse.solutions)
            if max(errors) > tolerance:
                fine.converge(start, accuracy)
                errors = _distances(coarse.solutions, fine.solutions)
        else:
            fine.converge(None, accuracy)
            errors = _distances(coarse.solutions, fine.solutions)
        if max(errors) <= tolerance or level is levels[-1]:
            break
        coarse = fine
    return coarse.solutions, errors


class _Stage:
    """One level: its operators, the vectors found so far, and the wanted modes."""

    vectors: Array
    solutions: list[Solution]

    def __init__(
        self,
        resonator: Resonator,
        elastic: Elastic | VaryingElastic,
        n: int,
        count: int,
        theory: Theory,
        level: Level,
    ) -> None:
        self.system = build_system(resonator, n, theory, level)
        self.rigid = self.system.rigid_motions
        self.wanted = count + self.rigid
        self.constants = tuple(
            _constants(group.table.position, elastic, group.table.plane_stress) for group in self.system.groups
        )
        pattern, K, M = _operators(self.system, elastic, self.constants)
        # a small shift factors the rigid motions and leaves the elastic modes in order
        shift = 1e-2 * self.constants[0].wave_speed_squared / resonator.size**2 if self.rigid else 0.0
        self.iteration = Iteration(pattern, K, M, shift)

    def converge(self, start: Array | None, accuracy: float) -> None:
        """Iterate a subspace until the wanted modes stand."""
        self.vectors = self.iteration.converge(start, self.wanted, accuracy)
        self.solutions = self._solve(self.vectors)

    def compare(self, start: Array, coarse: list[Solution]) -> list[float]:
        """The distances of coarser frequencies from this level's, from vectors that are near."""
        before, (values, vectors, loaded) = self.iteration.begin(start)
        while True:
            distances = _distances(coarse, self._solve(vectors))
            if np.max(abs(values / before - 1)) < TRUE_DIFFERENCE * max(min(distances), 1e-13):
                return distances
            before = values
            values, vectors, loaded = self.iteration.step(loaded)

    @property
    def solid_share(self) -> float:
        """The largest share of the kinetic energy that a mode has in solid parts."""
        shells = [isinstance(group.place, ShellPart) for group in self.system.groups]
        if all(shells):
            return 0.0
        return max(
            1 - total([T for T, shell in zip(one.kinetic, shells, strict=True) if shell]) / total(one.kinetic)
            for one in self.solutions
        )

    def _solve(self, vectors: Array) -> list[Solution]:
        found = [Solution(self.system, self.constants, vector) for vector in vectors.T[: self.wanted]]
        return sorted(found, key=lambda solution: solution.eigenvalue)[self.rigid :]


def prolong(coarse: System, fine: System, vectors: Array) -> Array:
    """The coarser vectors on the finer level's shell elements, zero in solid parts.

    Displacements are interpolated along the meridian and keep their modes through the thickness.
    """
    raw = coarse.constraint @ vectors
    finer = np.zeros((fine.constraint.shape[0], vectors.shape[1]))
    for one, two in zip(coarse.groups, fine.groups, strict=True):
        if isinstance(one.place, ShellPart):
            p, q = (group.table.along.shape[2] - 1 for group in (one, two))
            cuts = len(two.unknowns) // len(one.unknowns)
            along = _along(p, q, cuts) @ one.spread(raw).reshape(len(one.unknowns), 1, p + 1, -1)
            here = along.reshape(len(two.unknowns), q + 1, -1, vectors.shape[1])
            there = np.zeros((*here.shape[:2], two.unknowns.shape[1] // (q + 1), vectors.shape[1]))
            of, to = 0, 0
            for few, many in zip(coarse.level.through, fine.level.through, strict=True):
                there[:, :, to : to + few + 1] = here[:, :, of : of + few + 1]
                of, to = of + few + 1, to + many + 1
            two.gather(there, finer)
    return finer[fine.free]


@cache
def _along(p: int, q: int, cuts: int) -> Array:
    """Values of the polynomials of an element at the nodes of its `cuts` equal pieces, (cuts, q + 1, p + 1)."""
    nodes = lobatto(q)
    return np.array([nodal(p, (nodes + 2 * k + 1 - cuts) / cuts).values for k in range(cuts)])


def _distances(coarse: list[Solution], fine: list[Solution]) -> list[float]:
    return [abs(sqrt(one.eigenvalue / two.eigenvalue) - 1) for one, two in zip(coarse, fine, strict=True)]


def _constants(position: Array, elastic: Elastic | VaryingElastic, plane_stress: bool) -> Constants:
    if isinstance(elastic, VaryingElastic):
        E, nu, rho = elastic.at(position)
    else:
        E, nu, rho = (np.full(position.shape, value) for value in (elastic.E, elastic.nu, elastic.rho))
    return Constants(E, nu, rho, plane_stress)


def _operators(
    system: System, elastic: Elastic | VaryingElastic, constants: tuple[Constants, ...]
) -> tuple[Pattern, list[Array], list[Array]]:
    """Stiffness and mass of the elements with their pattern; both over ρ where it is the same everywhere."""
    if isinstance(elastic, VaryingElastic) or not system.is_small:
        K, M = system.varying(
            [c.lame[0] for c in constants], [c.lame[1] for c in constants], [c.rho for c in constants]
        )
        return system.pattern, K, M
    pattern, units = system.whole if system.is_tiny else (system.pattern, system.units)
    moduli = [
        np.array([c.lame[0][0, 0], c.lame[1][0, 0]]) / elastic.rho
        for c, group in zip(constants, system.groups, strict=True)
        for _ in group.unknowns
    ]
    K = [(pair @ unit[:2].reshape(2, -1)).reshape(unit.shape[1:]) for pair, unit in zip(moduli, units, strict=False)]
    return pattern, K, [unit[2] for unit in units]
