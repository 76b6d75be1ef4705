"""What msgspec refuses in a table, as one sentence that names file, table and key, and says how to mend it."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, cast

import msgspec
from msgspec import inspect

from studies.errors import InputError, nearest
from studies.files.given import is_sound
from studies.instrument.keys import Path, describe, find, holds_number, known_keys, options

T = TypeVar("T")
BOUND = {">": "above", ">=": "at least", "<": "below", "<=": "at most"}
PLACE = re.compile(r" - at `\$(.*?)`$", re.DOTALL)
WORD = re.compile(r"\.([^.\[\]]+)|\[(\d+)\]")


def read_keys(raw: Any, keys: type[T], where: str) -> T:
    """Read a table of plain values into its class.

    Raises
    ------
    InputError
        An unknown or missing key, a value of the wrong type or out of its bounds.
    """
    try:
        found = msgspec.convert(raw, keys)
    except msgspec.ValidationError as error:
        raise InputError(mend(str(error), raw, keys, where)) from None
    for path, value in _leaves(raw):
        if not is_sound(value):
            raise InputError(f"{spell_place(where, path)} must be a finite number, not {_short(value)}.")
    return found


def mend(refusal: str, raw: Any, keys: Any, where: str) -> str:
    """Return the sentence for one refusal of msgspec."""
    placed = PLACE.search(refusal)
    words = WORD.findall(placed[1]) if placed else []
    path: Path = tuple(int(index) if index else name for name, index in words)
    what = refusal[: placed.start()] if placed else refusal
    value = _at(raw, path)
    node = find(keys, path, raw) or describe(keys)
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", what, re.DOTALL):
        return f"{spell_table(where, path)}: unknown key '{unknown[1]}'{nearest(unknown[1], known_keys(node, value))}"
    if missing := re.fullmatch(r"Object missing required field `(.*)`", what):
        return f"{spell_table(where, path)}: the key '{missing[1]}' is missing; add it."
    place = spell_place(where, path)
    if holds_number(node) and not is_sound(value):
        return f"{place} must be a finite number, not {_short(value)}."
    if bound := re.fullmatch(r"Expected `(?:float|int)` (>=|<=|>|<) (\S+)", what):
        return f"{place} must be {BOUND[bound[1]]} {float(bound[2]):g}, not {value:g}."
    if re.match(r"Invalid (enum )?value", what):
        choices = [
            str(choice) for one in options(node) if isinstance(one, inspect.LiteralType) for choice in one.values
        ]
        return f"{place} = {_short(value)} is unknown{nearest(str(value), choices)}"
    if re.match("Expected `", what):
        return f"{place} must be {_wanted(node)}, not {_short(value)}."
    return f"{spell_table(where, path)}: {what}"


def spell_table(where: str, path: Path) -> str:
    """Return "file [table.inner]" for a place in a table; members of an array of tables are counted from 1."""
    for word in path:
        if isinstance(word, int):
            where = re.sub(r"\[([^\[\]]*)\]$", r"[[\1]]", where) + f" number {word + 1}"
        elif where.endswith("]") and not where.endswith("]]"):
            where = f"{where[:-1]}.{word}]"
        else:
            where = f"{where} [{word}]"
    return where


def spell_place(where: str, path: Path) -> str:
    """Return "file [table.inner]: key" for a place in a table; members of a list of numbers are counted from 0."""
    names = [k for k, word in enumerate(path) if isinstance(word, str)]
    last = names[-1] if names else 0
    key = ".".join(str(word) for word in path[last:])
    return f"{spell_table(where, path[:last])}: {key}" if key else where


def _wanted(node: inspect.Type) -> str:
    words = []
    for one in options(node):
        if isinstance(one, inspect.FloatType | inspect.IntType):
            words.append("a finite number")
        elif isinstance(one, inspect.StrType | inspect.LiteralType):
            words.append("text in quotes")
        elif isinstance(one, inspect.BoolType):
            words.append("true or false")
        elif isinstance(one, inspect.TupleType):
            words.append(f"a list of {len(one.item_types)} numbers")
        elif isinstance(one, inspect.ListType | inspect.VarTupleType):
            inner = plain_words(one.item_type)
            words.append(
                f"a list of {inner}" if one.min_length is None else f"a list of {one.min_length} or more {inner}"
            )
        elif isinstance(one, inspect.StructType):
            words.append("a table")
    return " or ".join(dict.fromkeys(words))


def plain_words(node: inspect.Type) -> str:
    """Return what the members of a list are called."""
    (one, *_) = options(node)
    if isinstance(one, inspect.TupleType):
        return "[position, value] pairs" if len(one.item_types) == 2 else "lists"
    return "tables" if isinstance(one, inspect.StructType) else "numbers"


def _leaves(raw: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    if isinstance(raw, Mapping):
        for key, value in raw.items():
            yield from _leaves(value, (*path, key))
    elif isinstance(raw, list):
        for place, value in enumerate(raw):
            yield from _leaves(value, (*path, place))
    else:
        yield path, raw


def _at(raw: Any, path: Path) -> Any:
    for word in path:
        try:
            raw = raw[cast(Any, word)]
        except (KeyError, IndexError, TypeError):
            return None
    return raw


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
