"""One law of one material over temperature (K): properties, uncertainty, and what no source states; nothing is extrapolated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.constants import zero_Celsius
from shell.crystal import Crystal
from shell.elastic import Elastic
from shell.errors import ShellError, nearest
from shell.property import PROPERTIES, ROOM, SIGNED, Property, coefficient_names
from shell.quadrature import Array, gauss

if TYPE_CHECKING:
    from shell.cubic import Cubic

ELASTIC = ("shear_modulus", "youngs_modulus", "poisson_ratio")


@dataclass(frozen=True, eq=False)
class Prior:
    """Uncertainty of a law: coefficients of its deviation, jointly Gaussian about zero."""

    # (k,) such as `shear_modulus.log_slope_per_K`; x counts from the material's reference temperature
    names: tuple[str, ...]
    sd: Array  # (k,) array
    correlation: Array  # (k, k) array

    @property
    def covariance(self) -> Array:
        """Covariance of the coefficients, (k, k)."""
        return np.asarray(self.correlation * np.outer(self.sd, self.sd))


@dataclass(frozen=True)
class Material:
    """One law of one material: properties over a range of temperature, and where they come from."""

    name: str
    law: str
    # lowest, highest: K, range of the law.
    lowest: float
    highest: float
    properties: Mapping[str, Property]
    source: str = ""
    note: str = ""
    reference: float = ROOM  # K, temperature about which the deviations of the law and their prior count
    constant: tuple[str, ...] = ()  # properties given at one temperature only: nobody says how they change with it
    crystal: Crystal | None = None  # whose mean over all directions the elastic properties are
    unchecked: tuple[str, ...] = ()  # what could not be compared with an open source, a property, or elastic constants
    known: Prior | None = None  # what is known of it instead of by its law

    @property
    def caveats(self) -> tuple[str, ...]:
        """What every answer with this material must say: a modulus taken as constant, a crystal, values not checked."""
        flat = f"No source states how {spell(self.constant)} of {self.name} changes with temperature: taken as constant."  # fmt: skip
        known = not self.constant or "expansion" in self.constant  # else given in the card, which says so itself
        caveats = (() if known else (flat,)) + ((f"{self.name}: {self.crystal.note}",) if self.crystal else ())
        doubt = f"{self.name}: {spell(self.unchecked)} not checked against a source; the uncertainty is wide."
        return (*caveats, doubt) if self.unchecked else caveats

    @property
    def lacks(self) -> list[str]:
        """Properties that no source states, and that do not follow from those stated."""
        stated = [p for p in ELASTIC if p in self.properties]
        elastic = [] if len(stated) > 1 else ["poisson_ratio" if "poisson_ratio" not in stated else "youngs_modulus"]
        return elastic + [p for p in PROPERTIES if p not in ELASTIC and p not in self.properties]

    def cubic(self, temperature: float) -> "Cubic | None":
        """The crystal at a temperature (K), where its modes can be solved as one: cubic, [001] along the axis."""
        if self.crystal is None or self.crystal.axis != "[001]":
            return None
        from shell.cubic import Cubic

        C = self.crystal.stiffness(temperature - zero_Celsius - self.crystal.at)
        return Cubic(float(C[0, 0]), float(C[0, 1]), float(C[3, 3]), float(self.value("density", temperature)))

    def value(self, name: str, temperature: ArrayLike) -> NDArray[np.float64]:
        """Return a property at temperatures in kelvin; E, G and nu are derived from the two that are stated."""
        T = self.check(temperature)
        if name in self.properties:
            found = self.properties[name](T)
            if name == "density" and "expansion" in self.properties:  # lengths grow from where it is stated
                found = found * self.growth(T, self.properties[name].numbers["at_degC"] + zero_Celsius) ** -3
            return found
        if name not in ELASTIC:
            raise ShellError(self._lack(name))
        for other in ELASTIC:
            if other != name and other not in self.properties:
                raise ShellError(self._lack(other))
        if name == "youngs_modulus":
            return 2 * self.properties["shear_modulus"](T) * (1 + self.properties["poisson_ratio"](T))
        if name == "shear_modulus":
            return self.properties["youngs_modulus"](T) / (2 * (1 + self.properties["poisson_ratio"](T)))
        return self.properties["youngs_modulus"](T) / (2 * self.properties["shear_modulus"](T)) - 1

    def slope(self, name: str, temperature: ArrayLike) -> Array:
        """Return the slope of a property per kelvin, by a central difference that stays inside the range."""
        step = 0.05
        middle = np.clip(self.check(temperature), self.lowest + step, self.highest - step)
        return np.asarray((self.value(name, middle + step) - self.value(name, middle - step)) / (2 * step))

    def log_slope(self, name: str, temperature: ArrayLike) -> Array:
        """Return the relative slope of a property, d ln p/dT in 1/K."""
        return np.asarray(self.slope(name, temperature) / self.value(name, temperature))

    def elastic(self, temperature: float) -> Elastic:
        """Return E, nu and rho at one temperature in kelvin."""
        E, nu, rho = (float(self.value(p, temperature)) for p in ("youngs_modulus", "poisson_ratio", "density"))
        return Elastic(E, nu, rho)

    def growth(self, temperature: ArrayLike, reference: float) -> NDArray[np.float64]:
        """Return the length at a temperature over the length at the reference, exp(∫ alpha dT)."""
        if "expansion" not in self.properties:
            raise ShellError(self._lack("expansion"))
        T = self.check(temperature)
        self.check(reference)
        x, w = gauss(16)
        half = (T - reference) / 2
        nodes = reference + half[..., None] * (1 + x)
        return np.asarray(np.exp(half * (self.properties["expansion"](nodes) @ w)))

    def check(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """Return the temperatures, or raise ShellError when one lies outside the law's range."""
        T = np.asarray(temperature, dtype=float)
        outside = (T < self.lowest - 1e-9) | (T > self.highest + 1e-9) | ~np.isfinite(T)
        if outside.any():
            worst = float(T[outside][0]) - zero_Celsius
            low, high = self.lowest - zero_Celsius, self.highest - zero_Celsius
            raise ShellError(
                f"{worst:g} °C is outside the range of {self.name}, law '{self.law}' ({low:g} to {high:g} °C);"
                " choose another temperature or a law that covers it ('hrg materials' lists them)."
            )
        return T

    @cached_property
    def prior(self) -> Prior:
        """What the law leaves open, or what is known instead; coefficients that nothing makes uncertain are not in it."""
        if self.known is not None:
            return self.known
        names = [f"{p}.{one}" for p in self.properties for one in coefficient_names(p)]
        covariance = np.zeros((len(names), len(names)))
        for k, found in enumerate(self.properties.values()):
            covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = found.covariance
        open_ones = np.flatnonzero(np.diag(covariance) > 0)
        sd = np.sqrt(np.diag(covariance)[open_ones])
        correlation = covariance[np.ix_(open_ones, open_ones)] / np.outer(sd, sd)
        return Prior(tuple(names[k] for k in open_ones), sd, correlation)

    def with_coefficients(self, values: Mapping[str, float]) -> "Material":
        """Return the same material with coefficients of its deviation set, for example `expansion.value` in 1/K."""
        changed: dict[str, list[float]] = {}
        for key, value in values.items():
            name, _, coefficient = key.partition(".")
            if name not in self.properties or coefficient not in coefficient_names(name):
                known = [f"{p}.{one}" for p in self.properties for one in coefficient_names(p)]
                raise ShellError(f"material '{self.name}' has no coefficient '{key}'{nearest(key, known)}")
            held = changed.setdefault(name, list(self.properties[name].deviation))
            held[coefficient_names(name).index(coefficient)] = float(value)
        moved = {
            name: replace(self.properties[name], deviation=(a, b, c), reference=self.reference)
            for name, (a, b, c) in changed.items()
        }
        span = [self.lowest - zero_Celsius, self.highest - zero_Celsius]
        for name, found in moved.items():
            check_sign(f"material '{self.name}', coefficients of {name}", name, found, span)
        constant = tuple(name for name in self.constant if name not in moved)
        return replace(self, properties={**self.properties, **moved}, constant=constant)

    def coefficient(self, key: str) -> float:
        """Return one coefficient of the deviation, for example `expansion.value`."""
        name, _, coefficient = key.partition(".")
        return self.properties[name].deviation[coefficient_names(name).index(coefficient)]

    def rescaled(self, reference: float, **given: float) -> "Material":
        """Return the material with `given` values (`youngs_modulus`, `poisson_ratio`, `density`) at the reference, from which deviations count."""
        target = dict(given)
        properties = dict(self.properties)
        stated = [name for name in ELASTIC if name in properties]
        if "youngs_modulus" in target and "youngs_modulus" not in stated and "shear_modulus" in stated:
            nu = target.get("poisson_ratio")
            nu = float(self.value("poisson_ratio", reference)) if nu is None else nu
            target["shear_modulus"] = target.pop("youngs_modulus") / (2 * (1 + nu))
        elif "poisson_ratio" in target and "shear_modulus" in stated:
            E = float(self.value("youngs_modulus", reference))
            target["shear_modulus"] = E / (2 * (1 + target["poisson_ratio"]))
        for name, value in target.items():
            if name in properties:
                now = float(self.value(name, reference))
                properties[name] = properties[name].scaled(value / now)
            else:
                numbers = {"value": value, "at_degC": reference - zero_Celsius}
                properties[name] = Property("constant", numbers, source="given value", relative=name not in SIGNED)
        properties = {name: replace(found, reference=reference) for name, found in properties.items()}
        crystal = None if set(given) & set(ELASTIC) else self.crystal
        return replace(self, properties=properties, reference=reference, crystal=crystal)

    def _lack(self, name: str) -> str:
        return f"material '{self.name}', law '{self.law}': no source states its {spell([name])}; give it in the card or in a material file of your own."


