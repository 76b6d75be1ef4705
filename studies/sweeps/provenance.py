"""Where results come from: versions of everything, the commit, and the hash of the lock file."""

import json
import platform
import subprocess
import sys
from collections.abc import Iterator, Mapping
from hashlib import blake2b, sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from shell.material import Material
from studies.files.given import shorten

PACKAGES = ("hrg-workbench", "numpy", "scipy", "pandas", "dask", "distributed")


def describe_environment() -> dict[str, Any]:
    """Return versions, machine, commit and lock hash; what cannot be found is left out."""
    home = Path(__file__).parents[2]
    lock = home / "uv.lock"
    found = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "packages": {name: text for name in PACKAGES if (text := _version(name))},
        "command": " ".join(Path(word).name if place == 0 else word for place, word in enumerate(sys.argv)),
        "commit": _commit(home),
        "lock_sha256": sha256(lock.read_bytes()).hexdigest() if lock.is_file() else None,
    }
    return {key: value for key, value in found.items() if value is not None}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _commit(home: Path) -> str | None:
    if not (home / ".git").exists():
        return None
    words = ["git", "-C", str(home), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


PHYSICS_VERSION = "2"
"""Changes only when a computed result may change; results of another version are never mixed with these."""


def spell(value: Any) -> str:
    """Return JSON with sorted keys and no spaces; floats keep every digit, a date becomes its text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, default=str)


def digest(value: Any) -> str:
    """Return the hash of a value's one spelling."""
    return blake2b(spell(value).encode(), digest_size=16).hexdigest()


def spell_material(material: Material) -> str:
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
        was, now = (shorten("absent" if value is None else spell(value)) for value in (old, new))
        yield f"{path}: {was} -> {now}"
