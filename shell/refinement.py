"""Rising polynomial orders: solve one level after the other until its own estimate of the error is small enough."""

import numpy as np

from shell.assembly import build_system
from shell.eigen import Factor, Iteration, whole_pattern
from shell.elastic import Elastic, VaryingElastic
from shell.errors import ShellError
from shell.levels import LEVELS, Theory
from shell.resonator import Resonator
from shell.rounding import THIN, find_loss
from shell.solution import Constants, Solution, find_constants
from shell.surplus import estimate_errors
from shell.system import ShellGroup, System

UNDONE = 1e-4  # share of the tolerance, as error of ω², at which the iteration stops: sensitivities feel the root of it
MEMORY = 1.5e9  # bytes of element matrices beyond which a level is not tried
FLOOR = 3e-10  # relative error of a frequency by rounding and iteration: measured up to 2.5e-10
DOUBT = 10.0  # the most by which an estimate is raised for what the one before it missed, and if waves are not resolved


def refine(
    resonator: Resonator,
    elastic: Elastic | VaryingElastic,
    n: int,
    count: int,
    theory: Theory,
    tolerance: float,
) -> tuple[list[Solution], list[float]]:
    """The `count` lowest elastic modes of the first level whose estimated errors lie within `tolerance`, and these errors.

    An error has two parts: what the level lacks, and what the arithmetic loses in a thin shell; where the second is the
    larger, a finer level would only lose more.
    """
    thinnest = min(value for _, value in resonator.thickness) / resonator.size
    density = _density(elastic)
    before: tuple[list[Solution], list[float]] | None = None
    for level in LEVELS[theory]:
        system = build_system(resonator, n, theory, level)
        if before and system.memory > MEMORY:
            break
        if system.memory > MEMORY:
            raise ShellError(
                f"harmonic {n} of this resonator needs {system.memory / 1e9:.1f} GB: it waves too finely for elements of the whole "
                "section. Ask for a lower harmonic or a shorter or thicker shell."
            )
        solutions, undone, factor = _solve(system, resonator.size, elastic, count, max(UNDONE * tolerance, 1e-13))
        lacking = estimate_errors(resonator, elastic, solutions)
        if before:
            lacking = [
                error * _experience(now, former, stated)
                for error, now, former, stated in zip(lacking, solutions, *before, strict=True)
            ]
        lacking = [  # the lowest mode has no short waves to speak of
            error * (1.0 if not k or _is_resolved(one) else DOUBT)
            for k, (error, one) in enumerate(zip(lacking, solutions, strict=True))
        ]
        before = solutions, lacking
        lost = [find_loss(solution, factor, density) if thinnest < THIN else 0.0 for solution in solutions]
        errors = [sum(parts) for parts in zip(lacking, lost, undone, strict=True)]
        if max(errors) <= tolerance or max(lost) > max(lacking):
            break
    return solutions, [error + FLOOR for error in errors]


def _is_resolved(solution: Solution) -> bool:
    """Whether the degree follows bending waves of the mode's frequency, k⁴ = 12 ρ (1 - ν²) ω²/(E h²), over its elements.

    Polynomials of degree p begin to converge on a wave over a length L at p = k L/2; before, no surplus tells their error.
    """
    for group, c in zip(solution.system.groups, solution.constants, strict=True):
        if isinstance(group, ShellGroup):
            section = group.place.section
            k = (12 * c.rho * (1 - c.nu**2) * solution.eigenvalue / (c.E * section.thickness**2)) ** 0.25
            if np.max(k * section.ds) > solution.system.level.along:
                return False
    return True


def _experience(now: Solution, before: Solution, stated: float) -> float:
    """By how much the level before was farther off than it said; 1 if it was not."""
    return min(max(abs(before.eigenvalue / now.eigenvalue - 1) / 2 / stated, 1.0), DOUBT)


def solve_level(
    system: System, size: float, elastic: Elastic | VaryingElastic, count: int, accuracy: float
) -> list[Solution]:
    """The `count` lowest elastic modes of one system, for a resonator of radius `size`, m; `accuracy` is that of ω²."""
    return _solve(system, size, elastic, count, accuracy)[0]


def _solve(
    system: System, size: float, elastic: Elastic | VaryingElastic, count: int, accuracy: float
) -> tuple[list[Solution], list[float], Factor]:
    """The modes of one system, what the iteration left undone of each, and the factor of its stiffness over `_density`."""
    constants = tuple(
        find_constants(group.table.position, elastic, group.table.plane_stress) for group in system.groups
    )
    # a small shift factors the rigid motions and leaves the elastic modes in order
    shift = 1e-2 * constants[0].wave_speed_squared / size**2 if system.rigid_motions else 0.0
    wanted = count + system.rigid_motions
    iteration = _begin(system, elastic, constants, shift)
    pairs = iteration.converge(wanted, accuracy)
    found = [
        (Solution(system, constants, vector), float(undone) / 2)
        for vector, undone in zip(pairs.vectors.T, pairs.undone, strict=True)
    ]
    elastic_ones = sorted(found, key=lambda one: one[0].eigenvalue)[system.rigid_motions :]
    return [one for one, _ in elastic_ones], [undone for _, undone in elastic_ones], iteration.factor


def _begin(
    system: System, elastic: Elastic | VaryingElastic, constants: tuple[Constants, ...], shift: float
) -> Iteration:
    """Factor K + shift M; both over ρ where it is the same everywhere."""
    uniform, rho = isinstance(elastic, Elastic), _density(elastic)
    if uniform and system.is_tiny:
        trace, shear, mass = system.whole
        lam, G = (field[0, 0] / rho for field in constants[0].lame)
        return Iteration(Factor(whole_pattern(len(mass)), [lam * trace + G * shear + shift * mass]), mass)
    lam, G, density = (
        [field / rho for field in fields] for fields in zip(*((*one.lame, one.rho) for one in constants), strict=True)
    )
    K, M = system.operators(lam, G, density, uniform, shift)
    return Iteration(Factor(system.pattern, K), M)


def _density(elastic: Elastic | VaryingElastic) -> float:
    """What the equations are divided by: ρ where it is the same everywhere."""
    return elastic.rho if isinstance(elastic, Elastic) else 1.0
