"""Electrostatic softening: the electrodes' field acts as a negative spring."""

from shell.electrodes import soften_at_gap
from studies.effects.effect import Coefficient, Effect, Shape, Span
from studies.effects.states import FloatArray, States


def columns(states: States, shape: Shape, response: str) -> FloatArray:
    """δf = −k V², at once, as of the electrodes of a card at a gap that stays."""
    assert states.voltage_squared is not None
    return soften_at_gap(-1.0, states.voltage_squared)[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """No shape parameter."""
    return [()]


EFFECT = Effect(
    name="electrostatic-softening",
    summary="the electrode voltage softens the resonator: the frequency falls with its square",
    source="negative spring ε₀ A V²/g³ of a biased gap",
    isolate="step the electrode voltage at constant temperature: an instant change, proportional to its square",
    coefficients=(Coefficient("softening_{unit}_per_V2"),),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 2e-8},
    needs=("voltage_squared",),
    positive=True,
)
