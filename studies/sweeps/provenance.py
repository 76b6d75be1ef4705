"""Where results come from: versions of everything, the commit, and the hash of the lock file."""

import platform
import subprocess
import sys
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

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
