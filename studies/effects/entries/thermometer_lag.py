"""Thermometer lag: the sensor on the housing is slower than the housing."""

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Shape
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """The true housing temperature is T_s + τ_s dT_s/dt; behind the resonator's lags τ that adds τ_s Σ w d lag(T_s; τ)/dt."""
    rates = [w / tau for w, tau in zip(states.lags.housing, states.lags.times, strict=True)]
    return (states.housing * sum(rates) - states.lags.follow(states.housing, states.step, rates))[:, None]


EFFECT = Effect(
    name="thermometer-lag",
    summary="the housing or chamber thermometer is slow, so the resonator seems to run ahead of it",
    source="first-order sensor, T_true = T_s + τ_s dT_s/dt; thermistor beside a crystal in a temperature-compensated oscillator",
    isolate="step the chamber and compare with a bare thin-film sensor on the housing",
    sensor="a fast thermometer on the housing",
    coefficients=(Coefficient("sensor_time_constant_s"),),
    columns=columns,
    delay=-1,
    card_key="noise.housing_lag_s",
    sizes={"frequency_Hz": 300.0},
    acts_on="temperature",
    equivalents={"frequency_Hz": ("rate-frequency",)},
    positive=True,
)
