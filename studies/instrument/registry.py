"""The tables that a card may have: one file each in `studies.instrument.tables`, found by discovery."""

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any

from msgspec import inspect

from studies.errors import InputError, nearest
from studies.instrument.uncertain import Given, UncertainValue, read_uncertain
from studies.schema.keys import bounds, describe, holds_value, known_keys, structs

TABLES = "studies.instrument.tables"


@dataclass(frozen=True)
class CardPlace:
    """Where a table stands: "file [table]" for messages, the folder of the card, and its reference temperature (K)."""

    where: str
    folder: Path
    reference_temperature: float


@dataclass(frozen=True)
class CardTable:
    """A table of the card, or some keys of one, and the part of the instrument that it becomes."""

    table: str  # its name in the card; several entries may share a table and own different keys of it
    keys: Any = None  # class of its keys (`studies.schema.keys.Keys`), or a union of classes that a tag tells apart
    part: str = ""  # name of what it becomes in `Instrument.parts`; that of the table unless given
    # callable (keys, place) -> part: The part in SI units; the keys themselves where they are the part.
    build: Callable[[Any, CardPlace], Any] = lambda keys, place: keys
    required: bool = False  # whether every card must have it
    # The documented uncertainties hold only where the card has the table: without it there is no such thing.
    optional: bool = False
    # callable (raw, where) -> type: Only for an array of tables ([[effect]]), whose members differ: the class for one
    # of them.
    keys_of: Callable[[Mapping[str, Any], str], Any] | None = None

    @property
    def name(self) -> str:
        """Name of the part."""
        return self.part or self.table


@dataclass(frozen=True)
class ReadTable:
    """What one table of a card says: `keys` as they stand, `parts` built from them, and what tells the numbers that are not exact."""

    keys: Mapping[str, Any]
    parts: Mapping[str, Any]
    given: tuple[Given, ...] = ()

    @cached_property
    def uncertain(self) -> tuple[UncertainValue, ...]:
        """Its numbers that are not exact."""
        return tuple(value for one in self.given for value in one.uncertain)

    @property
    def stated(self) -> frozenset[str]:
        """Names of the numbers whose uncertainty it states, exact ones too."""
        return frozenset(value.name for one in self.given for value in one.stated.values())


@cache
def card_tables() -> Mapping[str, tuple[CardTable, ...]]:
    """Return the entries of every table by its name."""
    found: dict[str, tuple[CardTable, ...]] = {}
    package = importlib.import_module(TABLES)
    for module in pkgutil.iter_modules(package.__path__):
        entry: CardTable = importlib.import_module(f"{TABLES}.{module.name}").TABLE
        found[entry.table] = (*found.get(entry.table, ()), entry)
    return found


def read_table(name: str, raw: Any, place: CardPlace) -> ReadTable:
    """Read one table of a card; an absent one has its defaults."""
    entries = card_tables()[name]
    if raw is not None:
        return _read_given(name, raw, place)
    if any(entry.required for entry in entries):
        raise InputError(f"{place.where}: the table is missing; add it.")
    return _read_absent(name, place.reference_temperature)


@lru_cache(maxsize=256)
def _read_absent(name: str, reference_temperature: float) -> ReadTable:
    """Return the defaults of a table, which are the same for every card of one reference temperature."""
    return _read_given(name, None, CardPlace(f"[{name}]", Path(), reference_temperature))


def find_home(key: str) -> str:
    """Say to which table of a card a key belongs that stands in another, or "" where there is no such table."""
    tables = ((name, [known_keys(describe(one.keys)) for one in entries]) for name, entries in card_tables().items())
    home = next((name for name, found in tables if key == name or any(key in keys for keys in found)), "")
    return f"; it belongs to the table [{home}]: add that line above it." if home else ""


def _read_given(name: str, raw: Any, place: CardPlace) -> ReadTable:
    entries = card_tables()[name]
    if entries[0].keys_of is not None:
        return _read_array(entries[0], raw, place)
    if not isinstance(raw, Mapping | None):
        raise InputError(f"{place.where}: {name} must be a table ([{name}]), not {raw!r:.60}.")
    given = raw or {}
    own = [known_keys(describe(entry.keys), given) for entry in entries]
    for key in given:
        if any(key in keys for keys in own):
            continue
        near = nearest(key, [k for keys in own for k in keys])
        if any(key in known_keys(describe(entry.keys)) for entry in entries):
            tag = structs(describe(entries[0].keys))[0].tag_field
            raise InputError(f"{place.where}: unknown key '{key}'; {tag} = '{given.get(tag or '')}' has none{near}")
        if (home := find_home(key)) or len(entries) > 1:
            raise InputError(f"{place.where}: unknown key '{key}'{home or near}")
    read: list[Given] = []
    keys: dict[str, Any] = {}
    parts: dict[str, Any] = {}
    for entry, known in zip(entries, own, strict=True):
        mine = {key: value for key, value in given.items() if key in known or len(entries) == 1}
        found = read_uncertain(mine, entry.keys, place.where, name)
        read += [found] if raw is not None or not entry.optional else []
        keys[entry.name], parts[entry.name] = found.keys, entry.build(found.keys, place)
    return ReadTable(keys, parts, tuple(read))


def _read_array(entry: CardTable, raw: Any, place: CardPlace) -> ReadTable:
    assert entry.keys_of is not None
    if not isinstance(raw, list | None):
        raise InputError(f"{place.where}: {entry.table} must be an array of tables ([[{entry.table}]]).")
    read: list[Given] = []
    parts: list[Any] = []
    for number, member in enumerate(raw or []):
        where = f"{place.where.removesuffix(f'[{entry.table}]')}[[{entry.table}]] number {number + 1}"
        if not isinstance(member, Mapping):
            raise InputError(f"{where}: must be a table, not {member!r:.60}.")
        read.append(read_uncertain(member, entry.keys_of(member, where), where, f"{entry.table}.{number}"))
        parts.append(entry.build(read[-1].keys, CardPlace(where, place.folder, place.reference_temperature)))
    return ReadTable({}, {entry.name: tuple(parts)}, tuple(read))


def possible_keys(content: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return the bounds of the keys that this card has or may have, by their dotted names; those in lists are left out."""
    found: dict[str, tuple[float, float]] = {}
    for table, entries in card_tables().items():
        raw = content.get(table) or {}
        for entry in entries if isinstance(raw, Mapping) else ():
            if entry.keys is not None:
                found |= {name: bounds(one.type) for name, one in _fields(describe(entry.keys), raw, table)}
    return found


def _fields(node: Any, raw: Any, before: str) -> Iterable[tuple[str, inspect.Field]]:
    for struct in structs(node, raw):
        for field in struct.fields:
            name = f"{before}.{field.encode_name}"
            inner = raw.get(field.encode_name) if isinstance(raw, Mapping) else None
            below = structs(field.type)
            if holds_value(field.type):
                yield name, field
            elif inner is not None or not any(one.required for table in below for one in table.fields):
                yield from _fields(field.type, inner, name)
