"""The library of physical effects: one file an effect in `entries`, found by discovery; the same fits a record and runs in a simulation."""

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
from studies.effects.states import Lags, States

__all__ = [
    "Coefficient", "Effect", "Lags", "Parameter", "Span", "States", "apply_effect", "apply_effects", "find_effect",
    "library",
]  # fmt: skip
