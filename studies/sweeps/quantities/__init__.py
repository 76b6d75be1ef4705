"""The quantities that a study can ask for: one file each, found by discovery."""

import importlib
import pkgutil
from functools import cache

from studies.sweeps.quantity import Quantity


@cache
def library() -> dict[str, type[Quantity]]:
    """Return every quantity of this folder by name."""
    found: dict[str, type[Quantity]] = {}
    for module in pkgutil.iter_modules(__path__):
        path = f"{__name__}.{module.name}"
        for one in vars(importlib.import_module(path)).values():
            if isinstance(one, type) and issubclass(one, Quantity) and one.__module__ == path:
                found[str(one.__struct_config__.tag)] = one
    return found
