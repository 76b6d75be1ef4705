"""Cross-damping: the damping axes do not follow the wave, and their coupling changes with temperature."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """B ∝ ζ₁₂(T), the static terms of fourth to seventh order, x = T_r − T₀ in units of 10 K."""
    x = states.excess / 10.0
    return np.stack([x**order for order in range(4, 8)], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="cross-damping",
    summary="the coupling through damping changes with temperature beyond the third order",
    source="CVG paper eqs. (9), (10)",
    isolate="turn the wave to another azimuth: damping bias goes as sin 4(θ − θ_τ)",
    responses=("bias_deg_per_h",),
    coefficients=(
        "quartic_{unit}_per_10K4",
        "quintic_{unit}_per_10K5",
        "sextic_{unit}_per_10K6",
        "septic_{unit}_per_10K7",
    ),
    columns=columns,
    grid=grid,
    nested=True,
)