@dataclass(frozen=True)
class Mount:
    """The body that the held face of the resonator is joined to, stiff beside it."""

    expansion: float  # 1/K, of the base
    joined_at: float  # K, the temperature at which the joint is free of stress

    def strain(self, material: Material, temperature: ArrayLike) -> Array:
        """Growth of the base beyond the resonator's own since they were joined: ε = ∫ (α_base - α) dT."""
        T = np.asarray(temperature, dtype=float)
        return np.asarray(self.expansion * (T - self.joined_at) - np.log(material.growth(T, self.joined_at)))

    def strain_slope(self, material: Material, temperature: ArrayLike) -> Array:
        """Dε/dT, 1/K."""
        return np.asarray(self.expansion - material.value("expansion", temperature))

    def by_expansion(self, material: Material, temperature: Array) -> list[Array]:
        """Derivatives of ε by the value, slope and curvature of the deviation of the resonator's expansion."""
        about = material.reference
        since = (temperature - about, np.asarray(self.joined_at - about))
        ends = [(x, x**2 / 2, x**3 / 6) for x in since]
        return [s - t for t, s in zip(*ends, strict=True)]


def constant_material(name: str, youngs_modulus: float, poisson_ratio: float, density: float) -> Material:
    """Return a material of given values (Pa, 1, kg/m³): constant, without expansion, until its coefficients say more."""
    given = {"youngs_modulus": youngs_modulus, "poisson_ratio": poisson_ratio, "density": density}
    numbers = {key: {"value": value, "at_degC": 20.0} for key, value in given.items()}
    properties = {
        key: Property("constant", n, source="given value", relative=key not in SIGNED) for key, n in numbers.items()
    }
    properties["expansion"] = Property("constant", {"value": 0.0}, source="given values do not expand", relative=False)
    open_ones = ("youngs_modulus", "expansion")  # what the slope of a frequency needs
    return Material(name, "given values", 0.0, 5000.0, properties, "given in the card", constant=open_ones)


