"""Calibration: what the baseline's free slope and curvature add to a card's own frequency law."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """Linear and quadratic change of the frequency, x = T_r − T₀ in K."""
    return np.stack([states.excess, states.excess**2], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Never a candidate: the baseline has both terms."""
    return []


EFFECT = Effect(
    name="calibration",
    summary="slope and curvature of the measured frequency beyond the card's law (part of the baseline, not a finding)",
    source="free slope and curvature of the baseline",
    isolate="none: it is fitted always",
    responses=("frequency_Hz",),
    coefficients=("slope_{unit}_per_K", "curvature_{unit}_per_K2"),
    columns=columns,
    grid=grid,
)
