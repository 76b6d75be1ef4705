"""Rate bias: the bias follows the rate of the resonator temperature."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """B ∝ dT_r/dt, and its product with the temperature as in HRG paper eqs. (21), (22)."""
    return np.stack([states.rate, states.rate * states.excess], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="rate-bias",
    summary="a temperature gradient across the resonator turns the rate of temperature into bias",
    source="HRG paper eqs. (21), (22), terms k4 and k7",
    isolate="ramps at two rates or more; in a soak the bias must decay with the thermal time constant",
    responses=("bias_deg_per_h",),
    coefficients=("coefficient_{unit}_per_K_per_s", "product_{unit}_per_K2_per_s"),
    columns=columns,
    grid=grid,
    nested=True,
)
