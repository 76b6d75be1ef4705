"""Electrostatic softening: the electrodes' field acts as a negative spring."""

from collections.abc import Sequence

from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.states import FloatArray, States


def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """δf = −k V², at once."""
    assert states.voltage_squared is not None
    return -states.voltage_squared[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="electrostatic-softening",
    summary="the electrode voltage softens the resonator: the frequency falls with its square",
    source="negative spring ε₀ A V²/g³ of a biased gap",
    isolate="step the electrode voltage at constant temperature: an instant change, proportional to its square",
    responses=("frequency_Hz",),
    needs=("voltage_squared",),
    coefficients=("softening_{unit}_per_V2",),
    positive=True,
    columns=columns,
    grid=grid,
)
