"""The workbench from Python: every public name by one import.

    import hrg

    card = hrg.load_card("hrg-30mm")
    run = hrg.simulate(card, "step 20 -10 5h", row=10)
    print(hrg.calibrate(card, run))

The names are those of `studies` (cards, records, simulation, calibration, diagnosis), `shell` (resonators and their modes), `thermal`
(networks) and `compensation` (models of arrays); each is imported when it is first used. The equations of the papers are modules:
`hrg.derivation`, `hrg.dynamics`, `hrg.demodulated`, `hrg.cross_damping`, `hrg.loop`, `hrg.piezo`.
"""

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
            globals()[name] = getattr(module, name)
            return globals()[name]
    raise AttributeError(f"module 'hrg' has no attribute '{name}'; dir(hrg) lists what there is")


def __dir__() -> list[str]:
    """List every public name."""
    return sorted({*MODULES, "__version__"}.union(*(import_module(package).__all__ for package in PACKAGES)))
