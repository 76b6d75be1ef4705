"""A page that computes: a mode, its neighbours, TCF, Q, split and picture over dimensions and temperature, by sliders, offline.

The page carries the interpolant of a family (`shell.family`), Newton's form on a sparse grid, and Chebyshev series of what the
material adds over temperature, m(T) = ½ ln(E/ρ) − ln g, and of ν(T):

    ln f = ln F(dimensions, ν(T)) + m(T) + s(dimensions) ε(T),      d ln f/dT = m' + ∂ ln F/∂ν ν' + s ε'.

Loss, split, the stress s by the base and outline have an interpolant of their own (`studies.reports.live_fields`).
"""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.family import Axis, Family, Range, build_family
from shell.interpolation import leja_points
from shell.layout import Theory
from shell.modes import Mode, nearest_mode
from shell.resonator import Resonator
from studies.errors import UNUSABLE_INPUT
from studies.instrument.card import Instrument
from studies.progress import tell
from studies.reports.live_fields import explore_fields
from studies.resonator.law import unknown_slope
from studies.results import Sentence, row_of
from studies.results.page import Block, Embedded, fill_template
from studies.sweeps.case import Case
from studies.sweeps.expressions import Derived
from studies.sweeps.parameters import find_nominal, set_parameters

DIMENSIONS = ("thickness_mm", "radius_mm", "height_mm", "stem.radius_mm", "bottom_thickness_mm", "cylinder_height_mm")
MOST_AXES = 3
RANGES = (0.05, 0.02)  # of a dimension to both sides; the narrower where the wider takes too many solves
TOLERANCE, ROUGH = 3e-5, 1e-3  # of the interpolated frequency, and of those of other modes
HIGHEST = 4  # harmonic among which the nearest modes are sought
MOST_SOLVES = 300  # of a family
COLDEST, WARMEST = -40.0, 80.0  # °C
DEGREE = 32  # of the series over temperature
MARGIN = 1e-3  # of ν beyond its range over temperature
ROUNDING = 1e-9  # the least error that is told


def live_blocks(
    instrument: Instrument, harmonic: int = 2, theory: Theory = "solid", names: Sequence[str] = (),
    derived: Sequence[Derived] = (), anchor: bool = False,
) -> list[Block]:  # fmt: skip
    """Return sliders for keys of the card (main dimensions unless given) and temperature, or a sentence why not; they move the view above."""
    try:
        data, missing = describe_live(instrument, harmonic, theory, names, derived, anchor)
    except UNUSABLE_INPUT as error:
        return [Sentence(f"No sliders: {error}", "note")]
    identity = "live-" + hashlib.sha256(repr(data).encode()).hexdigest()[:12]
    f, *others = (one["error"] for one in data["modes"])
    words = {
        "loss": "1/Q to {:.2g} %",
        "wave": "the split to {:.2g} % of its largest value",
        "base": "the part of f by the stress of the base to {:.2g} % of f",
        "outline": "the displacements shown to {:.2g} % of the largest",
    }
    errors = [f"f to {1e6 * f:.2g} ppm", f"the other modes to {100 * max(others, default=0.0):.2g} %"]
    errors += [words[name].format(100 * max(error, ROUNDING)) for name, error in data["fields"]["errors"].items()]
    caption = (
        f"Interpolated between full solves ({theory} theory, one layout of elements) and checked against others within the sliders' ranges: {', '.join(errors)}."
        " f: without imperfection and electrodes. The picture shows the reference temperature. Other modes: of n = 0 …"
        f" {HIGHEST}, those nearest to f at the card's values or at an end of a slider. {' '.join(missing)}"
    )
    return [Embedded(fill_template("live.html", id=identity, data=data), caption)]


def describe_live(
    instrument: Instrument, harmonic: int, theory: Theory, names: Sequence[str] = (), derived: Sequence[Derived] = (),
    anchor: bool = False,
) -> tuple[dict[str, Any], tuple[str, ...]]:  # fmt: skip
    """Return what the page computes with (axes, modes, material, loss, split and outline), and what it does not have."""
    keys = list(names) or [f"resonator.{key}" for key in DIMENSIONS]
    nominal = [(key, _number(instrument, key)) for key in keys]
    varied = [(key, value) for key, value in nominal if value][:MOST_AXES]
    T = _temperatures(instrument)
    for part in RANGES:
        axes = [Axis(key, *sorted((value * (1 - part), value * (1 + part)))) for key, value in varied]
        try:
            designs = Designs(instrument, tuple(axes), tuple(derived))
            families, lost = _families(designs, harmonic, theory, T)
            break
        except UNUSABLE_INPUT:
            if part == RANGES[-1]:
                raise
    tell("sliders", 1 - 1 / (len(families) + len(lost) + 1))
    fields = explore_fields(designs.at_point, len(axes), harmonic, theory, T, instrument, anchor)
    labels = [re.sub("[_.]", " ", key.removeprefix("resonator.").replace("_mm", "")) for key, _ in varied]
    indices = [index for one in (*(one.polynomial for one in families), fields.polynomial) for index in one.indices]
    data = {
        "axes": [
            {"key": axis.name, "label": label, "low": axis.low, "high": axis.high, "value": value}
            for axis, label, (_, value) in zip(axes, labels, varied, strict=True)
        ],
        "nu": families[0].nu,
        "temperature": {"low": T[0], "high": T[1], "value": instrument.reference_temperature, "zero": zero_Celsius},
        "points": leja_points()[: 1 + max((j for index in indices for j in index), default=0)].tolist(),
        "modes": [_spell(family) for family in families],
        "material": _series(instrument, T),
        "slope": not unknown_slope(instrument),
        "fields": fields.spell(),
    }
    return data, (*fields.missing, *lost)


