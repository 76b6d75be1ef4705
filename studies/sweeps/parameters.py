"""Parameters of a study: keys of a card by their path, the temperature, or free numbers for a user's function.

`resonator.thickness_mm`, `resonator.stem.radius_mm`, `material.youngs_modulus_GPa`, `material.law`,
`thermal.film_emissivity` name keys of the card; a whole number is a place in a list (`resonator.thickness_mm.1.1`). `temperature_degC` is the temperature of
quantities that give none of their own. `user.anything` reaches only user functions.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from studies.errors import InputError, nearest
from studies.instrument.card import MATERIAL_KEYS, Instrument
from studies.instrument.resonator import SHAPES, STEM_KEYS

TEMPERATURE = "temperature_degC"
UNITS = {
    "_degC": "°C", "_GPa": "GPa", "_kg_m3": "kg/m³", "_mm": "mm", "_deg": "°", "_cm2": "cm²", "_mW": "mW", "_s": "s",
    "_W_per_m_K": "W/(m K)", "_J_per_kg_K": "J/(kg K)", "_J_per_K": "J/K", "_W_per_K": "W/K",
}  # fmt: skip
TABLES = ("resonator", "material", "thermal")
MATERIAL_VALUES = {
    # key of the card: (property of the material, its unit here in SI)
    "youngs_modulus_GPa": ("youngs_modulus", 1e9),
    "poisson_ratio": ("poisson_ratio", 1.0),
    "density_kg_m3": ("density", 1.0),
}


def unit_of(name: str) -> str:
    """Return the unit that a parameter's name carries, or "1"."""
    words = [word for word in name.split(".") if not word.isdigit()]
    return next((unit for suffix, unit in UNITS.items() if words[-1].endswith(suffix)), "1")


def find_nominal(instrument: Instrument, name: str, where: str) -> float | str | None:
    """Return a parameter's value in the card, None where the card leaves it open.

    Raises
    ------
    InputError
        The card cannot have such a key; the nearest is named.
    """
    if name.startswith("user.") and len(name) > len("user."):
        return None
    if name == TEMPERATURE:
        return instrument.reference_temperature - 273.15
    try:
        value = _look_up(instrument.content, name.split("."))
    except (KeyError, IndexError, ValueError, TypeError):
        if name not in _open_keys(instrument.content):
            known = [*_paths(instrument.content), *_open_keys(instrument.content), TEMPERATURE]
            raise InputError(
                f"{where}: the card '{instrument.name}' has no parameter '{name}'{nearest(name, known)}"
            ) from None
        table, key = name.split(".", 1)
        if table == "material" and key in MATERIAL_VALUES:
            quantity, factor = MATERIAL_VALUES[key]
            return float(instrument.material.value(quantity, instrument.reference_temperature)) / factor
        return None
    if isinstance(value, Mapping | list):
        inside = [path for path in _paths(instrument.content) if path.startswith(name + ".")]
        raise InputError(f"{where}: '{name}' is not one value; name one inside it: {', '.join(inside[:6])}.")
    return value if isinstance(value, str) else float(value)


def set_parameters(instrument: Instrument, values: Mapping[str, Any]) -> Instrument:
    """Return the instrument with parameters of the card replaced; its resonator and material follow."""
    content: Any = instrument.content
    for name, value in values.items():
        if name != TEMPERATURE and not name.startswith("user."):
            content = _replaced(content, name.split("."), value)
    if content is instrument.content:
        return instrument
    return replace(instrument, content=content)


def _look_up(table: Any, path: Sequence[str]) -> Any:
    for word in path:
        table = table[int(word)] if isinstance(table, list) else table[word]
    return table


def _replaced(table: Any, path: Sequence[str], value: Any) -> Any:
    if not path:
        return value
    if isinstance(table, list):
        place = int(path[0])
        return [*table[:place], _replaced(table[place], path[1:], value), *table[place + 1 :]]
    return {**table, path[0]: _replaced(table.get(path[0], {}), path[1:], value)}


def _paths(table: Any, before: str = "") -> Iterator[str]:
    """Give the path of every number and text of the card's resonator, material and thermal tables."""
    items = enumerate(table) if isinstance(table, list) else table.items()
    for key, value in items:
        path = f"{before}{key}"
        if not before and key not in TABLES:
            continue
        if isinstance(value, Mapping | list):
            yield from _paths(value, path + ".")
        else:
            yield path


def _open_keys(content: Mapping[str, Any]) -> list[str]:
    """Return the keys that a card of this shape may have besides those that it has."""
    from studies.simulation.heat_path import KEYS as THERMAL_KEYS

    shape = SHAPES[content["resonator"]["shape"]][0]
    stem = [f"resonator.stem.{key}" for key in STEM_KEYS] if "stem" in content["resonator"] else []
    plain = [f"resonator.{key}" for key in shape if key not in ("stem", "segment")]
    others = [
        f"{table}.{key}" for table, keys in (("material", MATERIAL_KEYS), ("thermal", THERMAL_KEYS)) for key in keys
    ]
    return [*plain, *stem, *others]
