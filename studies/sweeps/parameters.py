"""Parameters of a study: keys of a card by their path, the temperature, or free numbers for a user's function.

`resonator.thickness_mm`, `resonator.stem.radius_mm`, `material.youngs_modulus_GPa`, `material.law`,
`thermal.film_emissivity` name keys of the card; a whole number is a place in a list (`resonator.thickness_mm.1.1`). `temperature_degC` is the temperature of
quantities that give none of their own. `user.anything` reaches only user functions.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.constants import zero_Celsius

from studies.errors import InputError, nearest
from studies.instrument.card import Instrument
from studies.instrument.dotted import look_up, names
from studies.instrument.keys import Keys
from studies.instrument.material_values import LAW
from studies.instrument.registry import possible_keys
from studies.instrument.tables.material import GIVEN
from studies.sweeps.expressions import Derived, fill_in

TEMPERATURE = "temperature_degC"


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
        return instrument.reference_temperature - zero_Celsius
    try:
        value = look_up(instrument.content, name)
    except (LookupError, ValueError, TypeError):
        if name not in set(possible_keys(instrument.content)):
            known = [*_named(instrument), *possible_keys(instrument.content), TEMPERATURE]
            raise InputError(
                f"{where}: the card '{instrument.name}' has no parameter '{name}'{nearest(name, known)}"
            ) from None
        table, key = name.split(".", 1)
        if table == "material" and key in GIVEN:
            quantity, factor = GIVEN[key]
            return float(instrument.material.value(quantity, instrument.reference_temperature)) / factor
        return _default(instrument, table, key)
    if isinstance(value, Mapping | list):
        inside = [path for path in _named(instrument) if path.startswith(name + ".")]
        raise InputError(f"{where}: '{name}' is not one value; name one inside it: {', '.join(inside[:6])}.")
    return value if isinstance(value, str) else float(value)


def set_parameters(instrument: Instrument, values: Mapping[str, Any], derived: Sequence[Derived] = ()) -> Instrument:
    """Return the instrument with parameters of the card replaced, and those derived from them; the rest follows."""
    filled = fill_in(derived, values, lambda name: find_nominal(instrument, name, "card"))
    return instrument.with_values(
        {name: value for name, value in filled.items() if name != TEMPERATURE and not name.startswith("user.")}
    )


def _named(instrument: Instrument) -> list[str]:
    """Return the dotted name of every number and text in the tables of a card."""
    return [
        name
        for table in instrument.tables
        if table in instrument.content
        for name in names(instrument.content[table], f"{table}.")
    ]


def _default(instrument: Instrument, table: str, key: str) -> float | str | None:
    """Return the documented default of a key that the card leaves out, None where it follows from other keys."""
    if f"{table}.{key}".startswith(LAW):
        return 0.0
    part = instrument.part(table)
    value = getattr(part, key, None) if isinstance(part, Keys) else None
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
