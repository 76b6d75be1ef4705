"""Leak: gas enters the vacuum housing and damps the resonator."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """1/Q ∝ P/√T in the free molecular regime; a sealed housing has P ∝ T, so 1/Q grows as t √(T/T₀), per day."""
    return (states.campaign_time / 86400.0 * np.sqrt(states.resonator / states.reference))[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="leak",
    summary="gas leaks into the housing: the damping grows with time",
    source="free molecular gas damping, Christian, Vacuum 16 (1966) 175",
    isolate="store the gyro warm for a known time and repeat the run; heat the getter",
    responses=("inverse_q",),
    coefficients=("growth_per_day",),
    columns=columns,
    grid=grid,
)
