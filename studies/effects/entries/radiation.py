"""Radiation: the time constant shortens with the cube of the temperature."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import AROUND, Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States


def columns(states: States, shape: Shape, response: str) -> Array:
    """Heat ρ (g − 1)(T_h − T_r) reaches the resonator through its lags: the change of T_r over ρ.

    g = (T_h + T_r)(T_h² + T_r²)/(4 T₀³) for exchange between housing and resonator, or (T_r/T₀)³ for g(T_r); these are the lags
    at T₀. Where T_r is known without radiation only, `share_of_form` is the ρ at which it is solved for; at 0, T_r is
    right as it stands.
    """
    share, exchange = shape
    housing = states.housing
    change = np.zeros_like(housing)
    for _ in range(5 if share else 1):
        state = states.resonator + share * change
        if exchange:
            conductance = (housing + state) * (housing**2 + state**2) / (4.0 * AROUND**3)
        else:
            conductance = (state / AROUND) ** 3
        feed = (conductance - 1.0) * (housing - state)
        change = states.heated(np.concatenate([[0.0], feed]))[1:]  # τ y′ = −y + feed from y = 0
    return change[:, None]


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """One share is enough, for its form hardly changes with it; both laws of conductance."""
    return [(0.0, 1.0), (0.0, 0.0)]


def steady(x: Array, shape: Shape) -> Array:
    """What a soak of so many time constants at T₀ leaves of a step from there, its constant ∝ T⁻³."""
    return np.asarray((x * np.exp(-shape[0] * (1.0 + x / AROUND) ** 3))[:, None])


EFFECT = Effect(
    name="radiation",
    summary="part of the heat is radiated, so the thermal time constant is shorter when hot",
    source="Stefan-Boltzmann exchange linearised about 20 °C: conductance 4 ε σ A T³",
    isolate="the same step at a cold and at a hot mean temperature",
    coefficients=(Coefficient("radiated_share", most=1.0),),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 1.0},
    shape=(
        Parameter("share_of_form", 0.0, 1.0, "share at which the form is computed", steady=True),
        Parameter("exchange", 0.0, 1.0, "1: exchange with the housing, 0: by the resonator alone", False, True),
    ),
    acts_on="temperature",
    card_key="law.radiated_share",
    positive=True,
    sees_heat=True,
    steady=steady,
    steady_grid=lambda low, high: [(b,) for b in (3.0, 4.0, 5.0, 6.0, 8.0)],
    steady_words="incomplete soak with a time constant that depends on temperature",
)
