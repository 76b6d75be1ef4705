"""Thermometer scale: the housing sensor does not read linearly."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States, lag


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """The true housing temperature is T_s + e₂ x² + e₃ x³, x = T_s − T₀ in units of 10 K; it then passes the lag."""
    x = (states.housing - states.reference) / 10.0
    return np.stack([lag(x**power, states.step, states.tau) for power in (2, 3)], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="thermometer-scale",
    summary="the housing or chamber thermometer has a nonlinear scale error",
    source="interpolation error of a resistance thermometer, second and third order",
    isolate="repeat in another chamber or with a second thermometer; fast against slow ramps tell it from a curvature of f",
    responses=("frequency_Hz",),
    acts_on="temperature",
    coefficients=("quadratic_K_per_10K2", "cubic_K_per_10K3"),
    columns=columns,
    grid=grid,
    nested=True,
    fine=True,
)
