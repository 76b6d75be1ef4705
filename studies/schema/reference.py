"""Reference of declared keys: every key of a file with its unit, default, bounds, documented uncertainty and meaning."""

from collections.abc import Iterator
from typing import Any

from msgspec import NODEFAULT, inspect

from studies.instrument.units import unit_of
from studies.schema.keys import describe, number_in, options, structs
from studies.schema.reader import BOUNDS, spell_wanted


def list_keys(keys: Any, table: str = "") -> Iterator[dict[str, Any]]:
    """Yield a row for every key of a class and of the tables in it; `table` as it is headed in the file, such as [loss]."""
    seen = []
    for row in _rows(describe(keys), table):
        if row not in seen:  # a stem is the same under every shape
            seen.append(row)
            yield row


def _rows(node: inspect.Type, table: str) -> Iterator[dict[str, Any]]:
    for struct in structs(node):
        inner: list[tuple[inspect.Type, str]] = []
        shape = {} if struct.tag is None else {"only": f"{struct.tag_field} = {struct.tag}"}
        for field in struct.fields:
            kinds = [*options(field.type)]
            below = [one for kind in kinds for one in (kind, getattr(kind, "item_type", kind)) if structs(one)]
            if below:
                many = below[0] not in kinds
                path = ".".join(word for word in (table.strip("[]"), field.encode_name) if word)
                inner.append((below[0], f"[[{path}]]" if many else f"[{path}]"))
            else:
                yield {"table": table, "key": field.encode_name, **_describe(field), **shape}
        for one, heading in inner:
            yield from _rows(one, heading)


def _describe(field: inspect.Field) -> dict[str, Any]:
    """Return what a field says of its key."""
    parts = field.type.types if isinstance(field.type, inspect.UnionType) else (field.type,)
    noted = [one for one in parts if isinstance(one, inspect.Metadata)]
    said = {key: value for one in noted for key, value in (one.extra_json_schema or {}).items()}
    prior = {key: value for one in noted for key, value in (one.extra or {}).items()}
    number = number_in(field.type)
    ends = [(words, getattr(number, end, None)) for end, words in BOUNDS.items()]
    given = field.default is not NODEFAULT and field.default is not None and field.default != ()
    words = [str(word) for one in options(field.type) if isinstance(one, inspect.LiteralType) for word in one.values]
    return {
        "unit": None if number is None else unit_of(field.encode_name),
        "type": " | ".join(words) or spell_wanted(options(field.type)).replace("a finite number", "a number"),
        "required": field.required,
        "default": field.default if given else None,
        "bounds": ", ".join(f"{words} {end:g}" for words, end in ends if end is not None) or None,
        "sd": prior.get("sd"),
        "relative_sd": prior.get("relative_sd"),
        "meaning": said.get("description"),
        "example": next(iter(said.get("examples", ())), None),
    }
