"""One spelling for everything that a result depends on, and the hashes made of it."""

import json
from collections.abc import Iterator, Mapping
from hashlib import blake2b
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shell.material import Material

PHYSICS_VERSION = "2"
"""Changes only when a computed result may change; results of another version are never mixed with these."""


def spell(value: Any) -> str:
    """Return JSON with sorted keys and no spaces; floats keep every digit, a date becomes its text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, default=str)


def digest(value: Any) -> str:
    """Return the hash of a value's one spelling."""
    return blake2b(spell(value).encode(), digest_size=16).hexdigest()


def spell_material(material: "Material") -> str:
    """Return a material's laws with all their numbers, so that an edited material file changes every key."""
    properties = {
        name: {"form": p.form, "numbers": dict(p.numbers), "uncertainty": dict(p.uncertainty)}
        for name, p in material.properties.items()
    }
    return spell({"range": [material.lowest, material.highest], "properties": properties})


def find_changes(old: Any, new: Any, path: str = "") -> Iterator[str]:
    """Say in words where two specs differ, key by key."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in sorted({*old, *new}):
            yield from find_changes(old.get(key), new.get(key), f"{path}.{key}" if path else str(key))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for place, (one, other) in enumerate(zip(old, new, strict=True), 1):
            yield from find_changes(one, other, f"{path}[{place}]")
    elif old != new:
        yield f"{path}: {_short(old)} -> {_short(new)}"


def _short(value: Any) -> str:
    text = "absent" if value is None else spell(value)
    return text if len(text) <= 60 else text[:57] + "..."
