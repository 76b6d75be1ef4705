"""Dotted names of a card's keys: `resonator.stem.radius_mm`; a whole number is a place in a list, from 0."""

from collections.abc import Iterator, Mapping
from typing import Any

from studies.instrument.uncertain import is_spread


def look_up(content: Mapping[str, Any], name: str) -> Any:
    """Return what stands at a dotted name; of a number with its uncertainty, the number."""
    found: Any = content
    for word in name.split("."):
        found = found[int(word)] if isinstance(found, list) else found[word]
    return plain_number(found)


def plain_number(value: Any) -> Any:
    """Return the number of a value with its uncertainty, anything else as it is."""
    return value["value"] if is_spread(value) else value


def replaced(content: Any, path: list[str], value: Any) -> Any:
    """Return the content with another value at a path; a plain number keeps the uncertainty that stands beside it."""
    if not path:
        if is_spread(content) and not isinstance(value, Mapping):
            exact = {"relative_sd": 0.0} if value == 0 and "relative_sd" in content else {}  # a part of 0 is 0
            return {**content, "value": value, **exact}
        return value
    if isinstance(content, list):
        place = int(path[0])
        return [*content[:place], replaced(content[place], path[1:], value), *content[place + 1 :]]
    if not isinstance(content, Mapping):
        raise TypeError(f"{content!r} is neither a table nor a list")
    return {**content, path[0]: replaced(content.get(path[0], {} if path[1:] else None), path[1:], value)}


def names(content: Any, before: str = "") -> Iterator[str]:
    """Yield the dotted name of every number and text in a table."""
    items = enumerate(content) if isinstance(content, list) else content.items()
    for key, value in items:
        if isinstance(value, Mapping | list) and not is_spread(value):
            yield from names(value, f"{before}{key}.")
        else:
            yield f"{before}{key}"
