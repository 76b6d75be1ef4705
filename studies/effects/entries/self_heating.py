"""Self-heating: the power of the vibration warms the resonator above its housing."""

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States, lag


def columns(states: States, shape: Shape, response: str) -> Array:
    """τ T_r′ = T_h − T_r + R P with P ∝ A²: the change for 1 K/V²."""
    assert states.amplitude_squared is not None
    return lag(states.amplitude_squared, states.step, states.tau)[:, None]


EFFECT = Effect(
    name="self-heating",
    summary="the power of the vibration warms the resonator, delayed by the thermal time constant",
    source="energy balance of the resonator node with the drive power P = ω E / Q ∝ A²",
    isolate="step the drive amplitude at constant temperature: heating follows with the thermal lag, and the bias with it",
    coefficients=(Coefficient("heating_K_per_V2"),),
    columns=columns,
    sizes={"frequency_Hz": 10.0},
    acts_on="temperature",
    needs=("amplitude_squared",),
    positive=True,
)
