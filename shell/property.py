"""One property of a material over temperature: a published form, its deviation, and the prior of that deviation.

A published law is a local statement. What it may be wrong by, about a reference temperature T_r with x = T - T_r, is

    p(T) = p_law(T) exp(a + b x + ½ c x²)   (moduli, density, conductivity, heat capacity: log_value, log_slope, log_curvature)
    p(T) = p_law(T) + a + b x + ½ c x²      (Poisson's ratio, expansion: value, slope, curvature),

and a, b, c have a joint prior: stated uncertainties of the form's numbers move all three; what is unsettled is added to each.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shell.constants import zero_Celsius
from shell.quadrature import Array

ROOM = 20.0 + zero_Celsius
PROPERTIES = {
    "shear_modulus": "Pa", "youngs_modulus": "Pa", "poisson_ratio": "1", "density": "kg/m³",
    "expansion": "1/K", "conductivity": "W/(m K)", "heat_capacity": "J/(kg K)",
}  # fmt: skip
SIGNED = ("poisson_ratio", "expansion")  # properties whose deviation is a difference, not a factor
STEP = 5.0  # K, of the differences that give slope and curvature of a form


def _constant(T: Array, p: Mapping[str, Any]) -> Array:
    return np.full_like(T, p["value"])


def _linear(T: Array, p: Mapping[str, Any]) -> Array:
    return np.asarray(p["value"] * (1 + p["slope"] * (T - zero_Celsius - p["at_degC"])))


def _parabola(T: Array, p: Mapping[str, Any]) -> Array:
    distance = (T - zero_Celsius - p["maximum_degC"]) / (p["at_degC"] - p["maximum_degC"])
    return np.asarray(p["value"] * (1 + p["rise"] * (1 - distance**2)))


def _table(T: Array, p: Mapping[str, Any]) -> Array:
    from scipy.interpolate import PchipInterpolator

    at = p["temperature_degC"]
    # The law's range is checked in kelvin; rounding on the way back must not lead out of the table.
    values = PchipInterpolator(at, p["values"])(np.clip(T - zero_Celsius, at[0], at[-1]))
    return np.asarray(p.get("value", 1.0) * values)


FORMS: dict[str, tuple[Callable[[Array, Mapping[str, Any]], Array], tuple[str, ...]]] = {
    # form: (function of temperature, the numbers that it needs)
    "constant": (_constant, ("value",)),
    "linear": (_linear, ("value", "at_degC", "slope")),
    "parabola": (_parabola, ("value", "at_degC", "rise", "maximum_degC")),
    "table": (_table, ("temperature_degC", "values")),
}


LISTS = ("temperature_degC", "values")  # numbers of a form that are lists


def coefficient_names(name: str) -> tuple[str, str, str]:
    """Return the names of a, b and c for one property."""
    if name in SIGNED:
        return "value", "slope_per_K", "curvature_per_K2"
    return "log_value", "log_slope_per_K", "log_curvature_per_K2"


def powers(x: Array) -> tuple[Array, Array, Array]:
    """Return 1, x and ½ x²: what a, b and c multiply."""
    return np.ones_like(x), x, x**2 / 2


@dataclass(frozen=True)
class Property:
    """One property over temperature."""

    form: str  # form, numbers: the published form and its numbers, in the units of their names
    numbers: Mapping[str, Any]
    uncertainty: Mapping[str, float] = field(default_factory=dict)  # standard uncertainty of any of the numbers
    source: str = ""  # where they come from
    relative: bool = True  # whether the deviation is a factor
    # standard deviations of a, b, c beyond what `uncertainty` makes of them
    unsettled: tuple[float, float, float] = (0.0, 0.0, 0.0)
    deviation: tuple[float, float, float] = (0.0, 0.0, 0.0)  # a, b, c
    reference: float = ROOM  # K, temperature about which the deviation counts

    def __call__(self, temperature: ArrayLike) -> Array:
        """Evaluate the form with its deviation at temperatures in kelvin."""
        T = np.asarray(temperature, dtype=float)
        values = FORMS[self.form][0](T, self.numbers)
        if not any(self.deviation):
            return values
        moved = sum(c * power for c, power in zip(self.deviation, powers(T - self.reference), strict=True))
        return np.asarray(values * np.exp(moved) if self.relative else values + moved)

    def scaled(self, factor: float) -> "Property":
        """Return the property times a factor, its relative shape over temperature unchanged."""
        shifted = {**self.uncertainty}
        if "value" in shifted:
            shifted["value"] *= abs(factor)
        value = self.numbers.get("value", 1.0) * factor
        return replace(self, numbers={**self.numbers, "value": value}, uncertainty=shifted)

    @property
    def covariance(self) -> Array:
        """Prior covariance (3, 3) of a, b and c: first order in the uncertain numbers, plus what is unsettled."""
        found = np.diag(np.square(self.unsettled))
        for name, sd in self.uncertainty.items():
            number = self.numbers[name]
            moved = (self._expand(name, number + sd) - self._expand(name, number - sd)) / 2
            found += np.outer(moved, moved)
        return found

    def _expand(self, name: str, value: float) -> Array:
        """Value, slope and curvature of the form (of its logarithm) at the reference with one number changed."""
        T = self.reference + STEP * np.array([-1.0, 0.0, 1.0])
        low, middle, high = FORMS[self.form][0](T, {**self.numbers, name: value})
        if self.relative:
            low, middle, high = np.log([low, middle, high])
        return np.array([middle, (high - low) / (2 * STEP), (low + high - 2 * middle) / STEP**2])
