"""Materials by name: published laws with source, range (°C) and uncertainty (`materials.toml`), and files of one's own."""

import tomllib
from collections import UserDict
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from shell.constants import zero_Celsius
from shell.crystal import AXES, SYSTEMS, Crystal
from shell.errors import ShellError, nearest
from shell.material import ELASTIC, Material, check_sign
from shell.property import FORMS, LISTS, PROPERTIES, SIGNED, Property, coefficient_names

SOLID = {
    "youngs_modulus": (1e6, 1e13, "Pa"),
    "shear_modulus": (1e6, 1e13, "Pa"),
    "density": (50.0, 3e4, "kg/m³"),
    "conductivity": (1e-3, 1e4, "W/(m K)"),
    "heat_capacity": (1.0, 1e5, "J/(kg K)"),
}
"""Sizes of any solid: beyond them a number of a file is in another unit."""
CHECKABLE = (*PROPERTIES, "elastic_constants", "temperature_coefficients")
_SHIPPED = Path(__file__).with_name("materials.toml")


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
        raise ShellError(f"unknown material '{name}'{nearest(name, table)}")
    laws = table[name]
    if law == "default":
        return next(iter(laws.values()))
    if law not in laws:
        raise ShellError(f"material '{name}' has no law '{law}'{nearest(law, laws)}")
    return laws[law]


def _read_material(where: str, name: str, entry: Any) -> Mapping[str, Material]:
    _check_keys(where, entry, ("description", "default", "laws"), required=("laws",))
    laws = entry["laws"]
    if not isinstance(laws, dict) or not laws:
        raise ShellError(f"{where}: laws must be tables [{name}.laws.law].")
    default = entry.get("default", next(iter(laws)))
    if not isinstance(default, str) or default not in laws:
        raise ShellError(f"{where}: default = '{default}' is not one of its laws{nearest(str(default), laws)}")
    ordered = [default, *(law for law in laws if law != default)]
    return {law: _read_law(_inside(where, f"laws.{law}"), name, law, laws[law]) for law in ordered}


def _read_law(where: str, name: str, law: str, entry: Any) -> Material:
    known = ("source", "note", "range_degC", "crystal", "unchecked", *PROPERTIES)
    _check_keys(where, entry, known, required=("source", "range_degC"))
    span = entry["range_degC"]
    if not (isinstance(span, list) and len(span) == 2 and all(_is_number(x) for x in span) and span[0] < span[1]):
        raise ShellError(f"{where}: range_degC must be [lowest, highest], not {span!r}.")
    low, high = (x + zero_Celsius for x in span)
    if low < 0:
        raise ShellError(f"{where}: range_degC begins below absolute zero.")
    found = {p: _read_property(_inside(where, p), p, entry[p], span) for p in PROPERTIES if p in entry}
    crystal = _read_crystal(_inside(where, "crystal"), entry["crystal"]) if "crystal" in entry else None
    if crystal is not None:
        if any(p in found for p in ELASTIC):
            raise ShellError(f"{where}: give a crystal or {', '.join(ELASTIC)}, not both.")
        found |= crystal.properties()
        for p in ("youngs_modulus", "poisson_ratio"):
            check_sign(f"{where}: {p} of the crystal", p, found[p], span)
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
        raise ShellError(f"{where}: unknown system '{system}'{nearest(str(system), SYSTEMS)}")
    if entry["axis"] not in AXES[system]:
        raise ShellError(f"{where}: the axis of a {system} crystal is one of {', '.join(AXES[system])}.")
    _check_keys(where, entry, ("system", "axis", "at_degC", *SYSTEMS[system], *maps), required=SYSTEMS[system])
    tables = [entry.get(key, {}) for key in maps]
    for key, table in zip(maps, tables, strict=True):
        _check_keys(_inside(where, key), table, SYSTEMS[system])
    constants = {key: entry[key] for key in SYSTEMS[system]}
    if not all(_is_number(x) for table in (constants, *tables) for x in (*table.values(), entry["at_degC"])):
        raise ShellError(f"{where}: constants, slopes, curvatures, uncertainties and at_degC must be numbers.")
    if not set(tables[3]) <= set(tables[0]):
        raise ShellError(f"{where}: slope_uncertainty names a constant without a slope; add the slope.")
    found = Crystal(system, entry["axis"], float(entry["at_degC"]), constants, *tables)
    if not (np.linalg.eigvalsh(found.stiffness()) > 0).all():
        raise ShellError(f"{where}: these constants are of no stable crystal; check signs and units (Pa).")
    return found


def _read_property(where: str, name: str, entry: Any, span: list[float]) -> Property:
    _check_keys(where, entry, None, required=("form",))
    if not isinstance(entry["form"], str) or entry["form"] not in FORMS:
        raise ShellError(f"{where}: unknown form '{entry['form']}'{nearest(str(entry['form']), FORMS)}")
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
            raise ShellError(f"{where}: temperature_degC must increase, with as many entries as values.")
        if at[0] > span[0] or at[-1] < span[1]:
            raise ShellError(f"{where}: the table covers {at[0]:g} to {at[-1]:g} °C, less than the law's range_degC.")
    if entry["form"] == "parabola" and numbers["maximum_degC"] == numbers["at_degC"]:
        raise ShellError(f"{where}: maximum_degC must differ from at_degC, between which the property rises.")
    coefficients = coefficient_names(name)
    uncertainty, unsettled = entry.get("uncertainty", {}), entry.get("unsettled", {})
    _check_keys(_inside(where, "uncertainty"), uncertainty, tuple(key for key in needed if key not in LISTS))
    _check_keys(_inside(where, "unsettled"), unsettled, coefficients)
    if not all(_is_number(x) and x >= 0 for x in (*uncertainty.values(), *unsettled.values())):
        raise ShellError(f"{where}: uncertainties must be numbers, zero or more.")
    a, b, c = (float(unsettled.get(one, 0.0)) for one in coefficients)
    result = Property(entry["form"], numbers, uncertainty, str(entry.get("source", "")), name not in SIGNED, (a, b, c))
    check_sign(where, name, result, span, SOLID)
    return result


def _inside(where: str, name: str) -> str:
    """Return the place of a table in another: "file [x.laws.a]"."""
    return f"{where[:-1]}.{name}]"


def _check_keys(where: str, entry: Any, known: tuple[str, ...] | None, required: tuple[str, ...] = ()) -> None:
    if not isinstance(entry, dict):
        raise ShellError(f"{where}: must be a table, not {entry!r}.")
    for key in entry if known is not None else ():
        if known is not None and key not in known:
            raise ShellError(f"{where}: unknown key '{key}'{nearest(key, known)}")
    for key in required:
        if key not in entry:
            raise ShellError(f"{where}: the key '{key}' is missing; add it.")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
