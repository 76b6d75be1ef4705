"""What a simulation takes for every key of a card: stated there, or by default."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from shell.constants import zero_Celsius
from studies.instrument.uncertain import is_spread

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

REFERENCE = "reference_temperature_degC"


@dataclass(frozen=True)
class Setting:
    """What a simulation takes for a key of the card: its value, and what the card states beside it: `sd`, `low`, `high`; None where it does not state the key."""

    value: Any = None  # None: there is none
    stated: Mapping[str, float] | None = None

    @property
    def counts(self) -> tuple[Any, Mapping[str, float]]:
        """What makes a difference: not whether the value is stated."""
        return self.value, self.stated or {}


def settings_of(instrument: "Instrument") -> dict[str, Setting]:
    """Return every key that counts in this card with what was read of it, defaults too, by dotted names."""
    from msgspec import to_builtins

    said = dict(_flatten(instrument.content, ""))
    found: dict[str, Any] = {REFERENCE: instrument.reference_temperature - zero_Celsius}
    beside: dict[str, dict[str, float]] = {}
    for given in (one for table in instrument.tables.values() for one in table.given):
        beside |= {one.name: {"sd": one.sd} for one in given.stated.values()}
        found |= dict(_flatten(to_builtins(given.keys), given.name))
    for name, raw in said.items():
        if is_spread(raw):
            beside[name] |= {end: raw[end] for end in ("low", "high") if end in raw}
        elif isinstance(raw, list):
            found[name] = raw  # with what is said of the numbers inside
    return {
        name: Setting(value, beside.get(name, {}) if name in said else None)
        for name, value in found.items()
        if value is not None and not name.endswith(".note")
    }


def _flatten(content: Any, name: str) -> Iterator[tuple[str, Any]]:
    if isinstance(content, list) and content and all(isinstance(one, Mapping) for one in content):
        content = dict(enumerate(content))
    if isinstance(content, Mapping) and not is_spread(content):
        for key, value in content.items():
            yield from _flatten(value, f"{name}.{key}" if name else str(key))
    else:
        yield name, content
