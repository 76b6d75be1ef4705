"""A family of designs around one resonator, many of them at once: frequencies, each with an error estimate.

>>> family = build_family(hemisphere(15e-3, 0.9e-3), thickness=(0.8e-3, 1e-3), nu=(0.15, 0.19))
>>> result = family.evaluate(thickness=np.linspace(0.8e-3, 1e-3, 10_000), nu=0.17, E=72.7e9, rho=2203.0)

E, ρ and the radius need no solve, since f = √(E/ρ)/R F(h/R, shapes, ν) exactly; a stem whose lengths do not go with the
radius adds its own size to the arguments of F.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, isfinite, log, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.condensed import UnfitSolids
from shell.designs import Box, Designs, Range
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.frozen import FrozenShell, freeze
from shell.interpolated import Solids, interpolate_solids
from shell.kernel import lame
from shell.levels import LEVELS, Level, Theory
from shell.modes import solve_modes
from shell.profiles import Profiles, Shape
from shell.quadrature import Array
from shell.reduced import ReducedModel
from shell.resonator import Resonator
from shell.training import evaluate_many, train

MOST_SHAPES = 6  # the training takes every corner of the box
ROUNDING = 1e-11  # relative error of the iteration and rounding of a full solve
CONDENSATION = 1e-9  # and of the condensed solid parts, at most


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

    solids: Solids
    model: ReducedModel

    @property
    def box(self) -> Box:
        """Its designs."""
        return self.solids.box

    @property
    def shell(self) -> FrozenShell:
        """Its elements."""
        return self.solids.shell


@dataclass(frozen=True, eq=False)
class Family:
    """Designs within ranges of thickness (m, at the nominal radius), ν, shapes and stem; see `build_family`.

    cells : reduced models by rising thickness. Empty where every design is solved in full; `reason` then says why.
    """

    profiles: Profiles | None
    harmonic: int
    theory: Theory
    thickness: Range
    nu: Range
    stem: Range
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
        stem: ArrayLike = 1.0,
    ) -> FamilyResult:
        """Frequencies of m designs; arguments are numbers or arrays (m,). A design's result does not depend on the others.

        Parameters
        ----------
        nu, E, rho : Poisson's ratio, Young's modulus (Pa), density (kg/m³).
        thickness : m; default the nominal resonator's largest.
        shapes : amplitudes (m, shapes) or (shapes,); default 0.
        radius : the design's `Resonator.size`, m: every length but the thickness goes with it; default the nominal one.
        stem : radius, ends and fillet of the stem over those that go with the radius: R_nominal/R where they stay.

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
            stem,
        )
        rows = np.zeros(amplitudes.shape[:-1] or 1)
        h, poisson, young, density, R, root, _ = np.broadcast_arrays(
            *(np.asarray(one, dtype=float) for one in given), rows
        )
        if h.ndim != 1:
            raise ShellError("the arguments of a family are numbers or arrays of one dimension.")
        amplitudes = np.broadcast_to(amplitudes, (len(h), self.shape_count))
        scale = R / self.size
        designs = Designs(h / scale, amplitudes, root, poisson)
        self._check(designs, np.minimum(np.minimum(young, density), R))
        eigenvalue, error, full = self._solve(designs)
        return FamilyResult(np.sqrt(eigenvalue * young / density) / (2 * pi * scale), error, full, self.theory_error)

    def _check(self, designs: Designs, positive: Array) -> None:
        if not np.all(positive > 0):
            raise ShellError("Young's modulus, density and radius must be positive.")
        ranges = {
            "thickness (m, at the nominal radius)": (designs.thickness, self.thickness),
            "Poisson's ratio": (designs.nu, self.nu),
            "amplitude of a shape": (designs.amplitudes, (-self.amplitude, self.amplitude)),
            "size of the stem": (designs.stem, self.stem),
        }
        for name, (values, (low, high)) in ranges.items():
            slack = 1e-12 * abs(high)
            if not np.all((values >= low - slack) & (values <= high + slack)):
                raise ShellError(
                    f"the family holds for {name} from {low:g} to {high:g}, not for {np.min(values):g} to {np.max(values):g}: "
                    "build it with wider ranges."
                )

    def _solve(self, designs: Designs) -> tuple[Array, Array, NDArray[np.bool_]]:
        """ω² for E = ρ = 1 at the nominal radius, the relative error of ω, and whether it was solved in full."""
        count = len(designs)
        eigenvalue, error, full = np.empty(count), np.empty(count), np.ones(count, dtype=bool)
        which = np.searchsorted([cell.box.thickness[0] for cell in self.cells[1:]], designs.thickness, side="right")
        for k, cell in enumerate(self.cells):
            mine = np.flatnonzero(which == k)
            if len(mine):
                own = designs if len(mine) == count else designs.part(mine)
                value, estimate = evaluate_many(cell.model, own, cell.shell.plane_stress)
                eigenvalue[mine] = value * lame(np.ones(1), own.nu, cell.shell.plane_stress)[1]
                error[mine] = estimate / 2
                full[mine] = ~(error[mine] <= self.tolerance)  # also where it is no number
        for one in np.flatnonzero(full):
            eigenvalue[one] = self._solve_in_full(int(which[one]), designs.part(slice(one, one + 1)))
            error[one] = CONDENSATION if self.cells and self.cells[0].shell.parts else ROUNDING
        return eigenvalue, error, full

    def _solve_in_full(self, which: int, design: Designs) -> float:
        if self.cells:
            return self.cells[which].solids.solve(design, 0)[0]
        assert self.profiles is not None
        h, nu, stem = (float(values[0]) for values in (design.thickness, design.nu, design.stem))
        resonator = self.profiles.build(h, design.amplitudes[0], stem)
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
    stem: Range = (1.0, 1.0),
    harmonic: int = 2,
    theory: Theory = "solid",
    tolerance: float = 3e-5,
    theory_tolerance: float = 5e-5,
) -> Family:
    """Prepare the lowest mode of one harmonic for many designs: h(s) = thickness (base(s) + Σ a_k shape_k(s)).

    The elements and the training designs follow from the arguments alone. Solid parts (stem, corner, clamped edge) take
    part with polynomials; where these cannot hold them within the ranges, every design is solved in full.

    Parameters
    ----------
    resonator : the nominal design; base is its own thickness over the largest value.
    thickness : range, m, at the nominal radius.
    nu : range of Poisson's ratio.
    shapes : changes of the profile: functions of the position (0 ... 1 of the arc length) or (position, value) pairs,
        linear between them; two pairs at one position are a step.
    amplitude : every a_k lies within ±amplitude.
    stem : range of the stem's lengths over those that go with the radius.
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
    _check_request(resonator, thickness, nu, stem, amplitude, len(shapes), harmonic, theory)
    if not 0 < min(tolerance, theory_tolerance) < 1 > max(tolerance, theory_tolerance):
        raise ShellError(
            f"the tolerance is a relative error between 0 and 1, not {tolerance:g} or {theory_tolerance:g}."
        )
    profiles = Profiles.of(resonator, shapes)
    own = max(value for _, value in resonator.thickness)
    request = Request(profiles, harmonic, theory, nu, stem, amplitude)
    given = (harmonic, theory, thickness, nu, stem, amplitude, len(shapes), own, resonator.size, tolerance)
    ratio = 1.6 if tolerance >= 1e-5 else 1.15  # of a cell: the narrower, the smaller its basis
    count = max(1, ceil(log(thickness[1] / thickness[0]) / log(ratio)))
    edges = [thickness[0], *np.geomspace(*thickness, count + 1)[1:-1].tolist(), thickness[1]]
    spans = list(pairwise(edges))
    try:
        level, theory_error = _choose_level(request, [spans[0], spans[-1]] if count > 1 else spans, theory_tolerance)
        cells = tuple(_fill_cell(request, span, level, tolerance) for span in spans)
    except UnfitSolids as error:
        return Family(profiles, *given, tolerance, (), str(error))
    return Family(None, *given, theory_error, cells)


@dataclass(frozen=True, eq=False)
class Request:
    """What a family was asked for, beside its thickness and tolerances."""

    profiles: Profiles
    harmonic: int
    theory: Theory
    nu: Range
    stem: Range
    amplitude: float


def _fill_cell(request: Request, span: Range, level: Level, tolerance: float) -> Cell:
    shell, box = _freeze(request, span, level)
    solids = interpolate_solids(shell, box, request.profiles, tolerance)
    return Cell(solids, train(solids, tolerance))


def _freeze(request: Request, span: Range, level: Level) -> tuple[FrozenShell, Box]:
    """Lay out the elements for a range of thickness."""
    profiles = request.profiles

    def bounds(position: Array) -> tuple[Array, Array]:
        base, shapes = profiles.at(position)
        reach = request.amplitude * abs(shapes).sum(axis=0)
        return span[0] * (base - reach), span[1] * (base + reach)

    thin, thick = bounds(np.linspace(0, 1, 2001))
    if np.min(thin) <= 0.05 * span[0] / span[1] * np.max(thick):
        raise ShellError("with these shapes and amplitudes the thickness comes near zero: make the amplitude smaller.")
    resonator = profiles.build(float(np.sqrt(span[0] * span[1])), np.zeros(len(profiles.shapes)))
    shell = freeze(resonator, request.harmonic, request.theory, level, bounds)
    if shell.parts and request.harmonic < 2:
        raise UnfitSolids("families of resonators with solid parts are for harmonics from 2.")
    return shell, Box(span, request.amplitude, request.stem, request.nu, *profiles.at(shell.position))


def _choose_level(request: Request, spans: list[Range], tolerance: float) -> tuple[Level, float]:
    """The lowest level within the tolerance of the next, judged at the thin and the thick end."""
    levels = LEVELS[request.theory]

    def solve(level: Level) -> Array:
        found: list[float] = []
        for span in spans:
            shell, box = _freeze(request, span, level)
            designs = box.designs(np.outer([-1.0, 1.0, 0.0], np.ones(box.dimensions)))
            solids = Solids(shell, box, request.profiles)
            found += [solids.solve(designs, k)[0] for k in range(len(designs))]
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
    stem: Range,
    amplitude: float,
    count: int,
    harmonic: int,
    theory: str,
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
    if not 0 < stem[0] <= 1 <= stem[1] or not isfinite(stem[1]):
        raise ShellError(f"the range of the stem's size must hold 1 and be positive, not {stem[0]:g} to {stem[1]:g}.")
    if stem != (1.0, 1.0) and resonator.stem is None:
        raise ShellError("a range of the stem's size needs a resonator with a stem.")
    if count > MOST_SHAPES:
        raise ShellError(f"a family has at most {MOST_SHAPES} shapes, not {count}: study them in groups.")
    if not 0 < amplitude < 1:
        raise ShellError(
            f"the amplitude of the shapes is a fraction of the thickness between 0 and 1, not {amplitude:g}."
        )
