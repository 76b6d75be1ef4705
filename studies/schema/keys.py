"""Classes of keys: a field says name (with its unit), type, default, bounds, uncertainty and meaning of one key."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any

import msgspec
from msgspec import inspect

Path = tuple[str | int, ...]


class Keys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a file; its fields are the keys, in the units of their names."""


def number(
    meaning: str = "", *, above: float | None = None, least: float | None = None, below: float | None = None,
    most: float | None = None, sd: float | None = None, relative_sd: float | None = None, example: Any = None,
    unit: str | None = None,
) -> msgspec.Meta:  # fmt: skip
    """Annotate a number with its meaning, its bounds in the unit of the key, its uncertainty where a card states none (else exact), and its unit if the name has none."""
    prior = {key: value for key, value in (("sd", sd), ("relative_sd", relative_sd)) if value is not None}
    ends: Any = {"gt": above, "ge": least, "lt": below, "le": most}
    return msgspec.Meta(
        **ends,
        description=meaning or None,
        examples=None if example is None else [example],
        extra=prior or None,
        extra_json_schema=None if unit is None else {"unit": unit},
    )


def says(meaning: str, *, example: Any = None, least: int | None = None) -> msgspec.Meta:
    """Annotate a text, a truth, a list or a table with its meaning; `least` is a length."""
    return msgspec.Meta(description=meaning, examples=None if example is None else [example], min_length=least)


Note = Annotated[str, says("free text")]


@lru_cache(maxsize=256)
def describe(keys: Any) -> inspect.Type:
    """Return msgspec's description of a table's type."""
    return inspect.type_info(keys)


def plain(node: inspect.Type) -> inspect.Type:
    """Return a description without what annotates it."""
    while isinstance(node, inspect.Metadata):
        node = node.type
    return node


def options(node: inspect.Type) -> Sequence[inspect.Type]:
    """Return the types that a value may have."""
    node = plain(node)
    return [one for part in node.types for one in options(part)] if isinstance(node, inspect.UnionType) else [node]


def structs(node: inspect.Type, value: Any = None) -> list[inspect.StructType]:
    """Return the tables that a value may be; of shapes that a tag tells apart, the one that `value` names."""
    found = [one for one in options(node) if isinstance(one, inspect.StructType)]
    tagged = [one for one in found if isinstance(value, Mapping) and one.tag == value.get(str(one.tag_field))]
    return tagged or found


def number_in(node: inspect.Type) -> inspect.FloatType | inspect.IntType | None:
    """Return the number that a place may hold."""
    return next((one for one in options(node) if isinstance(one, inspect.FloatType | inspect.IntType)), None)


def holds_value(node: inspect.Type) -> bool:
    """Return whether a place may hold a number, a text or a truth: neither a table nor tables."""
    single = inspect.FloatType | inspect.IntType | inspect.StrType | inspect.LiteralType | inspect.BoolType
    return any(isinstance(one, single) for one in options(node))


def known_keys(node: inspect.Type, raw: Any = None) -> list[str]:
    """Return the keys that a table may have."""
    found: list[str] = []
    for struct in structs(node, raw):
        found += [struct.tag_field] if struct.tag_field else []
        found += [field.encode_name for field in struct.fields if field.encode_name not in found]
    return found


def bounds(node: inspect.Type) -> tuple[float, float]:
    """Return the lowest and highest number that a place may hold."""
    one = number_in(node)
    low = [float(end) for end in (one.gt, one.ge) if end is not None] if one else []
    high = [float(end) for end in (one.lt, one.le) if end is not None] if one else []
    return max(low, default=-float("inf")), min(high, default=float("inf"))


def priors(node: inspect.Type, raw: Any, before: Path = ()) -> Iterator[tuple[Path, inspect.Metadata]]:
    """Yield the places of a table that are uncertain where the card does not say so, with their description."""
    for struct in structs(node, raw):
        for field in struct.fields:
            path = (*before, field.encode_name)
            inner = raw.get(field.encode_name) if isinstance(raw, Mapping) else None
            for one in field.type.types if isinstance(field.type, inspect.UnionType) else (field.type,):
                if isinstance(one, inspect.Metadata) and one.extra:
                    yield path, one
                    continue
                bare = plain(one)
                if isinstance(inner, list) and isinstance(bare, inspect.ListType | inspect.VarTupleType):
                    for place, member in enumerate(inner):
                        yield from priors(bare.item_type, member, (*path, place))
                elif isinstance(inner, Mapping) and structs(bare):
                    yield from priors(bare, inner, path)


def spell_value(value: Any) -> str:
    """Return a text, a truth, a number, a list or a table as TOML on one line, with every digit."""
    import tomli_w

    if isinstance(value, list | tuple):
        return f"[{', '.join(map(spell_value, value))}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {spell_value(one)}' for key, one in value.items())} }}"
    if isinstance(value, float):
        return repr(float(value))
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")
