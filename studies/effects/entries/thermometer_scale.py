"""Thermometer scale: the housing sensor does not read linearly."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """The true housing temperature is T_s + Σ e_k x^k, k = 2, 3, 4, x = T_s − T₀ in units of 10 K; the resonator follows that.

    A sensor that was exchanged or wired anew has it from one run on, with another slope, e₁, and zero, e₀.
    """
    (begin,) = shape
    x = (states.housing - states.reference) / 10.0
    error = np.stack([x**power for power in (2, 3, 4, 1, 0)], axis=1)
    return states.behind(error) * float(states.run >= begin)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """One sensor for all runs, or another one from any run on."""
    return [(float(run),) for run in range(span.runs)]


def steady(x: Array, shape: Shape) -> Array:
    """Powers from the third to the named one: the second is the law's curvature."""
    return np.stack([(x / 10.0) ** power for power in range(3, int(shape[0]) + 1)], axis=1)


EFFECT = Effect(
    name="thermometer-scale",
    summary="the housing or chamber thermometer has a nonlinear scale error",
    source="interpolation error of a resistance thermometer, second and third order",
    isolate="repeat in another chamber or with a second thermometer; fast and slow ramps distinguish it from a curvature of f",
    sensor="a second thermometer on the housing",
    coefficients=(
        Coefficient("quadratic_K_per_10K2"), Coefficient("cubic_K_per_10K3", (0.3,)),
        Coefficient("quartic_K_per_10K4", (0.05,)), Coefficient("slope_K_per_10K"), Coefficient("zero_K"),
    ),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 0.3},
    shape=(Parameter("from_run", 0.0, 1e4, "first run with this error, counted from 0", False, True),),
    acts_on="temperature",
    of_law=lambda shape: () if shape[0] else (3, 4),  # slope and zero of a sensor that stays
    steady=steady,
    steady_grid=lambda low, high: [(3.0,), (4.0,)],
    steady_words="thermometer error up to order {0:.0f}",
)  # fmt: skip
