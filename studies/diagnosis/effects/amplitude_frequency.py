"""Amplitude-frequency effect: the spring of a large vibration is not linear."""

from collections.abc import Sequence

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """Backbone of a cubic (Duffing) spring: δf = κ A², at once."""
    assert states.amplitude_squared is not None
    return states.amplitude_squared[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="amplitude-frequency",
    summary="the frequency depends on the vibration amplitude: a nonlinear spring",
    source="Duffing oscillator, Nayfeh and Mook, Nonlinear Oscillations (1979), backbone curve",
    isolate="step the drive amplitude at constant temperature: an instant change, which the bias does not follow",
    responses=("frequency_Hz",),
    needs=("amplitude_squared",),
    coefficients=("slope_{unit}_per_V2",),
    columns=columns,
    grid=grid,
)
