"""Reference of declared keys, with unit, default, bounds, uncertainty and meaning; and forms of files to start from."""

from collections.abc import Iterable, Iterator, Mapping
from math import isfinite
from typing import Any

from msgspec import NODEFAULT, inspect

from studies.instrument.units import unit_of
from studies.schema.keys import bounds, describe, number_in, options, spell_value, structs
from studies.schema.reader import BOUNDS, spell_wanted


def list_keys(keys: Any, table: str = "") -> Iterator[dict[str, Any]]:
    """Yield a row for every key of a class and of the tables in it; `table` as it is headed in the file, such as [loss]."""
    seen = []
    for heading, only, field in _fields(describe(keys), table):
        row = {"table": heading, "key": field.encode_name, **_describe(field), **({"only": only} if only else {})}
        if row not in seen:  # a stem is the same under every shape
            seen.append(row)
            yield row


def write_form(tables: Iterable[tuple[Any, str]]) -> Iterator[str]:
    """Yield classes with their headings as lines of TOML, each of which holds when it is set alone; one heading opens once."""
    forms: dict[tuple[str, str], dict[str, str]] = {}
    for keys, table in tables:
        for heading, only, field in _fields(describe(keys), table):
            forms.setdefault((heading, only), {})[field.encode_name] = _write_line(field)
    for (heading, only), lines in forms.items():
        tag, _, name = only.partition(" = ")
        yield from ["", heading] if heading else []
        yield from [f"{tag} = {spell_value(name)}"] if only else []
        yield from lines.values()


def _fields(node: inspect.Type, table: str) -> Iterator[tuple[str, str, inspect.Field]]:
    """Yield the heading of every key, of shapes that a tag tells apart that tag, and the key; tables in it follow it."""
    for struct in structs(node):
        inner: list[tuple[inspect.Type, str]] = []
        only = "" if struct.tag is None else f"{struct.tag_field} = {struct.tag}"
        for field in struct.fields:
            kinds = [*options(field.type)]
            below = [one for kind in kinds for one in (kind, getattr(kind, "item_type", kind)) if structs(one)]
            if below:
                many = below[0] not in kinds
                path = ".".join(word for word in (table.strip("[]"), field.encode_name) if word)
                inner.append((below[0], f"[[{path}]]" if many else f"[{path}]"))
            else:
                yield table, only, field
        for one, heading in inner:
            yield from _fields(one, heading)


def _write_line(field: inspect.Field) -> str:
    """Return such as `cells = 24.0    # of the shell's meridian; 1 makes it a lump`."""
    row = _describe(field)
    value = row["default"] if row["default"] is not None else row["example"]
    line = f"{field.encode_name} = {spell_value(_make_example(field.type) if value is None else value)}"
    remark = "; ".join(word for word in (row["meaning"], " | ".join(_words(field)), spell_uncertainty(row)) if word)
    return f"{line:<36} # {remark}" if remark else line


def _make_example(node: inspect.Type) -> Any:
    """Return a value that a place may hold."""
    kind, (low, high) = options(node)[0], bounds(node)
    if isinstance(kind, inspect.LiteralType):
        return kind.values[0]
    if number_in(node) is not None:
        inside = (low + high) / 2 if isfinite(low + high) else low + 1.0 if isfinite(low) else min(high - 1.0, 1.0)
        return int(inside) if isinstance(kind, inspect.IntType) else inside
    return "..." if isinstance(kind, inspect.StrType) else []


def _words(field: inspect.Field) -> list[str]:
    """Return the words from which a text is one."""
    return [str(word) for one in options(field.type) if isinstance(one, inspect.LiteralType) for word in one.values]


def spell_uncertainty(row: Mapping[str, Any]) -> str:
    """Return such as "± 50 %": how well a number of a card is known where the card does not say so."""
    return f"± {row['sd']:g}" if row["sd"] else f"± {100 * row['relative_sd']:g} %" if row["relative_sd"] else ""


def _describe(field: inspect.Field) -> dict[str, Any]:
    parts = field.type.types if isinstance(field.type, inspect.UnionType) else (field.type,)
    noted = [one for one in parts if isinstance(one, inspect.Metadata)]
    said = {key: value for one in noted for key, value in (one.extra_json_schema or {}).items()}
    prior = {key: value for one in noted for key, value in (one.extra or {}).items()}
    number = number_in(field.type)
    ends = [(words, getattr(number, end, None)) for end, words in BOUNDS.items()]
    given = field.default is not NODEFAULT and field.default is not None and field.default != ()
    return {
        "unit": None if number is None else said.get("unit") or unit_of(field.encode_name),
        "type": " | ".join(_words(field)) or spell_wanted(options(field.type)).replace("a finite number", "a number"),
        "required": field.required,
        "default": field.default if given else None,
        "bounds": ", ".join(f"{words} {end:g}" for words, end in ends if end is not None) or None,
        "sd": prior.get("sd"),
        "relative_sd": prior.get("relative_sd"),
        "meaning": said.get("description"),
        "example": next(iter(said.get("examples", ())), None),
    }
