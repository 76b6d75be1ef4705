"""Rising polynomial orders: solve one level after the other until its own estimate of the error is small enough."""

from collections.abc import Iterator
from dataclasses import replace
from math import ceil, e, exp, hypot, log, pi

import numpy as np

from shell.assembly import build_system
from shell.eigen import Factor, lowest_pairs
from shell.elastic import Elastic, VaryingElastic
from shell.errors import ShellError
from shell.layout import FIRST, KINDS, LONGEST, ROUGH, Kind, Level, Theory, crowding
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.solution import Solution, total
from shell.surplus import estimate_errors
from shell.system import System

UNDONE = 1e-4  # share of the tolerance, as error of ω², at which the iteration stops: sensitivities feel the root of it
THIN = 1e-3  # h/R from which on the loss by rounding lies below 1e-13; it grows at most as (R/h)^4
MEMORY = 1.5e9  # bytes of element matrices beyond which a level is not tried
FLOOR = 3e-10  # relative error of a frequency by rounding and iteration: measured up to 2.5e-10
DOUBT = 10.0  # the most by which an estimate is raised for what the one before it missed, and if waves are not resolved
AIM = 0.7  # of the tolerance, that the sum of all kinds of error should be at the next level
PART = 0.1  # of the tolerance, that one kind of error may keep
STEP = 0.04  # what one step of its ladder leaves of a kind of error: measured 0.02 to 0.13
AT_MOST = 2  # steps at once
LOOSE = 3e-4  # tolerance from which on the rough level is the first
HALF_WAVES = 0.8  # along the meridian for each mode; the others twist and stretch
AT_ONCE = 2.5  # by which elements are cut at most before the modes are solved anew
DEEP = 0.7  # wavenumber times thickness beyond which the first order through the thickness is not enough


def refine(
    resonator: Resonator, elastic: Elastic | VaryingElastic, n: int, count: int, theory: Theory, tolerance: float
) -> tuple[list[Solution], list[float]]:
    """The `count` lowest elastic modes of the first level whose estimated errors lie within `tolerance`, and these
    errors.

    The next level is finer in what most of the error comes from, until what arithmetic loses in a thin shell is larger.
    """
    thinnest = min(value for _, value in resonator.thickness) / resonator.size
    density = _density(elastic)
    level = _first_level(resonator, n, count, theory, tolerance)
    before: tuple[list[Solution], Array] | None = None
    raised: set[Kind] = set()
    while True:
        system = build_system(resonator, n, level)
        if before and system.memory > MEMORY:
            break
        if system.memory > MEMORY:
            raise ShellError(
                f"harmonic {n} of this resonator needs {system.memory / 1e9:.1f} GB: its wavelength is too short for elements of the "
                "whole section. Ask for a lower harmonic or a shorter or thicker shell."
            )
        solutions, undone, factor = solve_level(system, resonator.size, elastic, count, max(UNDONE * tolerance, 1e-13))
        if not before and (shorter := _cut(solutions[1:], level, tolerance)) < level.longest / 1.2:
            level = replace(level, longest=shorter)
            continue
        lacking = estimate_errors(resonator, elastic, solutions)
        if before:  # by how much what was raised since was farther off than was said
            stated = before[1][[KINDS.index(kind) for kind in raised]].sum(axis=0)
            moved = [abs(a.eigenvalue / b.eigenvalue - 1) / 2 for a, b in zip(before[0], solutions, strict=True)]
            lacking *= np.clip(moved / stated, 1.0, DOUBT)
        lacking *= [1.0 if not k or _is_resolved(one) else DOUBT for k, one in enumerate(solutions)]
        before = solutions, lacking
        lost = [_find_loss(solution, factor, density) if thinnest < THIN else 0.0 for solution in solutions]
        errors = [sum(parts) for parts in zip(lacking.sum(axis=0).tolist(), lost, undone, strict=True)]
        if max(errors) <= tolerance or max(lost) > lacking.sum(axis=0).max():
            break
        largest: dict[Kind, float] = dict(zip(KINDS, lacking.max(axis=1).tolist(), strict=True))
        level, raised = choose_finer(level, theory, largest, tolerance)
        if not raised:
            break
    return solutions, [error + FLOOR for error in errors]


def choose_finer(level: Level, theory: Theory, lacking: dict[Kind, float], tolerance: float) -> tuple[Level, set[Kind]]:
    """The next level, and what is finer there: step by step in the largest error left, until their sum should be small enough."""
    finer, left, raised = level, dict(lacking), list[Kind]()
    while not raised or sum(left.values()) > AIM * tolerance:
        worth = [kind for kind in KINDS if left[kind] >= min(PART * tolerance, max(left.values()))]
        able = [kind for kind in worth if raised.count(kind) < AT_MOST and finer.raised(theory, {kind}) != finer]
        if not able:
            break
        kind = max(able, key=lambda kind: left[kind])
        finer, left[kind] = finer.raised(theory, {kind}), STEP * left[kind]
        raised.append(kind)
    return finer, set(raised)


