"""Modes of a resonator of revolution: frequencies with their error, Bryan factors, shapes.

>>> mode, = solve_modes(hemisphere(radius=15e-3, thickness=0.9e-3), Elastic(72.7e9, 0.17, 2203.0))
"""

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from shell.assembly import build_system
from shell.curves import Arc
from shell.elastic import Elastic, VaryingElastic
from shell.errors import ShellError
from shell.fitted import fit_profile
from shell.layout import Theory
from shell.refinement import FLOOR, refine, solve_level
from shell.resonator import Resonator
from shell.section import ShapePatch, draw_section, sample_shape
from shell.solution import AlongMeridian, EnergyFractions, Solution, total
from shell.surplus import estimate_errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure

THEORIES = ("solid", "shell", "rayleigh")
MOST_HARMONIC = 100  # waves shorter than any wall is thin; beyond, the meshes outgrow memory
SMALL = 5e-4  # relative change of the thickness over h/R (and a²/L² of a stem), of the difference that gives the slope of ln f
EXACT = 1e-11  # of ω², at which the iteration for another design stops
THICKEST_SHELL = 0.1  # h/R up to which shell theory has been held against the solid


class TheoryRangeWarning(UserWarning):
    """The design lies outside the range in which the chosen theory can be trusted."""


@dataclass(frozen=True)
class Mode:
    """A mode of vibration: its frequency (Hz), that frequency's error against the exact solution of its theory, and its Bryan factor."""

    harmonic: int  # n, the number of waves around
    index: int  # 0 for the lowest mode of its harmonic
    frequency: float  # Hz
    theory: Theory  # "solid", "shell" or "rayleigh"
    # of the frequency against the exact solution *of this theory*; for "rayleigh" against shell theory, since
    # Rayleigh's solution violates the edge conditions.
    relative_error_estimate: float
    # precession of the standing wave per angle of rotation; 0 for n = 0, which has no pattern to turn.
    bryan_factor: float
    resonator: Resonator = field(compare=False)  # that was solved
    label: str = ""  # "torsion" or "axial" for n = 0, else empty
    eigenvector: Solution | None = field(default=None, compare=False)  # None for "rayleigh"

    @property
    def solution(self) -> Solution:
        """The eigenvector and its energies."""
        if self.eigenvector is None:
            raise ShellError("Rayleigh's closed form carries no shape or energies: use theory solid or shell.")
        return self.eigenvector

    @cached_property
    def sensitivities(self) -> "Sensitivities":
        """Derivatives of ln f, by energies of the mode at the unchanged shape; closed form for "rayleigh"."""
        if self.eigenvector is None:
            raise ShellError("Rayleigh's closed form has its own derivatives: shell.rayleigh.rayleigh_log_derivatives.")
        thickness = _by_thickness(self.resonator, self.solution)
        return Sensitivities(0.5, self.solution.by_nu, -0.5, thickness, -1 - thickness)

    @property
    def energy_fractions(self) -> EnergyFractions:
        """How the energy divides between bending, membrane, shear, root and stem."""
        return self.solution.energy_fractions

    @property
    def along(self) -> AlongMeridian:
        """What each place of the meridian contributes to d ln f: energy shares for fields along the meridian."""
        return self.solution.along

    @cached_property
    def modal_mass(self) -> float:
        """Modal mass ∫ ρ |u|² dV, kg, of the mode scaled to a largest displacement of 1."""
        return self.solution.mass / self.largest_displacement**2

    @cached_property
    def largest_displacement(self) -> float:
        """Largest displacement of the eigenvector as it is scaled."""
        return max(float(np.max(np.maximum(np.hypot(p.u_r, p.u_z), abs(p.u_theta)))) for p in self.shape())

    def shape(self, points: int = 9) -> "tuple[ShapePatch, ...]":
        """Displacement on the cross-section, stem included, as curved grids of `points` by `points`."""
        return sample_shape(self.resonator, self.solution, points)

    def solved_on(self, resonator: Resonator, elastic: Elastic) -> "Mode":
        """The mode of another design with the same elements, so that frequencies are smooth in its dimensions."""
        _check_theory(resonator, self.theory)
        old, (fitted, rest) = self.solution.system, fit_profile(resonator)
        system = build_system(fitted, old.n, replace(old.level, like=old.level.like or self.resonator))
        found, *_ = solve_level(system, fitted.size, elastic, self.index + 1, EXACT)
        error = FLOOR + float(estimate_errors(fitted, elastic, found)[:, self.index].sum())
        if rest:
            error += rest.error(found[-1].along)
        return _name(found[-1], self.index, self.theory, error, fitted)

    def plot(self) -> "Figure":
        """Draw the cross-section through an antinode, undeformed and at full swing to both sides (matplotlib)."""
        return draw_section(self.shape(33), self.harmonic, f"n = {self.harmonic}, {self.frequency:.3f} Hz")

    def __repr__(self) -> str:
        kind = f", {self.label}" if self.label else ""
        return f"Mode(n = {self.harmonic}, {self.frequency:.3f} Hz{kind}, Bryan factor {self.bryan_factor:.4f}, {self.theory}, relative error {self.relative_error_estimate:.1e})"


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of ln f by ln E, ν (at constant E), ln ρ, ln h, and all other lengths; E + rho = 0, thickness + radius = -1."""

    E: float
    nu: float
    rho: float
    thickness: float
    radius: float


def solve_modes(
    resonator: Resonator, elastic: Elastic | VaryingElastic, harmonic: int = 2, count: int = 1,
    theory: Theory = "solid", tolerance: float = 1e-5,
) -> tuple[Mode, ...]:  # fmt: skip
    """The lowest modes of one circumferential harmonic, without rigid motions.

    Orders rise until what the next functions would still change lies within the relative `tolerance`: the error
    estimate (shell.surplus), to which thin shells add what double precision loses (shell.refinement).

    Warns:
        TheoryRangeWarning: Where the theory is outside its range, or the tolerance is out of reach.
    """
    if not (isinstance(resonator, Resonator) and isinstance(elastic, Elastic | VaryingElastic)):
        given = f"{type(resonator).__name__} and {type(elastic).__name__}"
        raise ShellError(f"give a Resonator, such as hemisphere(...) or a card's .resonator, and an Elastic, such as a material's .elastic(T), not {given}.")  # fmt: skip
    _check_arguments(harmonic, count, theory, tolerance)
    _check_theory(resonator, theory)
    if theory == "rayleigh":
        return _rayleigh(resonator, elastic, harmonic, count)
    resonator, rest = fit_profile(resonator)
    solutions, errors = refine(resonator, elastic, harmonic, count, theory, tolerance)
    if rest:
        errors = [error + rest.error(one.along) for one, error in zip(solutions, errors, strict=True)]
    if max(errors) > tolerance:
        warnings.warn(
            f"the tolerance of {tolerance:g} was not reached: relative error {max(errors):.2g}.",
            TheoryRangeWarning,
            stacklevel=2,
        )
    return tuple(
        _name(one, k, theory, error, resonator) for k, (one, error) in enumerate(zip(solutions, errors, strict=True))
    )


def _name(solution: Solution, index: int, theory: Theory, error: float, resonator: Resonator) -> Mode:
    f, n = sqrt(solution.eigenvalue) / (2 * pi), solution.system.n
    return Mode(n, index, f, theory, error, solution.bryan_factor, resonator, _label(solution), solution)


def _check_theory(resonator: Resonator, theory: Theory) -> None:
    ratio = max(value for _, value in resonator.thickness) / resonator.size
    if theory != "solid" and ratio > THICKEST_SHELL:
        warnings.warn(
            f"h/R = {ratio:.3g} is {ratio / THICKEST_SHELL:.2g} times the limit ({THICKEST_SHELL:g}) of the {theory} theory: use the solid theory.",
            TheoryRangeWarning,
            stacklevel=3,
        )


def nearest_mode(
    solve: Callable[[int, int], Sequence[Mode]], own: Mode, harmonics: Iterable[int] = range(5), least: int = 2
) -> Mode:
    """Return the mode nearest in frequency to `own` among harmonics; solve(harmonic, count) gives at least the lowest `count`, in order."""
    others: list[Mode] = []
    for n in harmonics:
        count, found = least, solve(n, least)
        while found[-1].frequency <= own.frequency:
            count *= 2
            found = solve(n, count)
        others += [mode for mode in found if (mode.harmonic, mode.index) != (own.harmonic, own.index)]
    return min(others, key=lambda mode: abs(mode.frequency - own.frequency))


def _by_thickness(resonator: Resonator, solution: Solution) -> float:
    """D ln f / d ln h of the whole profile: change of the Rayleigh quotient with the shape kept (it is stationary)."""
    # what is neglected goes as (step R/h)², 2.5 SMALL² of the slope, and in a stem, which bends far more easily than it
    # stretches, as (step L²/a²)²; a smaller step leaves the digits of thin shells in rounding
    step = SMALL * min(value for _, value in resonator.thickness) / resonator.size
    if resonator.stem:
        top = float(resonator.at([0.0]).z[0])
        step = min(step, *(SMALL * (resonator.stem.radius / (end - top)) ** 2 for _, end in resonator.stem.roots))
    level = replace(solution.system.level, like=solution.system.level.like or resonator)
    systems = (build_system(resonator.thickened(1 + change), solution.system.n, level) for change in (-step, step))
    low, high = (Solution(system, solution.constants, solution.vector).eigenvalue for system in systems)
    return log(high / low) / (2 * log((1 + step) / (1 - step)))


def _label(solution: Solution) -> str:
    if solution.system.n:
        return ""
    around = sum(
        float(np.sum(c.rho[..., None] * d[:, :, 1] ** 2 * group.table.volume))
        for group, c, d in zip(solution.system.groups, solution.constants, solution.displacement, strict=True)
    )
    return "torsion" if around > total(solution.kinetic) / 2 else "axial"


def _check_arguments(harmonic: int, count: int, theory: str, tolerance: float) -> None:
    if theory not in THEORIES:
        raise ShellError(f"the theory is one of {', '.join(THEORIES)}, not {theory!r}.")
    if harmonic != int(harmonic) or harmonic < 0:
        raise ShellError(f"the harmonic is a whole number from 0 up, not {harmonic!r}.")
    if harmonic > MOST_HARMONIC and theory != "rayleigh":
        raise ShellError(f"the solver goes up to harmonic n = {MOST_HARMONIC}, not {harmonic}; choose a lower one.")
    if count < 1:
        raise ShellError(f"at least one mode must be asked for, not {count}.")
    if not 0 < tolerance < 1:
        raise ShellError(f"the tolerance is a relative error between 0 and 1, not {tolerance:g}.")


def _rayleigh(resonator: Resonator, elastic: Elastic | VaryingElastic, n: int, count: int) -> tuple[Mode, ...]:
    """Rayleigh's closed form; its error is its distance from shell theory."""
    from shell.rayleigh import rayleigh_bryan_factor, rayleigh_frequency

    dome = resonator.segments[0]
    thicknesses = {value for _, value in resonator.thickness}
    if len(resonator.segments) != 1 or not isinstance(dome, Arc) or dome.center != (0.0, 0.0) or len(thicknesses) != 1:
        raise ShellError("Rayleigh's closed form holds for a hemisphere of constant thickness only: use theory solid or shell.")  # fmt: skip
    if resonator.support != "free" or not isinstance(elastic, Elastic):
        raise ShellError("Rayleigh's closed form holds for a free shell of one material, without a stem, films or gradients: use --theory solid or shell.")  # fmt: skip
    if n < 2 or count != 1:
        raise ShellError("Rayleigh's closed form is one mode for each n >= 2: use --harmonic 2 or more with --count 1.")
    h = thicknesses.pop()
    f = float(
        rayleigh_frequency(n, elastic.E, elastic.nu, elastic.rho, h, dome.radius, dome.first_angle, dome.last_angle)
    )
    (bent,) = solve_modes(resonator, elastic, n, theory="shell")
    bryan = rayleigh_bryan_factor(n, dome.first_angle, dome.last_angle)
    return (Mode(n, 0, f, "rayleigh", abs(f / bent.frequency - 1), bryan, resonator),)
