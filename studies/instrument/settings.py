"""What a simulation takes for every key of a card: stated there, or by default."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from shell.constants import zero_Celsius
from studies.instrument.uncertain import is_spread

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

REFERENCE = "reference_temperature_degC"


@dataclass(frozen=True)
class Setting:
    """What a simulation takes for a key of the card: its value (None: there is none), and what the card states of its uncertainty."""

    value: Any = None
    sd: float | None = None
    low: float | None = None
    high: float | None = None
    by_default: bool = field(default=True, compare=False)  # what has no value is stated by nobody


def settings_of(instrument: "Instrument") -> dict[str, Setting]:
    """Return every key that counts in this card with what was read of it, defaults too, by dotted names."""
    from msgspec import to_builtins

    said = dict(_flatten(instrument.content, ""))
    found = {REFERENCE: Setting(instrument.reference_temperature - zero_Celsius, by_default=REFERENCE not in said)}
    for given in (one for table in instrument.tables.values() for one in table.given):
        deviations = {one.name: one.sd for one in given.stated.values()}
        for name, value in _flatten(to_builtins(given.keys), given.name):
            if value is not None and not name.endswith(".note"):
                raw = said.get(name)
                value = raw if isinstance(raw, list) else value  # with what is said of the numbers inside
                ends = raw if isinstance(raw, Mapping) else {}
                found[name] = Setting(value, deviations.get(name), ends.get("low"), ends.get("high"), name not in said)
    return found


def _flatten(content: Any, name: str) -> Iterator[tuple[str, Any]]:
    if isinstance(content, list) and content and all(isinstance(one, Mapping) for one in content):
        content = dict(enumerate(content))
    if isinstance(content, Mapping) and not is_spread(content):
        for key, value in content.items():
            yield from _flatten(value, f"{name}.{key}" if name else str(key))
    else:
        yield name, content
