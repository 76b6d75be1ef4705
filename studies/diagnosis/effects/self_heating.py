"""Self-heating: the power of the vibration warms the resonator above its housing."""

from collections.abc import Sequence

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States, lag


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """τ T_r′ = T_h − T_r + R P with P ∝ A²: the change for 1 K/V²."""
    assert states.amplitude_squared is not None
    return lag(states.amplitude_squared, states.step, states.tau)[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="self-heating",
    summary="the power of the vibration warms the resonator, delayed by the thermal time constant",
    source="energy balance of the resonator node with the drive power P = ω E / Q ∝ A²",
    isolate="step the drive amplitude at constant temperature: heating follows with the thermal lag, and the bias with it",
    responses=("frequency_Hz",),
    acts_on="temperature",
    needs=("amplitude_squared",),
    coefficients=("heating_K_per_V2",),
    positive=True,
    columns=columns,
    grid=grid,
    fine=True,
)
