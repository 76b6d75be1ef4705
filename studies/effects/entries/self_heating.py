"""Self-heating: the power of the vibration warms the resonator above its housing."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States, lag


def columns(states: States, shape: Shape, response: str) -> Array:
    """τ T_r′ = T_h − T_r + R P with P ∝ A²: the change for 1 K/V²; beside it what comes sooner, of heat that stays near the rim, and later, through the mount."""
    assert states.amplitude_squared is not None
    first = states.heated(states.amplitude_squared)
    others = [lag(states.amplitude_squared, states.step, states.tau * ratio) - first for ratio in RATIOS]
    return np.stack([first, *others], axis=1)


RATIOS = (0.1, 1.0 / 3.0, 3.0)  # of time constants


EFFECT = Effect(
    name="self-heating",
    summary="the power of the vibration warms the resonator, delayed by the thermal time constant",
    source="energy balance of the resonator node with the drive power P = ω E / Q ∝ A²",
    isolate="step the drive amplitude at constant temperature: heating follows with the thermal lag, and the bias with it",
    coefficients=(Coefficient("heating_K_per_V2"), Coefficient("sooner_or_later_K_per_V2", (0.5, 0.5, 0.5))),
    columns=columns,
    sizes={"frequency_Hz": 10.0},
    acts_on="temperature",
    needs=("amplitude_squared",),
    positive=True,
)
