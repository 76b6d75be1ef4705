"""The keys of a card's tables, declared as typed fields: `class Loss(Table)` says keys, types, bounds and uncertainties.

msgspec reads a table into its class: of msgspec, pydantic, and attrs with cattrs it has strict types and bounds and starts
in a tenth of pydantic's time. `studies.instrument.mending` turns what it refuses into sentences.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

Path = tuple[str | int, ...]
T = TypeVar("T")


class Keys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a card; its fields are the keys, in the units of their names."""


def number(
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    most: float | None = None,
    sd: float | None = None,
    relative_sd: float | None = None,
) -> msgspec.Meta:
    """Annotate a number with its bounds and with the uncertainty that it has where the card states none.

    Parameters
    ----------
    above, least, below, most : bounds, in the unit of the key.
    sd, relative_sd : standard deviation of the default and of any plain number in the card, in the unit of the key or as a
        part of the value; without either a plain number is taken as exact.
    """
    prior = {key: value for key, value in (("sd", sd), ("relative_sd", relative_sd)) if value is not None}
    ends: Any = {"gt": above, "ge": least, "lt": below, "le": most}
    return msgspec.Meta(**ends, extra=prior or None)


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
    return [plain(one) for one in node.types] if isinstance(node, inspect.UnionType) else [node]


def structs(node: inspect.Type, value: Any = None) -> list[inspect.StructType]:
    """Return the tables that a value may be; of shapes that a tag tells apart, the one that `value` names."""
    found = [one for one in options(node) if isinstance(one, inspect.StructType)]
    tagged = [one for one in found if isinstance(value, Mapping) and one.tag == value.get(str(one.tag_field))]
    return tagged or found


def find(keys: Any, path: Path, raw: Any) -> inspect.Type | None:
    """Return the description of the place that a path leads to in a table `raw`, None where there is none."""
    node: inspect.Type | None = describe(keys)
    for word in path:
        node = _enter(node, word, raw) if node is not None else None
        try:
            raw = raw[word]
        except (KeyError, IndexError, TypeError):
            raw = None
    return node


def _enter(node: inspect.Type, word: str | int, raw: Any) -> inspect.Type | None:
    for one in options(node):
        if isinstance(word, int) and isinstance(one, inspect.ListType | inspect.VarTupleType):
            return one.item_type
        if isinstance(word, int) and isinstance(one, inspect.TupleType) and word < len(one.item_types):
            return one.item_types[word]
    tags = [one.tag for one in structs(node) if one.tag_field == word]
    if tags:
        return inspect.LiteralType(tuple(str(tag) for tag in tags))
    for struct in structs(node, raw) if isinstance(word, str) else ():
        for field in struct.fields:
            if field.encode_name == word:
                return field.type
    return None


def holds_number(node: inspect.Type | None) -> bool:
    """Return whether a place may hold a number."""
    return node is not None and any(isinstance(one, inspect.FloatType | inspect.IntType) for one in options(node))


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


def bounds(node: inspect.Type | None) -> tuple[float, float]:
    """Return the lowest and highest number that a place may hold."""
    for one in options(node) if node is not None else ():
        if isinstance(one, inspect.FloatType | inspect.IntType):
            low = [float(end) for end in (one.gt, one.ge) if end is not None]
            high = [float(end) for end in (one.lt, one.le) if end is not None]
            return max(low, default=-float("inf")), min(high, default=float("inf"))
    return -float("inf"), float("inf")


def priors(keys: Any, raw: Any) -> Iterator[tuple[Path, Mapping[str, float]]]:
    """Yield the places of a table that are uncertain where the card does not say so, and how much."""
    yield from _priors(describe(keys), raw, ())


def _priors(node: inspect.Type, raw: Any, before: Path) -> Iterator[tuple[Path, Mapping[str, float]]]:
    for struct in structs(node, raw):
        for field in struct.fields:
            path = (*before, field.encode_name)
            inner = raw.get(field.encode_name) if isinstance(raw, Mapping) else None
            for one in field.type.types if isinstance(field.type, inspect.UnionType) else (field.type,):
                if isinstance(one, inspect.Metadata) and one.extra:
                    yield path, one.extra
                elif isinstance(inner, list) and isinstance(one, inspect.ListType | inspect.VarTupleType):
                    for place, member in enumerate(inner):
                        yield from _priors(one.item_type, member, (*path, place))
                elif isinstance(inner, Mapping) and structs(one):
                    yield from _priors(one, inner, path)
