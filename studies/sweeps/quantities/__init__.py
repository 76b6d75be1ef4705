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
        quantity: type[Quantity] = importlib.import_module(f"{__name__}.{module.name}").QUANTITY
        found[str(quantity.__struct_config__.tag)] = quantity
    return found
