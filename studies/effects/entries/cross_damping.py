"""Cross-damping: the damping axes do not follow the wave, and their coupling changes with temperature."""

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import ORDERS, States, lag, smoothness, waves


def columns(states: States, shape: Shape, response: str) -> Array:
    """B ∝ ζ₁₂(T) sin 4(θ − θ_τ) through the loop's eq. (9): orders 0 … 7 of x = T_r − T₀ in units of 10 K, and smooth waves."""
    low, high, pole, axis = shape
    x = states.excess / 10.0
    curve = np.concatenate([x[:, None] ** np.arange(8), waves(states.resonator - zero_Celsius, low, high)], axis=1)
    if axis == STILL:
        curve = curve * FIXED
    elif states.pattern_angle is None:
        return np.zeros_like(curve)
    else:
        curve = np.asarray(curve * np.sin(4 * (states.pattern_angle - np.radians(axis)))[:, None])
    if not pole:
        return curve
    return lag(curve, states.step, pole)  # eq. (9) is a lag 1/(kζ)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """At once, behind a loop and behind a slow one; axes a tenth of a half period apart, and none where the wave stands still."""
    ends = span.temperature_low - zero_Celsius, span.temperature_high - zero_Celsius
    axes = (STILL, *np.arange(0.0, 50.0, 5.0).tolist()) if span.turns else (STILL,)
    return [(*ends, pole, axis) for pole in POLES for axis in axes]


POLES = (0.0, 20.0, 60.0)  # time constants of the loop, s
STILL = -90.0  # axis of a wave that stands still: none
FIXED = np.array([0.0] * 4 + [1.0] * (4 + ORDERS - 1))
"""At one azimuth the baseline has the terms up to the third order."""


EFFECT = Effect(
    name="cross-damping",
    summary="the coupling through damping changes with temperature beyond the third order",
    source="CVG paper eqs. (9), (10)",
    isolate="turn the wave to another azimuth: damping bias goes as sin 4(θ − θ_τ)",
    sensor="the pattern angle, moved to two azimuths or more",
    coefficients=(
        Coefficient("constant_{unit}", (10.0,)), Coefficient("slope_{unit}_per_10K", (5.0,)),
        Coefficient("quadratic_{unit}_per_10K2", (2.0,)), Coefficient("cubic_{unit}_per_10K3", (1.0,)),
        Coefficient("quartic_{unit}_per_10K4", (0.5,)), Coefficient("quintic_{unit}_per_10K5", (0.2,)),
        Coefficient("sextic_{unit}_per_10K6", (0.05,)), Coefficient("septic_{unit}_per_10K7", (0.02,)),
        Coefficient("waves_{unit}", smoothness(5.0)),
    ),
    columns=columns,
    grid=grid,
    sizes={"bias_deg_per_h": 1.0},
    shape=(
        Parameter("from_degC", -273.0, 500.0, "lower end of the smooth curve", False, True),
        Parameter("to_degC", -273.0, 500.0, "upper end of the smooth curve", False, True),
        Parameter("pole_s", 0.0, 3600.0, "time constant of the loop behind the curve", True, True, refined=True),
        Parameter("axis_deg", STILL, 90.0, "azimuth of the damping axis; -90: the wave stands still", False, True, refined=True),
    ),
)  # fmt: skip
