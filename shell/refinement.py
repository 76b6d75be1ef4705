"""Rising polynomial orders: solve one level after the other until its own estimate of the error is small enough."""

from shell.assembly import build_system
from shell.eigen import Factor, Iteration, whole_pattern
from shell.elastic import Elastic, VaryingElastic
from shell.levels import LEVELS, Theory
from shell.resonator import Resonator
from shell.solution import Constants, Solution, find_constants
from shell.surplus import estimate_error
from shell.system import System


def refine(
    resonator: Resonator,
    elastic: Elastic | VaryingElastic,
    n: int,
    count: int,
    theory: Theory,
    tolerance: float,
) -> tuple[list[Solution], list[float]]:
    """The `count` lowest elastic modes of the first level whose estimated errors lie within `tolerance`, and these errors."""
    for level in LEVELS[theory]:
        system = build_system(resonator, n, theory, level)
        solutions = solve_level(system, resonator.size, elastic, count, max(1e-6 * tolerance, 1e-13))
        errors = [estimate_error(resonator, elastic, solution) for solution in solutions]
        if max(errors) <= tolerance:
            break
    return solutions, errors


def solve_level(
    system: System, size: float, elastic: Elastic | VaryingElastic, count: int, accuracy: float
) -> list[Solution]:
    """The `count` lowest elastic modes of one system, for a resonator of radius `size`, m; `accuracy` is that of ω²."""
    constants = tuple(
        find_constants(group.table.position, elastic, group.table.plane_stress) for group in system.groups
    )
    # a small shift factors the rigid motions and leaves the elastic modes in order
    shift = 1e-2 * constants[0].wave_speed_squared / size**2 if system.rigid_motions else 0.0
    wanted = count + system.rigid_motions
    vectors = _begin(system, elastic, constants, shift).converge(wanted, accuracy)
    found = [Solution(system, constants, vector) for vector in vectors.T[:wanted]]
    return sorted(found, key=lambda solution: solution.eigenvalue)[system.rigid_motions :]


def _begin(
    system: System, elastic: Elastic | VaryingElastic, constants: tuple[Constants, ...], shift: float
) -> Iteration:
    """Factor K + shift M; both over ρ where it is the same everywhere."""
    uniform, rho = (True, elastic.rho) if isinstance(elastic, Elastic) else (False, 1.0)
    if uniform and system.is_tiny:
        trace, shear, mass = system.whole
        lam, G = (field[0, 0] / rho for field in constants[0].lame)
        return Iteration(Factor(whole_pattern(len(mass)), [lam * trace + G * shear + shift * mass]), mass)
    lam, G, density = (
        [field / rho for field in fields] for fields in zip(*((*one.lame, one.rho) for one in constants), strict=True)
    )
    K, M = system.operators(lam, G, density, uniform, shift)
    return Iteration(Factor(system.pattern, K), M)
