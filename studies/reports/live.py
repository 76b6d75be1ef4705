"""A page that computes: frequency, spacing, Bryan factor and TCF over dimensions and temperature, by sliders, without a network.

The page carries the interpolant of a family (`shell.family`), Newton's form on a sparse grid, and Chebyshev series of what the
material adds over temperature, m(T) = ½ ln(E/ρ) − ln g, and of ν(T):

    ln f = ln F(dimensions, ν(T)) + m(T),      d ln f/dT = m' + ∂ ln F/∂ν ν'.
"""

import hashlib
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import Chebyshev

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.family import Axis, Family, build_family
from shell.interpolation import leja_points
from shell.layout import Theory
from shell.modes import nearest_mode
from studies.errors import UNUSABLE_INPUT
from studies.instrument.card import Instrument
from studies.resonator.law import unknown_slope
from studies.results import Sentence, row_of
from studies.results.page import Block, Embedded, fill_template
from studies.sweeps.case import Case
from studies.sweeps.expressions import Derived
from studies.sweeps.parameters import find_nominal, set_parameters

if TYPE_CHECKING:
    from shell.resonator import Resonator

DIMENSIONS = ("thickness_mm", "radius_mm", "height_mm", "stem.radius_mm", "bottom_thickness_mm", "cylinder_height_mm")
MOST_AXES = 3
RANGES = (0.05, 0.02)  # of a dimension to both sides; the narrower where the wider takes too many solves
TOLERANCE = 3e-5  # of the interpolated frequency
MOST_SOLVES = 300  # of a family
COLDEST, WARMEST = -40.0, 80.0  # °C
DEGREE = 32  # of the series over temperature
MARGIN = 1e-3  # of ν beyond its range over temperature


def live_blocks(
    instrument: Instrument, harmonic: int = 2, theory: Theory = "solid", names: Sequence[str] = (),
    derived: Sequence[Derived] = (),
) -> list[Block]:  # fmt: skip
    """Return sliders for keys of the card (main dimensions unless given) and temperature; one sentence where they cannot be had."""
    try:
        data = describe_family(instrument, harmonic, theory, names, derived)
    except UNUSABLE_INPUT as error:
        return [Sentence(f"No sliders: {error}", "note")]
    identity = "live-" + hashlib.sha256(repr(data).encode()).hexdigest()[:12]
    worst = max(one["error"] for one in data["modes"])
    caption = (
        f"Interpolated between full solves ({theory} theory) within the ranges of the sliders; f agrees within {1e6 * worst:.2g} ppm of"
        " a full solve there. Imperfection, electrodes and mount stress are not included."
    )
    return [Embedded(fill_template("live.html", id=identity, data=data), caption)]


def describe_family(
    instrument: Instrument, harmonic: int, theory: Theory, names: Sequence[str] = (), derived: Sequence[Derived] = ()
) -> dict[str, Any]:
    """Return what the page computes with: axes, the mode and the nearest other one, the material over temperature."""
    keys = list(names) or [f"resonator.{key}" for key in DIMENSIONS]
    nominal = [(key, _number(instrument, key)) for key in keys]
    varied = [(key, value) for key, value in nominal if value][:MOST_AXES]
    T = _temperatures(instrument)
    nu = instrument.material.value("poisson_ratio", np.linspace(*T, 33))
    at = instrument.reference_temperature
    case = Case(instrument, {})
    own = case.modes(harmonic, 1, theory, at)[0]
    other = nearest_mode(lambda n, count: case.modes(n, count, theory, at), own)
    for part in RANGES:
        axes = [Axis(key, value * (1 - part), value * (1 + part)) for key, value in varied]
        try:
            build = _builder(instrument, [key for key, _ in varied], derived)
            nus = float(nu.min()) - MARGIN, float(nu.max()) + MARGIN
            families = [
                build_family(
                    build, axes, nu=nus, harmonic=mode.harmonic, index=mode.index, theory=theory, tolerance=TOLERANCE, most=MOST_SOLVES
                )
                for mode in (own, other)
            ]  # fmt: skip
            break
        except UNUSABLE_INPUT:
            if part == RANGES[-1]:
                raise
    labels = [re.sub("[_.]", " ", key.removeprefix("resonator.").replace("_mm", "")) for key, _ in varied]
    return {
        "axes": [
            {"key": axis.name, "label": label, "low": axis.low, "high": axis.high, "value": value}
            for axis, label, (_, value) in zip(axes, labels, varied, strict=True)
        ],
        "nu": families[0].nu,
        "temperature": {"low": T[0], "high": T[1], "value": at, "zero": zero_Celsius},
        "points": leja_points()[: 1 + max(max(index) for one in families for index in one.polynomial.indices)].tolist(),
        "modes": [_spell(family) for family in families],
        "material": _series(instrument, T),
        "slope": not unknown_slope(instrument),
    }


def _number(instrument: Instrument, key: str) -> float | None:
    try:
        found = find_nominal(instrument, key, "card")
    except UNUSABLE_INPUT:
        return None
    return found if isinstance(found, float) else None


def _builder(instrument: Instrument, keys: Sequence[str], derived: Sequence[Derived]) -> "Callable[[Array], Resonator]":
    def build(values: Array) -> "Resonator":
        return set_parameters(instrument, dict(zip(keys, values.tolist(), strict=True)), derived).resonator

    return build


def _temperatures(instrument: Instrument) -> tuple[float, float]:
    """Return the ends of the temperature's slider, K: one temperature where the material's growth is not known."""
    material, at = instrument.material, instrument.reference_temperature
    if "expansion" not in material.properties or unknown_slope(instrument):
        return at, at
    low, high = max(material.lowest, COLDEST + zero_Celsius), min(material.highest, WARMEST + zero_Celsius)
    return min(low, at), max(high, at)


def _series(instrument: Instrument, T: tuple[float, float]) -> dict[str, list[float]]:
    """Return the Chebyshev coefficients of m(T) and ν(T)."""
    material, at = instrument.material, instrument.reference_temperature

    def m(x: Array) -> Array:
        grown = np.log(material.growth(x, at)) if T[0] < T[1] else 0.0
        return np.asarray(0.5 * np.log(material.value("youngs_modulus", x) / material.value("density", x)) - grown)

    def nu(x: Array) -> Array:
        return material.value("poisson_ratio", x)

    if T[0] == T[1]:
        return {"m": [float(m(np.array(at)))], "nu": [float(nu(np.array(at)))]}
    return {name: Chebyshev.interpolate(f, DEGREE, T).coef.tolist() for name, f in (("m", m), ("nu", nu))}


def _spell(family: Family) -> dict[str, Any]:
    polynomial = family.polynomial
    return row_of(family, "harmonic", "index") | {
        "error": float(family.error.frequency),
        "indices": [list(index) for index in polynomial.indices],
        "surpluses": polynomial.surpluses[:, :2].tolist(),
    }
