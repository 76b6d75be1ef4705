"""The library of physical effects, below simulation and diagnosis: one file an effect in `entries`, found by discovery.

The same effect fits a record (a family: its first column of each coefficient is the definite curve, the others are what
nature may add to it) and runs forward in a simulation from the numbers of an `[[effect]]` table.
"""

from studies.effects.effect import (
    Coefficient,
    Effect,
    Parameter,
    Span,
    apply_effect,
    apply_effects,
    find_effect,
    library,
)
from studies.effects.states import States

__all__ = [
    "Coefficient",
    "Effect",
    "Parameter",
    "Span",
    "States",
    "apply_effect",
    "apply_effects",
    "find_effect",
    "library",
]
