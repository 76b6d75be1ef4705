"""Electrostatic softening: the electrodes' field acts as a negative spring."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """δf = −k V², at once, as of the electrodes of a card at a gap that stays; V⁴ of the root f √(1 + δ(ω²)/ω²), and as the field narrows the gap."""
    power = states.voltage_squared
    assert power is not None
    return np.stack([-power, -(power**2)], axis=1)


EFFECT = Effect(
    name="electrostatic-softening",
    summary="the electrode voltage softens the resonator: the frequency falls with its square",
    source="negative spring ε₀ A V²/g³ of a biased gap",
    isolate="step the electrode voltage at constant temperature: an instant change, proportional to its square",
    coefficients=(Coefficient("softening_{unit}_per_V2"), Coefficient("narrowing_{unit}_per_V4", (1e-5,))),
    columns=columns,
    sizes={"frequency_Hz": 2e-8},
    needs=("voltage_squared",),
    positive=True,
)
