"""The workbench from Python: every public name by one import.

    import hrg

    card = hrg.load_card("hrg-30mm")
    run = hrg.simulate(card, "step 20 -10 5h", row=10)
    print(hrg.calibrate(card, run))

The names are those of `studies` (cards, records, simulation, calibration, diagnosis), `shell` (resonators and their modes), `thermal`
(networks) and `compensation` (models of arrays); each is imported when it is first used. The equations of the papers are modules:
`hrg.derivation`, `hrg.dynamics`, `hrg.demodulated`, `hrg.cross_damping`, `hrg.loop`, `hrg.piezo`.
"""

import inspect
import re
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from compensation import *  # noqa: F403
    from shell import *  # noqa: F403
    from studies import *  # noqa: F403
    from thermal import *  # noqa: F403

PACKAGES = ("studies", "shell", "thermal", "compensation")
MODULES = {
    "derivation": "shell.derivation",
    "dynamics": "compensation.derivation",
    "demodulated": "compensation.demodulated",
    "cross_damping": "compensation.cross_damping",
    "loop": "compensation.loop",
    "piezo": "compensation.piezo",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name in MODULES:
        return import_module(MODULES[name])
    if name == "__version__":
        return import_module("studies").__version__
    for package in PACKAGES if not name.startswith("_") else ():
        if name in (module := import_module(package)).__all__:
            found = getattr(module, name)
            globals()[name] = _naming_its_argument(name, found) if inspect.isfunction(found) else found
            return globals()[name]
    raise AttributeError(f"module 'hrg' has no attribute '{name}'; dir(hrg) lists what there is")


def _naming_its_argument(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that says so where an error of Python's own comes of a first argument of another kind."""

    @wraps(function)
    def named(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except (AttributeError, TypeError, ValueError) as error:
            from studies.errors import UNUSABLE_INPUT, InputError

            first = next(iter(inspect.signature(function).parameters.values()))
            wanted = re.sub(r"[\w.]+\.(\w+)", r"\1", inspect.formatannotation(first.annotation)).strip("'")
            if isinstance(error, UNUSABLE_INPUT) or not args or _is_one(args[0], wanted):
                raise
            kind = type(args[0]).__name__
            raise InputError(f"hrg.{name}: give {first.name} as {wanted}, not {kind}; help(hrg.{name}) says more.") from error  # fmt: skip

    named.__module__ = __name__  # where pickle finds it
    return named


def _is_one(value: Any, wanted: str) -> bool:
    """Tell whether a value is of a kind that an annotation names; numbers and rows of anything are arrays."""
    kinds = {kind.__name__ for kind in type(value).__mro__[:-1]}
    kinds |= {"ArrayLike"} if kinds & {"int", "float", "generic", "list", "tuple", "ndarray", "Series"} else set()
    kinds |= {"float"} if kinds & {"int", "generic"} else set()
    kinds |= {"Sequence", "Iterable"} if kinds & {"list", "tuple", "ndarray"} else set()
    return bool(kinds & set(re.findall(r"\w+", wanted)))


def __dir__() -> list[str]:
    """List every public name."""
    return sorted({*MODULES, "__version__"}.union(*(import_module(package).__all__ for package in PACKAGES)))