@dataclass(frozen=True)
class Designs:
    """The designs within the ranges of the sliders."""

    instrument: Instrument
    axes: tuple[Axis, ...]
    derived: tuple[Derived, ...]

    def make(self, values: Array) -> Instrument:
        """Return the instrument of values of the axes."""
        named = {axis.name: float(value) for axis, value in zip(self.axes, values, strict=True)}
        return set_parameters(self.instrument, named, self.derived)

    def at_point(self, unit: Array) -> Instrument:
        """Return the instrument at a point of the cube -1 ... 1."""
        low, high = np.array([(axis.low, axis.high) for axis in self.axes]).reshape(-1, 2).T
        return self.make((low + high + (high - low) * unit) / 2)


def _families(designs: Designs, harmonic: int, theory: Theory, T: Range) -> tuple[list[Family], list[str]]:
    """Return the families of the lowest mode of a harmonic and, roughly, of those that come nearest to it, and which are left out."""
    nu = designs.instrument.material.value("poisson_ratio", np.linspace(*T, 33))
    ends = [end for unit in np.eye(len(designs.axes)) for end in (unit, -unit)]
    near: dict[tuple[int, int], None] = {}
    for point in (np.zeros(len(designs.axes)), *ends):
        case, at = Case(designs.at_point(point), {}), designs.instrument.reference_temperature

        def solve(n: int, count: int, case: Case = case) -> Sequence[Mode]:
            return case.modes(n, count, theory, at, TOLERANCE if n == harmonic else ROUGH)  # noqa: B023 of this turn

        own = solve(harmonic, 1)[0]
        other = nearest_mode(solve, own, range(HIGHEST + 1))
        near[other.harmonic, other.index] = None
    span = float(nu.min()) - MARGIN, float(nu.max()) + MARGIN

    def build(n: int, index: int, tolerance: float) -> Family:
        def resonator(values: Array) -> Resonator:
            return designs.make(values).resonator

        return build_family(
            resonator, designs.axes, nu=span, harmonic=n, index=index, theory=theory, tolerance=tolerance,
            most=MOST_SOLVES,
        )  # fmt: skip

    tell("sliders", 0.0)
    families, lost = [build(harmonic, 0, TOLERANCE)], []
    for number, (n, index) in enumerate(near, 1):
        tell("sliders", number / (len(near) + 2))
        try:
            families.append(build(n, index, ROUGH))
        except UNUSABLE_INPUT as error:
            lost.append(f"n = {n}, index {index} is left out: {error}")
    return families, lost


def _number(instrument: Instrument, key: str) -> float | None:
    try:
        found = find_nominal(instrument, key, "card")
    except UNUSABLE_INPUT:
        return None
    return found if isinstance(found, float) else None


def _temperatures(instrument: Instrument) -> tuple[float, float]:
    """Return the ends of the temperature's slider, K: one temperature where the material's growth is not known."""
    material, at = instrument.material, instrument.reference_temperature
    if "expansion" not in material.properties or unknown_slope(instrument):
        return at, at
    low, high = max(material.lowest, COLDEST + zero_Celsius), min(material.highest, WARMEST + zero_Celsius)
    return min(low, at), max(high, at)


def _series(instrument: Instrument, T: tuple[float, float]) -> dict[str, list[float]]:
    """Return the Chebyshev coefficients of m(T), ν(T) and the strain ε(T) of the base."""
    material, at = instrument.material, instrument.reference_temperature

    def m(x: Array) -> Array:
        grown = np.log(material.growth(x, at)) if T[0] < T[1] else 0.0
        return np.asarray(0.5 * np.log(material.value("youngs_modulus", x) / material.value("density", x)) - grown)

    mount = instrument.part("mount")

    def base(x: Array) -> Array:
        return np.zeros_like(x) if mount is None else np.asarray(mount.strain(material, x))

    def nu(x: Array) -> Array:
        return material.value("poisson_ratio", x)

    laws = {"m": m, "nu": nu, "base": base}
    if T[0] == T[1]:
        return {name: [float(f(np.array(at)))] for name, f in laws.items()}
    return {name: Chebyshev.interpolate(f, DEGREE, T).coef.tolist() for name, f in laws.items()}


def _spell(family: Family) -> dict[str, Any]:
    polynomial = family.polynomial
    return row_of(family, "harmonic", "index") | {
        "error": float(family.error.frequency),
        "indices": [list(index) for index in polynomial.indices],
        "surpluses": polynomial.surpluses[:, :2].tolist(),
    }
