"""Clock drift: the gyro's own clock runs ever faster or slower."""

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """Measured frequency f (1 + c t): a straight line in time, per day."""
    return (states.campaign_time / 86400.0)[:, None]


EFFECT = Effect(
    name="clock-drift",
    dated=True,
    summary="the clock that counts the frequency drifts",
    source="f_measured = f (1 + c t)",
    isolate="count the same frequency with a reference clock (column reference_frequency_Hz)",
    sensor="a reference clock (reference_frequency_Hz)",
    coefficients=(Coefficient("drift_{unit}_per_day"),),
    columns=columns,
    sizes={"frequency_Hz": 2e-5},
    equivalents={"frequency_Hz": ("ageing",)},
    judge="reference_frequency_Hz",
    event=True,
)
