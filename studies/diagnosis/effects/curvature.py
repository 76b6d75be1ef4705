"""Curvature: the frequency law has more bends than the material law knows."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """Static terms x³ … x⁶ of the frequency, x = T_r − T₀ in units of 10 K."""
    x = states.excess / 10.0
    return np.stack([x**order for order in range(3, 7)], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="curvature",
    summary="the frequency has a static dependence on temperature beyond the second order",
    source="HRG paper eqs. (16)-(18), third order and beyond",
    isolate="cover the whole temperature range slowly, in both directions",
    responses=("frequency_Hz",),
    coefficients=(
        "cubic_{unit}_per_10K3",
        "quartic_{unit}_per_10K4",
        "quintic_{unit}_per_10K5",
        "sextic_{unit}_per_10K6",
    ),
    columns=columns,
    grid=grid,
    nested=True,
)
