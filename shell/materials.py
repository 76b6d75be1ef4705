"""Materials over temperature: published laws with source, range and uncertainty (`materials.toml`).

Temperatures are in kelvin here; the files state degrees Celsius. Outside a law's range there is an error, never an
extrapolation, and a property that no source states is refused by name.
"""

import difflib
import tomllib
from collections import UserDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.constants import zero_Celsius
from shell.crystal import AXES, SYSTEMS, Crystal
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.property import FORMS, LISTS, PROPERTIES, ROOM, SIGNED, Array, Property, coefficient_names
from shell.quadrature import gauss

if TYPE_CHECKING:
    from shell.cubic import Cubic

ELASTIC = ("shear_modulus", "youngs_modulus", "poisson_ratio")
CHECKABLE = (*PROPERTIES, "elastic_constants", "temperature_coefficients")
_SHIPPED = Path(__file__).with_name("materials.toml")


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
    unchecked: tuple[str, ...] = ()  # what could not be compared with an open source, of `CHECKABLE`

    @property
    def caveats(self) -> tuple[str, ...]:
        """What every answer with this material must say: a modulus taken as constant, a crystal, values not checked."""
        flat = (
            f"No source states how {spell(self.constant)} of {self.name} changes with temperature: taken as constant."
        )
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
            if name == "density":
                return self.properties[name](T) * self._growth_since_density(T) ** -3
            return self.properties[name](T)
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
        """What the law leaves open; coefficients that nothing makes uncertain are not in it."""
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
                raise ShellError(f"material '{self.name}' has no coefficient '{key}'{_nearest(key, known)}")
            held = changed.setdefault(name, list(self.properties[name].deviation))
            held[coefficient_names(name).index(coefficient)] = float(value)
        moved = {
            name: replace(self.properties[name], deviation=(a, b, c), reference=self.reference)
            for name, (a, b, c) in changed.items()
        }
        span = [self.lowest - zero_Celsius, self.highest - zero_Celsius]
        for name, found in moved.items():
            _check_sign(f"material '{self.name}', coefficients of {name}", name, found, span)
        constant = tuple(name for name in self.constant if name not in moved)
        return replace(self, properties={**self.properties, **moved}, constant=constant)

    def coefficient(self, key: str) -> float:
        """Return one coefficient of the deviation, for example `expansion.value`."""
        name, _, coefficient = key.partition(".")
        return self.properties[name].deviation[coefficient_names(name).index(coefficient)]

    def with_number(self, name: str, number: str, value: float) -> "Material":
        """Return the same material with one number of one property changed."""
        changed = self.properties[name].with_number(number, value)
        return replace(self, properties={**self.properties, name: changed})

    def rescaled(self, reference: float, **given: float) -> "Material":
        """Return the material with given values at the reference temperature, its laws' shapes kept.

        Deviations and their prior count from that temperature.

        `given`: any of `youngs_modulus`, `poisson_ratio`, `density`; what the law does not state becomes a constant.
        """
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

    def _growth_since_density(self, T: NDArray[np.float64]) -> NDArray[np.float64]:
        if "expansion" not in self.properties:
            return np.ones_like(T)
        return self.growth(T, self.properties["density"].numbers["at_degC"] + zero_Celsius)

    def _lack(self, name: str) -> str:
        return (
            f"material '{self.name}', law '{self.law}': no source states its {spell([name])};"
            " give it in the card or in a material file of your own."
        )


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


class Materials(UserDict[str, Any]):
    """The materials of a file, each checked when it is first taken."""

    def __init__(self, path: str, content: Mapping[str, Any]) -> None:
        super().__init__(content)
        self._path = path
        self._read: dict[str, Mapping[str, Material]] = {}

    def __getitem__(self, name: str) -> Mapping[str, Material]:
        """Return the laws of one material."""
        if name not in self._read:
            self._read[name] = _read_material(f"{self._path} [{name}]", name, self.data[name])
        return self._read[name]


