"""Rate frequency: a gradient across the resonator shifts its frequency."""

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """δf ∝ dT_r/dt: the frequency responds to the gradient that a changing temperature brings."""
    return states.rate[:, None]


EFFECT = Effect(
    name="rate-frequency",
    summary="the frequency follows the rate of the temperature: a gradient across the resonator, not its mean temperature",
    source="dynamic temperature coefficient ã dT/dt, Ballato and Vig, Proc. 32nd Frequency Control Symposium (1978) 180",
    isolate="ramps at two rates or more; the bias, which follows the mean temperature, must not show it",
    sensor="two thermometers across the resonator's mount",
    coefficients=(Coefficient("coefficient_{unit}_per_K_per_s"),),
    columns=columns,
    delay=1,
    sizes={"frequency_Hz": 0.02},
    equivalents={"frequency_Hz": ("thermometer-lag",)},
)
