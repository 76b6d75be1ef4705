"""Cross-damping: the damping axes do not follow the wave, and their coupling changes with temperature."""

import numpy as np
from scipy.constants import zero_Celsius

from studies.effects.curves import ORDERS, smoothness, waves
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import FloatArray, States, lag


def columns(states: States, shape: Shape, response: str) -> FloatArray:
    """B ∝ ζ₁₂(T) sin 4(θ − θ_τ) behind the loop's pole: orders 4 … 7 of x = T_r − T₀ in units of 10 K, and smooth waves."""
    low, high, pole, axis = shape
    resonator = lag(states.resonator, states.step, pole) if pole > 0 else states.resonator
    x = (resonator - states.reference) / 10.0
    powers = [np.ones_like(x), x, x**2, x**3, *(x**order for order in range(4, 8))]
    curve = np.concatenate([np.stack(powers, axis=1), waves(resonator - zero_Celsius, low, high)], axis=1)
    if states.pattern_angle is None or axis < 0:
        return np.asarray(curve * FIXED)
    return np.asarray(curve * np.sin(4.0 * (states.pattern_angle - np.radians(axis)))[:, None])


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """At once and behind a slow loop; axes a tenth of a period apart, and -1 where the wave stands still."""
    ends = span.temperature_low - zero_Celsius, span.temperature_high - zero_Celsius
    return [(*ends, pole, axis) for pole in (0.0, 60.0) for axis in (-1.0, *np.arange(0.0, 45.0, 5.0).tolist())]


FIXED = np.array([0.0] * 4 + [1.0] * (4 + ORDERS - 1))
"""At one azimuth the baseline has the terms up to the third order."""


EFFECT = Effect(
    name="cross-damping",
    summary="the coupling through damping changes with temperature beyond the third order",
    source="CVG paper eqs. (9), (10)",
    isolate="turn the wave to another azimuth: damping bias goes as sin 4(θ − θ_τ)",
    sensor="the pattern angle, moved to two azimuths or more",
    coefficients=(
        Coefficient("constant_{unit}", (10.0,)),
        Coefficient("slope_{unit}_per_10K", (5.0,)),
        Coefficient("quadratic_{unit}_per_10K2", (2.0,)),
        Coefficient("cubic_{unit}_per_10K3", (1.0,)),
        Coefficient("quartic_{unit}_per_10K4", (0.5,)),
        Coefficient("quintic_{unit}_per_10K5", (0.2,)),
        Coefficient("sextic_{unit}_per_10K6", (0.05,)),
        Coefficient("septic_{unit}_per_10K7", (0.02,)),
        Coefficient("waves_{unit}", smoothness(5.0)),
    ),
    columns=columns,
    grid=grid,
    sizes={"bias_deg_per_h": 1.0},
    shape=(
        Parameter("from_degC", -273.0, 500.0, "lower end of the smooth curve", False, True),
        Parameter("to_degC", -273.0, 500.0, "upper end of the smooth curve", False, True),
        Parameter("pole_s", 0.0, 3600.0, "time constant of the loop behind the curve", False, True),
        Parameter("axis_deg", -1.0, 45.0, "azimuth of the damping axis; -1: the wave stands still", False, True),
    ),
    fine=True,
)
