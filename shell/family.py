"""A family of designs around one resonator, many of them at once: frequencies, each with an error estimate.

>>> family = build_family(hemisphere(15e-3, 0.9e-3), thickness=(0.8e-3, 1e-3), nu=(0.15, 0.19))
>>> result = family.evaluate(thickness=np.linspace(0.8e-3, 1e-3, 10_000), nu=0.17, E=72.7e9, rho=2203.0)

E, ρ and the radius need no solve, since f = √(E/ρ)/R F(h/R, shapes, ν) exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, isfinite, log, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.assembly import LEVELS, Level, ShellPart, Theory, build_system
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.frozen import FrozenShell, freeze
from shell.kernel import lame
from shell.meridian import Resonator
from shell.modes import solve_modes
from shell.profiles import Profiles, Shape
from shell.quadrature import Array
from shell.reduced import ReducedModel
from shell.training import Box, evaluate_many, train

Range = tuple[float, float]
MOST_SHAPES = 6  # the training takes every corner of the box
ROUNDING = 1e-11  # relative error of a full solve's iteration and rounding


@dataclass(frozen=True, eq=False)
class FamilyResult:
    """Frequencies (Hz) of m designs.

    relative_error_estimate : of each, against the full solve of the same theory at the same level.
    solved_in_full : designs whose estimate exceeded the tolerance.
    theory_error : the level's own relative error against the exact solution of the theory, an estimate.
    """

    frequency: Array
    relative_error_estimate: Array
    solved_in_full: NDArray[np.bool_]
    theory_error: float


@dataclass(frozen=True, eq=False)
class Cell:
    """A range of thickness with its own layout of elements and its own reduced model."""

    box: Box
    shell: FrozenShell
    model: ReducedModel


@dataclass(frozen=True, eq=False)
class Family:
    """Designs within ranges of thickness (m, at the nominal radius), ν and shapes; see `build_family`.

    cells : reduced models by rising thickness. Empty where every design is solved in full; `reason` then says why.
    """

    profiles: Profiles | None
    harmonic: int
    theory: Theory
    thickness: Range
    nu: Range
    amplitude: float
    shape_count: int
    own_thickness: float
    size: float
    tolerance: float
    theory_error: float
    cells: tuple[Cell, ...]
    reason: str = ""

    def evaluate(
        self,
        *,
        nu: ArrayLike,
        E: ArrayLike,
        rho: ArrayLike,
        thickness: ArrayLike | None = None,
        shapes: ArrayLike | None = None,
        radius: ArrayLike | None = None,
    ) -> FamilyResult:
        """Frequencies of m designs; arguments are numbers or arrays (m,). A design's result does not depend on the others.

        Parameters
        ----------
        nu, E, rho : Poisson's ratio, Young's modulus (Pa), density (kg/m³).
        thickness : m; default the nominal resonator's largest.
        shapes : amplitudes (m, shapes) or (shapes,); default 0.
        radius : the design's `Resonator.size`, m: every length but the thickness goes with it; default the nominal one.

        Raises
        ------
        ShellError
            When a design lies outside the ranges that the family was built for.
        """
        amplitudes = np.zeros(self.shape_count) if shapes is None else np.asarray(shapes, dtype=float)
        if amplitudes.ndim not in (1, 2) or amplitudes.shape[-1] != self.shape_count:
            raise ShellError(
                f"the family has {self.shape_count} shapes: give an array (designs, {self.shape_count}), not {amplitudes.shape}."
            )
        given = (
            self.own_thickness if thickness is None else thickness,
            nu,
            E,
            rho,
            self.size if radius is None else radius,
        )
        rows = np.zeros(amplitudes.shape[:-1] or 1)
        h, poisson, young, density, R, _ = np.broadcast_arrays(*(np.asarray(one, dtype=float) for one in given), rows)
        if h.ndim != 1:
            raise ShellError("the arguments of a family are numbers or arrays of one dimension.")
        amplitudes = np.broadcast_to(amplitudes, (len(h), self.shape_count))
        scale = R / self.size
        self._check(h / scale, poisson, amplitudes, np.minimum(np.minimum(young, density), R))
        eigenvalue, error, full = self._solve(h / scale, amplitudes, poisson)
        return FamilyResult(np.sqrt(eigenvalue * young / density) / (2 * pi * scale), error, full, self.theory_error)

    def _check(self, h: Array, nu: Array, amplitudes: Array, positive: Array) -> None:
        if not np.all(positive > 0):
            raise ShellError("Young's modulus, density and radius must be positive.")
        ranges = {
            "thickness (m, at the nominal radius)": (h, self.thickness),
            "Poisson's ratio": (nu, self.nu),
            "amplitude of a shape": (amplitudes, (-self.amplitude, self.amplitude)),
        }
        for name, (values, (low, high)) in ranges.items():
            slack = 1e-12 * abs(high)
            if not np.all((values >= low - slack) & (values <= high + slack)):
                raise ShellError(
                    f"the family holds for {name} from {low:g} to {high:g}, not for {np.min(values):g} to {np.max(values):g}: "
                    "build it with wider ranges."
                )

    def _solve(self, h: Array, amplitudes: Array, nu: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """ω² for E = ρ = 1 at the nominal radius, the relative error of ω, and whether it was solved in full."""
        eigenvalue, error, full = np.empty(len(h)), np.empty(len(h)), np.ones(len(h), dtype=bool)
        which = np.searchsorted([cell.box.thickness[0] for cell in self.cells[1:]], h, side="right")
        for k, cell in enumerate(self.cells):
            mine = np.flatnonzero(which == k)
            if len(mine):
                value, estimate = evaluate_many(
                    cell.model, h[mine], amplitudes[mine], nu[mine], cell.shell.plane_stress
                )
                eigenvalue[mine] = value * lame(np.ones(1), nu[mine], cell.shell.plane_stress)[1]
                error[mine] = estimate / 2
                full[mine] = ~(error[mine] <= self.tolerance)  # also where it is no number
        for one in np.flatnonzero(full):
            eigenvalue[one] = self._solve_in_full(int(which[one]), float(h[one]), amplitudes[one], float(nu[one]))
            error[one] = ROUNDING
        return eigenvalue, error, full

    def _solve_in_full(self, which: int, h: float, amplitudes: Array, nu: float) -> float:
        if self.cells:
            cell = self.cells[which]
            return cell.shell.solve(cell.box.profile(np.array([h]), amplitudes[None])[0], nu)[0]
        assert self.profiles is not None
        resonator = self.profiles.build(h, amplitudes)
        (mode,) = solve_modes(
            resonator, Elastic(1.0, nu, 1.0), self.harmonic, theory=self.theory, tolerance=self.tolerance
        )
        return (2 * pi * mode.frequency) ** 2


def build_family(
    resonator: Resonator,
    *,
    thickness: Range,
    nu: Range,
    shapes: Sequence[Shape] = (),
    amplitude: float = 0.1,
    harmonic: int = 2,
    theory: Theory = "solid",
    tolerance: float = 3e-5,
    theory_tolerance: float = 5e-5,
) -> Family:
    """Prepare the lowest mode of one harmonic for many designs: h(s) = thickness (base(s) + Σ a_k shape_k(s)).

    The elements and the training designs follow from the arguments alone. Resonators with solid parts (stem, kink, clamp
    of a solid) have no reduced model: their designs are all solved in full.

    Parameters
    ----------
    resonator : the nominal design; base is its own thickness over the largest value.
    thickness : range, m, at the nominal radius.
    nu : range of Poisson's ratio.
    shapes : changes of the profile: functions of the position (0 ... 1 of the arc length) or (position, value) pairs,
        linear between them.
    amplitude : every a_k lies within ±amplitude.
    harmonic : n; at least 2 where the resonator is free.
    theory : "solid" or "shell".
    tolerance : relative error of the frequency, against the full solve, above which a design is solved in full.
    theory_tolerance : error of the full solve itself, against the exact solution of the theory, that sets its level.

    Raises
    ------
    ShellError
        On ranges that make no sense, or when no reduced basis reaches the tolerance.
    """
    thickness, nu = _widen(thickness, 0.005 * thickness[1]), _widen(nu, 0.002)
    _check_request(resonator, thickness, nu, amplitude, len(shapes), harmonic, theory, min(tolerance, theory_tolerance))
    profiles = Profiles.of(resonator, shapes)
    own = max(value for _, value in resonator.thickness)
    request = (harmonic, theory, thickness, nu, amplitude, len(shapes), own, resonator.size, tolerance)
    parts = build_system(profiles.build(own, np.zeros(len(shapes))), harmonic, theory, LEVELS[theory][0]).groups
    if len(parts) > 1 or not isinstance(parts[0].place, ShellPart):
        reason = "solid parts (stem, kink or clamp) change their form with the thickness"
        if profiles.smooth:
            raise ShellError(
                f"{reason}, so every design is solved in full: give the shapes as (position, value) pairs."
            )
        return Family(profiles, *request, tolerance, (), reason)
    ratio = 1.6 if tolerance >= 1e-5 else 1.15  # of a cell: the narrower, the smaller its basis
    count = max(1, ceil(log(thickness[1] / thickness[0]) / log(ratio)))
    edges = [thickness[0], *np.geomspace(*thickness, count + 1)[1:-1].tolist(), thickness[1]]
    spans = list(pairwise(edges))
    level, theory_error = _choose_level(profiles, request, (spans[0], spans[-1]), theory_tolerance)
    frozen = [_freeze(profiles, request, span, level) for span in spans]
    cells = tuple(Cell(box, shell, train(shell, box, tolerance)) for shell, box in frozen)
    return Family(None, *request, theory_error, cells)


Request = tuple[int, Theory, Range, Range, float, int, float, float, float]


def _freeze(profiles: Profiles, request: Request, span: Range, level: Level) -> tuple[FrozenShell, Box]:
    """Lay out the elements for a range of thickness."""
    harmonic, theory, _, nu, amplitude, count, *_ = request
    base, shapes = profiles.at(np.linspace(0, 1, 2001))
    reach = amplitude * abs(shapes).sum(axis=0)
    if np.min(base - reach) <= 0.05 * np.max(base):
        raise ShellError("with these shapes and amplitudes the thickness comes near zero: make the amplitude smaller.")
    resonator = profiles.build(float(np.sqrt(span[0] * span[1])), np.zeros(count))
    thinnest, thickest = span[0] * float(np.min(base - reach)), span[1] * float(np.max(base + reach))
    shell = freeze(resonator, harmonic, theory, level, thinnest, thickest)
    return shell, Box(span, amplitude, nu, *profiles.at(shell.position))


def _choose_level(
    profiles: Profiles, request: Request, spans: tuple[Range, ...], tolerance: float
) -> tuple[Level, float]:
    """The lowest level within the tolerance of the next, judged at the thin and the thick end."""
    levels, dimensions = LEVELS[request[1]], request[5] + 2
    ends = np.array([[-1.0] * dimensions, [1.0] * dimensions, [0.0] * dimensions])

    def solve(level: Level) -> Array:
        found: list[float] = []
        for span in spans:
            shell, box = _freeze(profiles, request, span, level)
            thickness, amplitudes, nu = box.designs(ends)
            found += [shell.solve(h, float(x))[0] for h, x in zip(box.profile(thickness, amplitudes), nu, strict=True)]
        return np.sqrt(found)

    values = solve(levels[0])
    for level, finer in pairwise(levels):
        better = solve(finer)
        error = float(np.max(abs(values / better - 1)))
        if error <= tolerance:
            return level, error
        values = better
    raise ShellError(f"{tolerance:g} is out of reach of the discretisation: allow a larger tolerance.")


def _widen(span: Range, least: float) -> Range:
    """A range too narrow to learn from becomes ±least."""
    low, high = span
    middle = (low + high) / 2
    return (middle - least, middle + least) if 0 <= high - low < 2 * least else span


def _check_request(
    resonator: Resonator,
    thickness: Range,
    nu: Range,
    amplitude: float,
    count: int,
    harmonic: int,
    theory: str,
    tolerance: float,
) -> None:
    if theory not in LEVELS:
        raise ShellError(f"the theory of a family is one of {', '.join(LEVELS)}, not {theory!r}.")
    if harmonic != int(harmonic) or harmonic < 0 or (harmonic < 2 and resonator.support == "free"):
        raise ShellError(
            f"the harmonic of a family is a whole number, at least 2 for a free resonator, not {harmonic!r}."
        )
    if not 0 < thickness[0] <= thickness[1] or not isfinite(thickness[1]):
        raise ShellError(
            f"the range of thickness must be positive and rising, not {thickness[0]:g} to {thickness[1]:g} m."
        )
    if not -1 < nu[0] <= nu[1] < 0.5:
        raise ShellError(f"the range of Poisson's ratio must rise within -1 ... 0.5, not {nu[0]:g} to {nu[1]:g}.")
    if count > MOST_SHAPES:
        raise ShellError(f"a family has at most {MOST_SHAPES} shapes, not {count}: study them in groups.")
    if not 0 < amplitude < 1:
        raise ShellError(
            f"the amplitude of the shapes is a fraction of the thickness between 0 and 1, not {amplitude:g}."
        )
    if not 0 < tolerance < 1:
        raise ShellError(f"the tolerance is a relative error between 0 and 1, not {tolerance:g}.")