def _first_level(resonator: Resonator, n: int, count: int, theory: Theory, tolerance: float) -> Level:
    """The level to begin with: rough for loose tolerances, finer for the short waves that many modes and high harmonics have."""
    level = (ROUGH if tolerance >= LOOSE else FIRST)[theory]
    k = HALF_WAVES * pi * (count - 1) / resonator.length
    level = replace(level, longest=_in_parts(_most(level, tolerance) / max(k, 1e-9) / (resonator.size * crowding(n))))
    if hypot(k, n / resonator.size) * max(value for _, value in resonator.thickness) > DEEP and tolerance < LOOSE:
        level = level.raised(theory, {"through"})
    return level


def _cut(solutions: list[Solution], level: Level, tolerance: float) -> float:
    """The longest element, over the radius, on which the degree follows the waves of these modes."""
    longest = level.longest
    for solution in solutions:
        for half in _half_waves(solution):
            longest = min(longest, level.longest * _most(level, tolerance) / max(2 * half, 1e-9))
    return _in_parts(max(longest, level.longest / AT_ONCE))  # waves that are not resolved seem shorter than they are


def _most(level: Level, tolerance: float) -> float:
    """What k L a degree p follows: the best polynomial on a wave is off by (e k L/(4 p))^(2 p) in the energy."""
    p = level.along
    return 4 * p / e * exp(log(max(tolerance, 1e-5)) / (2 * p))


def _in_parts(longest: float) -> float:
    """A whole part of the usual length, so that neighbouring designs have the same elements."""
    return LONGEST / max(1, ceil(LONGEST / longest - 1e-9))


def _half_waves(solution: Solution) -> Iterator[float]:
    """Of every chain the largest k L/2 of bending waves over an element: k⁴ = 12 ρ (1 - ν²) ω²/(E h²), of which n/r runs around."""
    for number, group in solution.system.chains.items():
        section, c = group.section, solution.constants[number]
        k = np.sqrt(12 * c.rho * (1 - c.nu**2) * solution.eigenvalue / (c.E * section.thickness**2))
        yield float(np.max(np.sqrt(np.maximum(k - (solution.system.n / section.r) ** 2, 0.0)) * section.ds))


def _is_resolved(solution: Solution) -> bool:
    """Whether the degree p follows bending waves over its elements, p > k L/2; before, no surplus tells their error."""
    return all(half <= solution.system.level.along for half in _half_waves(solution))


def solve_level(
    system: System, size: float, elastic: Elastic | VaryingElastic, count: int, accuracy: float
) -> tuple[list[Solution], list[float], Factor]:
    """The `count` lowest elastic modes of one system, for a resonator of radius `size`, m; `accuracy` is that of ω².

    Returns them, what the iteration left undone of each, and the factor of the stiffness over `_density`.
    """
    constants = system.constants(elastic)
    wanted = count + system.rigid_motions
    K, mass = system.operators(constants, system.shift(constants, size), over=_density(elastic))
    factor = Factor(system.pattern, K)
    vectors, undone = lowest_pairs(factor, mass, wanted, accuracy)
    found = [(Solution(system, constants, one), float(left) / 2) for one, left in zip(vectors.T, undone, strict=True)]
    elastic_ones = sorted(found, key=lambda one: one[0].eigenvalue)[system.rigid_motions :]
    return [one for one, _ in elastic_ones], [left for _, left in elastic_ones], factor


def _density(elastic: Elastic | VaryingElastic) -> float:
    """What the equations are divided by: ρ where it is the same everywhere."""
    return elastic.rho if isinstance(elastic, Elastic) else 1.0


def _find_loss(solution: Solution, factor: Factor, density: float) -> float:
    """What double precision loses of the frequency of a thin shell, relative; `factor` is that of the stiffness over `density`.

    The factored stiffness is K + ΔK, with rounding errors ΔK of about 1e-16 of the membrane stiffness, and this is no longer
    small beside the bending stiffness, (h/R)² times less. So the vector q that was found is not the one of K, and the forces
    r = ∫ σ(q) : ε dV - ω² ∫ ρ u(q) · u dV on the functions of the level, which strains tell without loss, do not vanish. They
    take rᵀ K⁻¹ r off ω² ∫ ρ u² dV, as the forces on the functions that the level lacks do (shell.surplus). What the iteration
    left undone is in r as well.
    """
    fields = zip(solution.system.groups, solution.stress, solution.force, strict=True)
    r = solution.system.gather([group.table.loads(stress, force) for group, stress, force in fields])
    answer = factor.solve(np.asfortranarray(r[:, None]))[:, 0] / density
    return float(r @ answer) / (2 * solution.eigenvalue * total(solution.kinetic))
