"""Published losses of materials and constants of films, from `losses.toml`."""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def _table() -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
    return tomllib.loads((files("shell") / "damping" / "losses.toml").read_text(encoding="utf-8"))


def known_losses(material: str) -> Mapping[str, Mapping[str, Any]]:
    """Bulk and surface loss of a material with their sources; empty where no source states any."""
    return _table()["material"].get(material, {})


def known_film(name: str) -> Mapping[str, Any]:
    """Constants of a film and their source; empty where it is not in the table."""
    return _table()["film"].get(name, {})


def film_names() -> tuple[str, ...]:
    """The films in the table."""
    return tuple(_table()["film"])
