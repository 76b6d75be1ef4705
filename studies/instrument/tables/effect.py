"""`[[effect]]`: what extends the model of a card beyond its other tables, by the names of the library of effects.

An entry has the effect's whole shape and at least one coefficient; all are exact unless the card states otherwise.
"""

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np

from studies.errors import InputError
from studies.instrument.registry import CardPlace, CardTable
from studies.schema.keys import Keys, number, says

if TYPE_CHECKING:
    from studies.effects import Effect


@dataclass(frozen=True)
class EffectEntry:
    """One `[[effect]]` of a card: the effect, the response it changes, and its parameters by name."""

    name: str
    response: str
    parameters: Mapping[str, float | list[float]]
    since: float | None = None
    """s, POSIX: from when it counts its time."""


def keys_of(raw: Mapping[str, Any], where: str) -> Any:
    """Return the class of an entry's keys, from what the effect says of itself."""
    from studies.effects import find_effect

    name = raw.get("name")
    if not isinstance(name, str):
        raise InputError(f'{where}: the line name = "..." is missing; add it.')
    try:
        effect = find_effect(name)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    response = raw.get("response")
    return _declare(effect, response if response in effect.responses else effect.responses[0])


def _declare(effect: "Effect", response: str) -> Any:
    """Declare the parameters of the effect's shape with their bounds, and its coefficients for one response."""
    fields: list[Any] = [
        ("name", Annotated[str, says("hrg effects lists names, parameters and bounds", example=effect.name)]),
        ("response", Annotated[Literal[effect.responses], says("what it changes")], effect.responses[0]),
    ]
    if effect.dated:
        meaning = "from when it counts its time, where the run says when it starts; else it begins with the run"
        fields.append(("since", Annotated[str, says(meaning, example="2026-01-31T12:00:00")], ""))
    for shape in effect.shape:
        kind = Annotated[float, number(shape.meaning, least=shape.low, most=shape.high)]
        fields.append((shape.name, kind, shape.low) if shape.steady else (shape.name, kind))
    coefficients = effect.coefficient_names(response)
    for key, coefficient in zip(coefficients, effect.coefficients, strict=True):
        positive = effect.positive and key == coefficients[0]
        most = coefficient.most if np.isfinite(coefficient.most) else None
        weight: Any = Annotated[
            float, number("size; at least one is needed", least=0.0 if positive else None, most=most)
        ]
        many = Annotated[list[float], msgspec.Meta(min_length=1, max_length=len(coefficient.spread))]
        fields.append((key, weight | many | None if len(coefficient.spread) > 1 else weight | None, None))

    def check(entry: Any) -> None:
        if all(getattr(entry, key) is None for key in coefficients):
            raise ValueError(f"the effect '{effect.name}' needs a coefficient; add {' or '.join(coefficients)}.")
        _moment(getattr(entry, "since", ""))

    return msgspec.defstruct(
        "Entry", fields, bases=(Keys,), namespace={"__post_init__": check}, frozen=True, kw_only=True
    )


def build_entry(keys: Any, place: CardPlace) -> EffectEntry:
    """Return an entry without the parameters that it leaves out."""
    given = {key: getattr(keys, key) for key in keys.__struct_fields__ if key not in ("name", "response", "since")}
    parameters = {key: value for key, value in given.items() if value is not None}
    return EffectEntry(keys.name, keys.response, parameters, _moment(getattr(keys, "since", "")))


def _moment(date: str) -> float | None:
    try:
        return datetime.datetime.fromisoformat(date).timestamp() if date else None
    except (ValueError, OverflowError, OSError):
        raise ValueError(f"since must be an ISO 8601 time such as 2026-01-31T12:00:00, not '{date}'.") from None


TABLE = CardTable("effect", part="effects", build=build_entry, keys_of=keys_of)
