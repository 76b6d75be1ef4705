"""Rate bias: the bias follows the rate of the resonator temperature."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States, lag


def columns(states: States, shape: Shape, response: str) -> Array:
    """B ∝ dT_r/dt, and its product with the temperature as in HRG paper eqs. (21), (22); the same behind 1 and 5 min."""
    late = [lag(states.rate, states.step, time) - states.rate for time in LATE]
    return np.stack([states.rate, states.rate * states.excess, *late], axis=1)


LATE = (60.0, 300.0)  # a gradient takes its time to build up, s


EFFECT = Effect(
    name="rate-bias",
    summary="a temperature gradient across the resonator turns the rate of temperature into bias",
    source="HRG paper eqs. (21), (22), terms k4 and k7",
    isolate="ramps at two rates or more; in a soak the bias must decay with the thermal time constant",
    sensor="two thermometers across the resonator's mount",
    coefficients=(
        Coefficient("coefficient_{unit}_per_K_per_s"),
        Coefficient("product_{unit}_per_K2_per_s", (0.03,)),
        Coefficient("late_{unit}_per_K_per_s", (0.3, 0.2)),
    ),
    columns=columns,
    sizes={"bias_deg_per_h": 1000.0},
)
