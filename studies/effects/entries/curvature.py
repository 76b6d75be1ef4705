"""Curvature: the frequency law has more curvature than the material law."""

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States, smoothness, waves


def columns(states: States, shape: Shape, response: str) -> Array:
    """Static terms x³ … x⁶ of the frequency, x = T_r − T₀ in units of 10 K, and smooth waves over the covered range."""
    x = states.excess / 10.0
    powers = np.stack([x**order for order in range(3, 7)], axis=1)
    return np.concatenate([powers, waves(states.resonator - zero_Celsius, shape[0], shape[1], FINE)], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """One smooth curve over the covered range."""
    return [(span.temperature_low - zero_Celsius, span.temperature_high - zero_Celsius)]


def steady(x: Array, shape: Shape) -> Array:
    """Powers from the third to the named one."""
    return np.stack([(x / 10.0) ** power for power in range(3, int(shape[0]) + 1)], axis=1)


FINE = 20  # half waves over the range: a frequency is measured so finely that a knee of a twentieth of it shows


EFFECT = Effect(
    name="curvature",
    summary="the frequency has a static dependence on temperature beyond the second order",
    source="HRG paper eqs. (16)-(18), third order and beyond; knees as a smooth curve",
    isolate="cover the whole temperature range slowly, in both directions",
    coefficients=(
        Coefficient("cubic_{unit}_per_10K3"),
        Coefficient("quartic_{unit}_per_10K4", (0.3,)),
        Coefficient("quintic_{unit}_per_10K5", (0.1,)),
        Coefficient("sextic_{unit}_per_10K6", (0.03,)),
        Coefficient("waves_{unit}", smoothness(5.0, FINE)),
    ),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 2e-5},
    shape=(
        Parameter("from_degC", -273.0, 500.0, "lower end of the smooth curve", False, True),
        Parameter("to_degC", -273.0, 500.0, "upper end of the smooth curve", False, True),
    ),
    steady=steady,
    steady_grid=lambda low, high: [(3.0,), (4.0,)],
    steady_words="curvature up to order {0:.0f}",
)
