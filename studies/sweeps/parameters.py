"""Parameters of a study: keys of a card by their path, the temperature, or free numbers for a user's function.

`resonator.thickness_mm`, `resonator.stem.radius_mm`, `material.youngs_modulus_GPa`, `material.law`,
`thermal.film_emissivity` name keys of the card; a whole number is a place in a list (`resonator.thickness_mm.1.1`). A
profile of [position, value] pairs as a whole stands for its mean along the arc: all of it moves by the same amount.
`temperature_degC` is the temperature of quantities that give none of their own. `user.anything` reaches only user functions.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shell.constants import zero_Celsius
from studies.errors import InputError, nearest
from studies.instrument.card import OF_GEOMETRY, Instrument
from studies.instrument.dotted import look_up, names, plain_number
from studies.instrument.material_values import LAW
from studies.instrument.registry import possible_keys
from studies.instrument.settings import Setting, settings_of
from studies.instrument.tables.material import GIVEN
from studies.sweeps.expressions import Derived, fill_in

TEMPERATURE = "temperature_degC"


def find_nominal(instrument: Instrument, name: str, where: str) -> float | str | None:
    """Return a parameter's value in the card, None where the card leaves it open."""
    if name.startswith("user.") and len(name) > len("user."):
        return None
    if name == TEMPERATURE:
        return instrument.reference_temperature - zero_Celsius
    try:
        value = look_up(instrument.content, name)
    except (LookupError, ValueError, TypeError):
        if name.split(".")[0] in OF_GEOMETRY:
            _ = instrument.resonator  # a card without one says so
        if name not in possible_keys(instrument.content):
            known = [*_named(instrument), *possible_keys(instrument.content), TEMPERATURE]
            raise InputError(f"{where}: card '{instrument.name}' has no parameter '{name}'{nearest(name, known)}") from None  # fmt: skip
        table, key = name.split(".", 1)
        if table == "material" and key in GIVEN:
            quantity, factor = GIVEN[key]
            return float(instrument.material.value(quantity, instrument.reference_temperature)) / factor
        return _default(instrument, table, key)
    if _is_profile(value):
        return _mean(value)
    if isinstance(value, Mapping | list):
        inside = [path for path in _named(instrument) if path.startswith(name + ".")]
        raise InputError(f"{where}: '{name}' is not one value; name one inside it: {', '.join(inside[:6])}.")
    return value if isinstance(value, str) else float(value)


def set_parameters(instrument: Instrument, values: Mapping[str, Any], derived: Sequence[Derived] = ()) -> Instrument:
    """Return the instrument with parameters of the card replaced, and those derived from them; the rest follows."""
    filled = fill_in(derived, values, lambda name: find_nominal(instrument, name, "card"))
    placed: dict[str, Any] = {}
    for name, value in filled.items():
        if name != TEMPERATURE and not name.startswith("user."):
            placed |= _moved(instrument, name, value)
    return instrument.with_values(placed)


def _is_profile(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(pair, list) and len(pair) == 2 for pair in value)


def _mean(profile: Sequence[Any]) -> float:
    """Return the mean of a profile, linear between its positions, level beyond them from 0 to 1."""
    places, values = np.array([[place, plain_number(value)] for place, value in profile], dtype=float).T
    return float(np.trapezoid([values[0], *values, values[-1]], [min(0.0, places[0]), *places, max(1.0, places[-1])]))


def _moved(instrument: Instrument, name: str, value: Any) -> dict[str, Any]:
    """Return the values of the card that a parameter sets: itself, or every point of its profile moved by the same amount."""
    try:
        there = look_up(instrument.content, name)
    except (LookupError, ValueError, TypeError):
        return {name: value}
    if not _is_profile(there):
        return {name: value}
    return {f"{name}.{k}.1": plain_number(one) + value - _mean(there) for k, (_, one) in enumerate(there)}


def _named(instrument: Instrument) -> list[str]:
    """Return the dotted name of every number and text in the tables of a card."""
    return [n for t in instrument.tables if t in instrument.content for n in names(instrument.content[t], f"{t}.")]


def _default(instrument: Instrument, table: str, key: str) -> float | str | None:
    """Return the documented default of a key that the card leaves out, None where it follows from other keys."""
    if f"{table}.{key}".startswith(LAW):
        return 0.0
    value = settings_of(instrument).get(f"{table}.{key}", Setting()).value
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