def check_sign(
    where: str,
    name: str,
    found: Property,
    span: list[float],
    sizes: Mapping[str, tuple[float, float, str]] | None = None,
) -> None:
    """Refuse a property that has not the sign, or the size (least, most, unit), of one anywhere in its range (°C)."""
    if found.form == "table" and not any(found.deviation):  # shape-preserving: its extremes are among its points
        values = found.numbers.get("value", 1.0) * np.asarray(found.numbers["values"], dtype=float)
    else:
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
            values = found(np.linspace(span[0], span[1], 101) + zero_Celsius)
    if name == "poisson_ratio" and not ((values > -1) & (values < 0.5)).all():
        raise ShellError(f"{where}: leaves the range -1 to 0.5 within range_degC.")
    if name == "expansion" and not (np.abs(values) < 0.01).all():
        raise ShellError(f"{where}: no solid expands by 1 % per kelvin; give it in 1/K.")
    if name not in ("poisson_ratio", "expansion"):
        least, most, unit = (sizes or {}).get(name, (1e-30, 1e30, "in SI units"))
        if not ((values > least) & (values < most)).all():
            raise ShellError(f"{where}: must be positive, {least:g} to {most:g} {unit}, everywhere within range_degC.")


def spell(names: Sequence[str]) -> str:
    """Return names as a list in words: "density, Poisson's ratio and expansion"."""
    words = [name.replace("youngs", "Young's").replace("poisson", "Poisson's").replace("_", " ") for name in names]
    return " and ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)
