"""The extended model: a card with the baseline calibrated and the named effects as `[[effect]]` tables.

Frequency: Young's modulus is rescaled so that the card has the measured f₀, the first two coefficients of `curvature` add the
rest of slope and curvature, and the mount's conductance is scaled so that the resonator lags its housing as measured. Bias
and loss: the tables `[bias]` and `[loss]`. Drives that a simulation does not have stay at the campaign's mean.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from studies.diagnosis.baseline import Followed, Lagged, Law
from studies.diagnosis.investigate import Diagnosis
from studies.diagnosis.model import Fit
from studies.effects.states import FloatArray
from studies.errors import InputError
from studies.law import law_of

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

WELL_CONDUCTING = 2000.0
"""Conductivity that makes shell, stem and base one lump behind the mount, W/(m K)."""


def relative_law(instrument: "Instrument", measured: FloatArray) -> Law:
    """Return the card's frequency over temperature (K), continued beyond its range for the trial states of a fit.

    Raises
    ------
    ShellError
        If a measured temperature, K, lies outside the law's range.
    """
    material = instrument.material
    material.check(measured)
    law = law_of(instrument, material.lowest, material.highest)

    def frequency(temperature: FloatArray) -> FloatArray:
        return law.frequency(temperature, extrapolate=True)

    return frequency


def extend(instrument: "Instrument", diagnosis: Diagnosis) -> "Instrument":
    """Return a new instrument that predicts what the diagnosis measured.

    Raises
    ------
    InputError
        If the diagnosis has no fitted response.
    """
    if not diagnosis.inquiries:
        raise InputError("nothing could be fitted, so there is no extended model to save.")
    effects: list[dict[str, Any]] = []
    extended = instrument
    clock = next((i.final for i in diagnosis.inquiries.values() if i.problem.response.thermometer), None)
    if clock is not None:
        extended, law = _calibrate_frequency(extended, clock)
        effects.append(law)
    for column, inquiry in diagnosis.inquiries.items():
        model = inquiry.final
        if column == "bias_deg_per_h":
            extended = extended.with_table("bias", _bias_table(model, clock))
        if column == "inverse_q":
            extended = extended.with_table("loss", _loss_table(model))
        effects += [_entry(model, k) for k, term in enumerate(model.terms) if not term.effect.once]
    return extended.with_table("effect", effects)


def _entry(model: Fit, index: int) -> dict[str, Any]:
    term, column = model.terms[index], model.problem.response.column
    values = model.coefficients_of(index)
    entry: dict[str, Any] = {"name": term.name, "response": column}
    entry |= {p.name: float(value) for p, value in zip(term.effect.shape, term.shape, strict=True)}
    if term.effect.sees_heat:  # the fit knew the temperature with it; a simulation has to solve for it
        entry[term.effect.shape[0].name] = float(np.clip(values[0], 0.0, 1.0))
    return entry | term.effect.numbers(values, column)


def _beside_temperature(model: Fit) -> float:
    """What effects of drives add at the campaign's mean drive, and what events leave at its end."""
    added = 0.0
    for k, term in enumerate(model.terms):
        if term.effect.thermal:
            continue
        places = model.columns_of(k)
        change = model.linear.columns[:, places] @ model.solved.coefficients[places]
        if term.effect.needs:
            added += float(change.mean())
        elif term.effect.once:
            added += float(change[-1])
    return added


def _calibrate_frequency(instrument: "Instrument", model: Fit) -> "tuple[Instrument, dict[str, Any]]":
    baseline = model.baseline
    if not isinstance(baseline, Lagged):
        raise InputError("the frequency was not fitted over a temperature, so there is no law to save.")
    reference = instrument.reference_temperature
    low = min(float(s.housing.min()) for s in baseline.states) - 1.0
    high = max(float(s.housing.max()) for s in baseline.states) + 1.0
    own_law = law_of(instrument, min(low, reference - 5.0), max(high, reference + 5.0))
    values = model.values()
    f0 = values["level"] + _beside_temperature(model)
    factor = (f0 / float(own_law.frequency(np.array([reference]))[0])) ** 2
    modulus = float(instrument.material.value("youngs_modulus", reference)) * factor
    extended = instrument.with_values({"material.youngs_modulus_GPa": modulus / 1e9})
    T = np.linspace(low, high, 61)
    x = (T - reference) / 10.0
    measured = values["curvature"] * x**2
    if baseline.law is None:
        measured = measured + values["slope"] * x
    else:
        ends = baseline.law(np.array([reference - 0.5, reference + 0.5]))
        at = baseline.law(np.array([reference]))
        measured = measured + values["slope"] / 10.0 * (baseline.law(T) - at) / (ends[1] - ends[0])
    own = np.sqrt(factor) * (own_law.frequency(T) - own_law.frequency(np.array([reference])))
    slope, quadratic = np.linalg.lstsq(np.stack([x, x**2], axis=1), measured - own, rcond=None)[0]
    law = {
        "name": "curvature",
        "response": "frequency_Hz",
        "from_degC": low - 273.15,
        "to_degC": high - 273.15,
        "slope_Hz_per_10K": float(slope),
        "quadratic_Hz_per_10K2": float(quadratic),
    }
    return _calibrate_lag(extended, baseline.tau), law


def _calibrate_lag(instrument: "Instrument", tau: float) -> "Instrument":
    """Scale the mount's conductance and exchange until the resonator's slowest constant behind the housing is `tau`."""
    from scipy.optimize import brentq

    from studies.simulation.heat_path import build_network, slowest_lag

    # one lag and nothing else: what the gyro has beyond it is an effect, and must not be counted twice
    lump = {"conductivity_W_per_m_K": WELL_CONDUCTING, "radiation": False, "cells": 1}
    mount = ("mount_conductance_W_per_K", "mount_exchange_cm2")

    def scaled(log_factor: float) -> "Instrument":
        factor = float(np.exp(log_factor))
        given = {key: getattr(instrument.thermal, key) * factor for key in mount}
        return instrument.with_values({f"thermal.{key}": value for key, value in (lump | given).items()})

    def miss(log_factor: float) -> float:
        lag = slowest_lag(build_network(scaled(log_factor)), instrument.reference_temperature)
        return float(np.log(lag / tau))

    low, high = -5.0, 5.0
    if miss(low) * miss(high) > 0:
        return scaled(low if abs(miss(low)) < abs(miss(high)) else high)
    return scaled(float(brentq(miss, low, high, xtol=1e-3)))


def _bias_table(model: Fit, clock: Fit | None) -> dict[str, float]:
    values = model.values()
    offsets = [value for name, value in values.items() if name.startswith("offset@")]
    table = {"damping_anisotropy": 0.0, "offset_deg_per_h": float(np.mean(offsets)) + _beside_temperature(model)}
    if clock is not None and isinstance(model.baseline, Followed):
        slope = clock.values()["slope"]
        for power, name in enumerate(("slope", "curvature", "cubic"), 1):
            unit = "Hz" if power == 1 else f"Hz{power}"
            table[f"k{power}_deg_per_h_per_{unit}"] = float(values[name] / slope**power)
    return table


def _loss_table(model: Fit) -> dict[str, float]:
    values = model.values()
    q0 = values["level"] + _beside_temperature(model)
    return {
        "inverse_q": q0,
        "slope_per_K": values["slope"] / 10.0 / q0,
        "curvature_per_K2": values["curvature"] / 100.0 / q0,
    }
