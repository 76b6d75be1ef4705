"""Guard against other packages that are also called `shell`, `thermal`, `compensation` or `studies`."""

from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("shell", "thermal", "compensation", "studies")


def package_home(name: str) -> Path | None:
    """Return the file from which Python imports a package, or None when it finds none."""
    spec = find_spec(name)
    return Path(spec.origin).resolve() if spec and spec.origin else None


def find_name_clash() -> str | None:
    """Return one sentence naming a package that is not ours, or None when all four are."""
    home = Path(__file__).resolve().parents[2]
    for name in PACKAGES:
        origin = package_home(name)
        if origin != home / name / "__init__.py":
            return (
                f"the package '{name}' that Python imports is not the workbench's but {origin or 'missing'}; "
                f"uninstall the other one ('pip uninstall {name}') or use a virtual environment of its own."
            )
    return None