@lru_cache(maxsize=8)
def read_materials(path: str | Path = _SHIPPED) -> Mapping[str, Mapping[str, Material]]:
    """Read a table of materials: name -> law -> Material; the default law stands first. Those that ship are read when asked for."""
    try:
        content = tomllib.loads(Path(path).read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise ShellError(f"{path}: cannot be read ({error.strerror}).") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ShellError(f"{path}: not a valid TOML file: {error}.") from None
    if content.pop("schema", None) != "hrg.materials/1":
        raise ShellError(f'{path}: the line schema = "hrg.materials/1" is missing; add it at the top.')
    if not content:
        raise ShellError(f"{path}: no material in it; add a table [name] with [name.laws.law].")
    found = Materials(str(path), content)
    return found if path == _SHIPPED else dict(found)  # a file of one's own is checked as a whole


def find_material(name: str, law: str = "default", path: str | Path | None = None) -> Material:
    """Return one law of one material, from the shipped table or a user's own file."""
    table = read_materials(path) if path is not None else read_materials()
    if name not in table:
        raise ShellError(f"unknown material '{name}'{_nearest(name, table)}")
    laws = table[name]
    if law == "default":
        return next(iter(laws.values()))
    if law not in laws:
        raise ShellError(f"material '{name}' has no law '{law}'{_nearest(law, laws)}")
    return laws[law]


def _read_material(where: str, name: str, entry: Any) -> Mapping[str, Material]:
    _check_keys(where, entry, ("description", "default", "laws"), required=("laws",))
    laws = entry["laws"]
    if not isinstance(laws, dict) or not laws:
        raise ShellError(f"{where}: laws must be tables [{name}.laws.law].")
    default = entry.get("default", next(iter(laws)))
    if not isinstance(default, str) or default not in laws:
        raise ShellError(f"{where}: default = '{default}' is not one of its laws{_nearest(str(default), laws)}")
    ordered = [default, *(law for law in laws if law != default)]
    return {law: _read_law(f"{where} law '{law}'", name, law, laws[law]) for law in ordered}


def _read_law(where: str, name: str, law: str, entry: Any) -> Material:
    known = ("source", "note", "range_degC", "crystal", "unchecked", *PROPERTIES)
    _check_keys(where, entry, known, required=("source", "range_degC"))
    span = entry["range_degC"]
    if not (isinstance(span, list) and len(span) == 2 and all(_is_number(x) for x in span) and span[0] < span[1]):
        raise ShellError(f"{where}: range_degC must be [lowest, highest], not {span!r}.")
    low, high = (x + zero_Celsius for x in span)
    if low < 0:
        raise ShellError(f"{where}: range_degC begins below absolute zero.")
    found = {p: _read_property(f"{where}: {p}", p, entry[p], span) for p in PROPERTIES if p in entry}
    crystal = _read_crystal(f"{where}: crystal", entry["crystal"]) if "crystal" in entry else None
    if crystal is not None:
        if any(p in found for p in ELASTIC):
            raise ShellError(f"{where}: give a crystal or {', '.join(ELASTIC)}, not both.")
        found |= crystal.properties()
        for p in ("youngs_modulus", "poisson_ratio"):
            _check_sign(f"{where}: {p} of the crystal", p, found[p], span)
    if all(p in found for p in ELASTIC):
        raise ShellError(f"{where}: give two of {', '.join(ELASTIC)}; the third follows.")
    unchecked = entry.get("unchecked", [])
    if not isinstance(unchecked, list) or not all(one in CHECKABLE for one in unchecked):
        raise ShellError(f"{where}: unchecked must be a list of some of {', '.join(CHECKABLE)}.")
    flat = tuple(p for p in ELASTIC[:2] if p in found and found[p].form == "constant" and not found[p].unsettled[1])
    source, note = str(entry["source"]), str(entry.get("note", ""))
    return Material(
        name, law, low, high, found, source, note, constant=flat, crystal=crystal, unchecked=tuple(unchecked)
    )


def _read_crystal(where: str, entry: Any) -> Crystal:
    maps = ("slope", "curvature", "uncertainty", "slope_uncertainty")
    _check_keys(where, entry, None, required=("system", "axis", "at_degC"))
    system = entry["system"]
    if system not in SYSTEMS:
        raise ShellError(f"{where}: unknown system '{system}'{_nearest(str(system), SYSTEMS)}")
    if entry["axis"] not in AXES[system]:
        raise ShellError(f"{where}: the axis of a {system} crystal is one of {', '.join(AXES[system])}.")
    _check_keys(where, entry, ("system", "axis", "at_degC", *SYSTEMS[system], *maps), required=SYSTEMS[system])
    tables = [entry.get(key, {}) for key in maps]
    for key, table in zip(maps, tables, strict=True):
        _check_keys(f"{where} {key}", table, SYSTEMS[system])
    constants = {key: entry[key] for key in SYSTEMS[system]}
    if not all(_is_number(x) for table in (constants, *tables) for x in (*table.values(), entry["at_degC"])):
        raise ShellError(f"{where}: constants, slopes, curvatures, uncertainties and at_degC must be numbers.")
    if not set(tables[3]) <= set(tables[0]):
        raise ShellError(f"{where}: slope_uncertainty names a constant without a slope; add the slope.")
    found = Crystal(system, entry["axis"], float(entry["at_degC"]), constants, *tables)
    if not (np.linalg.eigvalsh(found.stiffness()) > 0).all():
        raise ShellError(
            f"{where}: these constants are not those of a stable crystal; check their signs and units (Pa)."
        )
    return found


def _read_property(where: str, name: str, entry: Any, span: list[float]) -> Property:
    _check_keys(where, entry, None, required=("form",))
    if not isinstance(entry["form"], str) or entry["form"] not in FORMS:
        raise ShellError(f"{where}: unknown form '{entry['form']}'{_nearest(str(entry['form']), FORMS)}")
    needed = FORMS[entry["form"]][1] + (("at_degC",) if name == "density" else ())
    words = ("form", "source", "uncertainty", "unsettled")
    _check_keys(where, entry, (*words, "at_degC", *needed), required=needed)
    numbers = {key: value for key, value in entry.items() if key not in words}
    for key, value in numbers.items():
        if key in LISTS:
            if not isinstance(value, list) or not all(_is_number(x) for x in value):
                raise ShellError(f"{where}: {key} must be a list of numbers, not {value!r}.")
        elif not _is_number(value):
            raise ShellError(f"{where}: {key} must be a number, not {value!r}.")
    if entry["form"] == "table":
        at, values = np.array(numbers["temperature_degC"]), numbers["values"]
        if len(at) != len(values) or len(at) < 2 or (np.diff(at) <= 0).any():
            raise ShellError(
                f"{where}: temperature_degC must increase and have as many entries as values (two or more)."
            )
        if at[0] > span[0] or at[-1] < span[1]:
            raise ShellError(f"{where}: the table covers {at[0]:g} to {at[-1]:g} °C, less than the law's range_degC.")
    if entry["form"] == "parabola" and numbers["maximum_degC"] == numbers["at_degC"]:
        raise ShellError(f"{where}: maximum_degC must differ from at_degC, between which the property rises.")
    coefficients = coefficient_names(name)
    uncertainty, unsettled = entry.get("uncertainty", {}), entry.get("unsettled", {})
    _check_keys(f"{where} uncertainty", uncertainty, tuple(key for key in needed if key not in LISTS))
    _check_keys(f"{where} unsettled", unsettled, coefficients)
    if not all(_is_number(x) and x >= 0 for x in (*uncertainty.values(), *unsettled.values())):
        raise ShellError(f"{where}: uncertainties must be numbers, zero or more.")
    a, b, c = (float(unsettled.get(one, 0.0)) for one in coefficients)
    result = Property(entry["form"], numbers, uncertainty, str(entry.get("source", "")), name not in SIGNED, (a, b, c))
    _check_sign(where, name, result, span)
    return result


def _check_sign(where: str, name: str, found: Property, span: list[float]) -> None:
    if found.form == "table" and not any(found.deviation):  # shape-preserving: its extremes are among its points
        values = found.numbers.get("value", 1.0) * np.asarray(found.numbers["values"], dtype=float)
    else:
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
            values = found(np.linspace(span[0], span[1], 101) + zero_Celsius)
    if name == "poisson_ratio" and not ((values > -1) & (values < 0.5)).all():
        raise ShellError(f"{where}: leaves the range -1 to 0.5 within range_degC.")
    if name == "expansion" and not (np.abs(values) < 0.01).all():
        raise ShellError(f"{where}: no solid expands by 1 % per kelvin; give it in 1/K.")
    if name not in ("poisson_ratio", "expansion") and not ((values > 1e-30) & (values < 1e30)).all():
        raise ShellError(
            f"{where}: must be positive, and no larger than SI units make it, everywhere within range_degC."
        )


def _check_keys(where: str, entry: Any, known: tuple[str, ...] | None, required: tuple[str, ...] = ()) -> None:
    if not isinstance(entry, dict):
        raise ShellError(f"{where}: must be a table, not {entry!r}.")
    for key in entry if known is not None else ():
        if known is not None and key not in known:
            raise ShellError(f"{where}: unknown key '{key}'{_nearest(key, known)}")
    for key in required:
        if key not in entry:
            raise ShellError(f"{where}: the key '{key}' is missing; add it.")


def spell(names: Sequence[str]) -> str:
    """Return names as a list in words: "density, Poisson's ratio and expansion"."""
    words = [name.replace("youngs", "Young's").replace("poisson", "Poisson's").replace("_", " ") for name in names]
    return " and ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _nearest(word: str, known: Any) -> str:
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else f"; known: {', '.join(known)}."
