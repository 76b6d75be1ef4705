"""The quantities that a study can ask for: one file each, found by discovery."""

import importlib
import pkgutil
from functools import cache

from studies.errors import InputError, nearest
from studies.sweeps.quantity import Quantity


@cache
def library() -> dict[str, Quantity]:
    """Return every quantity of this folder by name."""
    found: dict[str, Quantity] = {}
    for module in pkgutil.iter_modules(__path__):
        quantity = importlib.import_module(f"{__name__}.{module.name}").QUANTITY
        found[quantity.name] = quantity
    return found


def find_quantity(name: str, where: str) -> Quantity:
    """Return the quantity called `name`; InputError names the nearest when there is none."""
    if name not in library():
        raise InputError(f"{where}: there is no quantity '{name}'{nearest(name, library())}")
    return library()[name]
