"""A family of designs: one mode of all of them from full solves of a few, with its error.

>>> axes = (Axis("thickness_mm", 0.8, 1.0),)
>>> family = build_family(lambda h: hemisphere(15e-3, 1e-3 * h[0]), axes, nu=(0.15, 0.19))
>>> found = family.evaluate(np.linspace(0.8, 1.0, 10_000)[:, None], nu=0.17, E=72.7e9, rho=2203.0)

E, ρ and growth need no solve: f = √(E/ρ)/g F(dimensions, ν), g the growth of all lengths. ln F, the Bryan factor and the
slopes of ln f are interpolated (`shell.interpolation`) between full solves; how well is judged by full solves that the
interpolant has not seen. All designs have the elements of the one in the middle of the ranges, so that the solver's own error
is smooth as well.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.interpolation import Exploration, SparsePolynomial
from shell.layout import Theory
from shell.modes import Mode, TheoryRangeWarning, solve_modes
from shell.quadrature import Array
from shell.resonator import Resonator

Range = tuple[float, float]
Builder = Callable[[Array], Resonator]
SOLVER_TOLERANCES = (1e-5, 1e-6, 1e-7)  # of the middle; a finer one where its elements are too coarse for other designs
COARSE = 2e-5  # error of a full solve from which they are
FINER = 3.0  # by which the threshold of the grid falls from round to round
WORTH = 1.5  # more solves in a round than this, without halving the error, mean that the grid has come to its end
SAFETY = 3.0  # stated errors over the largest seen on designs that the interpolant does not know
NOISE = 5e-10  # of a full solve, relative: its iteration and rounding
CORNERS = 16  # of the box that judge the interpolant, at most: it is worst there
MOST_SOLVES = 1000


@dataclass(frozen=True)
class Axis:
    """A number that varies between designs, in the unit of its name."""

    name: str
    low: float
    high: float

    @property
    def varies(self) -> bool:
        """Whether there is a range at all."""
        return self.high > self.low


@dataclass(frozen=True, eq=False)
class FamilyResult:
    """One mode of m designs: arrays (m,)."""

    frequency: Array  # Hz
    bryan_factor: Array  # precession of the standing wave per angle of rotation
    # by_nu, by_thickness: ∂ ln f/∂ν and ∂ ln f/∂ ln h of the whole profile; NaN unless the family was built with slopes
    by_nu: Array
    by_thickness: Array


@dataclass(frozen=True, eq=False)
class Errors:
    """Bounds of what interpolation adds to a full solve: relative of f, absolute of the others."""

    frequency: float
    bryan_factor: float
    by_nu: float
    by_thickness: float


@dataclass(frozen=True, eq=False)
class Family:
    """One mode of all designs within ranges; see `build_family`."""

    axes: tuple[Axis, ...]  # axes, nu: the ranges
    nu: Range
    harmonic: int  # harmonic, index, theory: which mode
    index: int
    theory: Theory
    # ln F, Bryan factor and slopes over the cube -1 ... 1 of the axes, and of ν where it varies
    polynomial: SparsePolynomial
    error: Errors
    theory_error: float  # relative error of f of the full solves themselves against the exact solution of the theory
    solver_tolerance: float  # what the full solve of the middle was asked for
    solves: int  # how many of them it took, those that judge it included

    def evaluate(
        self, values: ArrayLike, *, nu: ArrayLike, E: ArrayLike, rho: ArrayLike, growth: ArrayLike = 1.0
    ) -> FamilyResult:
        """Give the mode of m designs (m, axes), each for itself; `growth` is the factor of all lengths."""
        x = self._unit(values, nu)
        found = np.full((len(x), 4), np.nan)
        known = self.polynomial(x)
        found[:, : known.shape[1]] = known
        frequency = np.exp(found[:, 0]) * np.sqrt(np.asarray(E) / np.asarray(rho)) / np.asarray(growth)
        return FamilyResult(np.broadcast_to(frequency, len(x)), *found.T[1:])

    def _unit(self, values: ArrayLike, nu: ArrayLike) -> Array:
        """Return the points of the cube (m, coordinates)."""
        given = np.atleast_2d(np.asarray(values, dtype=float))
        if given.ndim != 2 or given.shape[1] != len(self.axes):
            raise ShellError(f"a family of {len(self.axes)} axes takes (designs, {len(self.axes)}), not {given.shape}.")
        columns = np.broadcast_arrays(*given.T, np.ravel(np.asarray(nu, dtype=float)))
        unit = []
        for axis, column in zip(_with_ratio(self.axes, self.nu), columns, strict=True):
            slack = 1e-9 * max(abs(axis.low), abs(axis.high))
            if not (column.min() >= axis.low - slack and column.max() <= axis.high + slack):
                raise ShellError(
                    f"the family holds for {axis.name} from {axis.low:g} to {axis.high:g}, not for {column.min():g} to {column.max():g}: build it with wider ranges."
                )
            if axis.varies:
                unit.append((2 * column - axis.low - axis.high) / (axis.high - axis.low))
        return np.stack(unit, axis=1) if unit else np.zeros((len(columns[0]), 0))


def build_family(
    build: Builder, axes: Sequence[Axis], *, nu: Range, harmonic: int = 2, index: int = 0, theory: Theory = "solid",
    slopes: bool = False, tolerance: float = 1e-6, most: int = MOST_SOLVES,
) -> Family:  # fmt: skip
    """Interpolate one mode over ranges of dimensions and of Poisson's ratio.

    `build`: (axes,) -> Resonator; `slopes`: ∂ ln f/∂ν and ∂ ln f/∂ ln h too; `tolerance` relative to the full solve; `most` full solves.
    """
    _check(axes, nu, tolerance, most)
    if theory == "rayleigh":
        raise ShellError("the theory of a family is solid or shell; Rayleigh's closed form needs none.")
    count = 0
    for solver_tolerance in SOLVER_TOLERANCES:
        solve = _Solve(build, tuple(axes), nu, slopes, most - count)
        solve.middle = _solve_middle(solve, harmonic, index, theory, solver_tolerance)
        polynomial, errors = _interpolate(solve, tolerance)
        count += solve.count
        if solve.theory_error <= COARSE:
            break
    if errors[0] > tolerance:
        raise ShellError(
            f"the interpolation error of the frequency within these ranges is {errors[0]:.2g} after {count} full solves; {tolerance:.2g} is asked."
            " Narrow the ranges, allow a larger error, or solve each design in full."
        )
    bounds = np.full(4, np.nan)
    bounds[: len(errors)] = errors
    return Family(
        tuple(axes), nu, harmonic, index, theory, polynomial, Errors(*bounds), solve.theory_error, solver_tolerance, count
    )  # fmt: skip


@dataclass
class _Solve:
    """Full solves of the designs at points of the cube, at `most`, with the elements of the one in its middle."""

    build: Builder
    axes: tuple[Axis, ...]
    nu: Range
    slopes: bool
    most: int
    middle: Mode | None = None
    theory_error: float = 0.0
    count: int = 0

    @property
    def dimensions(self) -> int:
        return sum(axis.varies for axis in _with_ratio(self.axes, self.nu))

    def at(self, unit: Array) -> tuple[Resonator, Elastic]:
        """Return a design."""
        rest = iter(unit)
        *values, nu = (
            (axis.low + axis.high) / 2 + (axis.high - axis.low) / 2 * float(next(rest)) if axis.varies else axis.low
            for axis in _with_ratio(self.axes, self.nu)
        )
        return self.build(np.array(values)), Elastic(1.0, nu, 1.0)

    def __call__(self, unit: Array) -> Array:
        """Return ln F, Bryan factor and slopes."""
        assert self.middle is not None
        mode = self.middle.solved_on(*self.at(unit))
        self.theory_error = max(self.theory_error, mode.relative_error_estimate)
        self.count += 1
        found = [np.log(mode.frequency), mode.bryan_factor]
        if self.slopes:
            found += [mode.sensitivities.nu, mode.sensitivities.thickness]
        return np.array(found)


def _solve_middle(solve: _Solve, harmonic: int, index: int, theory: Theory, tolerance: float) -> Mode:
    with warnings.catch_warnings():
        # at the usual tolerance a warning means that the design lies outside the theory
        warnings.simplefilter("error" if tolerance == SOLVER_TOLERANCES[0] else "ignore", TheoryRangeWarning)
        try:
            return solve_modes(*solve.at(np.zeros(solve.dimensions)), harmonic, index + 1, theory, tolerance)[index]
        except TheoryRangeWarning as warning:
            raise ShellError(str(warning)) from None


def _interpolate(solve: _Solve, tolerance: float) -> tuple[SparsePolynomial, Array]:
    """Refine until the stated errors hold the tolerance, or until more solves do not help or none are left."""
    grid = Exploration(solve, solve.dimensions)
    unseen = unseen_points(solve.dimensions)
    truth = np.array([solve(point) for point in unseen])
    threshold, before = tolerance, (np.inf, 1)
    if solve.theory_error > COARSE:
        return grid.polynomial(), np.array([np.inf])
    while True:
        within = grid.refine(threshold, solve.most - len(unseen))
        polynomial = grid.polynomial()
        errors = SAFETY * abs(polynomial(unseen) - truth).max(axis=0) + NOISE
        if errors[0] <= tolerance or not within:
            return polynomial, errors
        if len(polynomial.indices) > WORTH * before[1]:
            if errors[0] > before[0] / 2:
                return polynomial, errors
            before = (float(errors[0]), len(polynomial.indices))
        threshold /= FINER


def unseen_points(dimensions: int) -> Array:
    """Return points of the cube that judge an interpolant, the same every time: of the inside, the faces, and the corners or some of them."""
    rng = np.random.default_rng(20)
    inside = rng.uniform(-1, 1, (2 + dimensions // 2, dimensions))
    faces = np.clip(rng.uniform(-2, 2, (2 + dimensions, dimensions)), -1, 1)
    if 2**dimensions <= CORNERS:
        return np.vstack([inside, faces, list(product((-1.0, 1.0), repeat=dimensions))])
    return np.vstack([inside, faces, rng.choice([-1.0, 1.0], (CORNERS, dimensions))])


def _with_ratio(axes: Sequence[Axis], nu: Range) -> tuple[Axis, ...]:
    return (*axes, Axis("Poisson's ratio", *nu))


def _check(axes: Sequence[Axis], nu: Range, tolerance: float, most: int) -> None:
    for axis in axes:
        if not axis.low <= axis.high or not isfinite(axis.high - axis.low):
            raise ShellError(f"the range of {axis.name} must be finite and rising, not {axis.low:g} to {axis.high:g}.")
    if not -1 < nu[0] <= nu[1] < 0.5:
        raise ShellError(f"the range of Poisson's ratio must rise within -1 ... 0.5, not {nu[0]:g} to {nu[1]:g}.")
    if not 0 < tolerance < 1:
        raise ShellError(f"the tolerance is a relative error between 0 and 1, not {tolerance:g}.")
    if most < 1:
        raise ShellError(f"a family needs at least one full solve, not {most}.")
