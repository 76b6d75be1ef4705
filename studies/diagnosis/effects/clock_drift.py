"""Clock drift: the gyro's own clock runs ever faster or slower."""

from collections.abc import Sequence

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """Measured frequency f (1 + c t): a straight line in time, per day."""
    return (states.campaign_time / 86400.0)[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="clock-drift",
    summary="the clock that counts the frequency drifts",
    source="f_measured = f (1 + c t)",
    isolate="count the same frequency with a reference clock (column reference_frequency_Hz)",
    responses=("frequency_Hz",),
    coefficients=("drift_{unit}_per_day",),
    columns=columns,
    grid=grid,
    equivalents={"frequency_Hz": ("ageing",)},
)
