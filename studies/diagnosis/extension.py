"""The extended model: a card with the baseline calibrated and the named effects as `[[effect]]` tables.

Frequency: Young's modulus is rescaled so that the card has the measured f₀, the effect `calibration` adds the rest of
slope and curvature, and the mount's conductance is scaled so that the resonator lags its housing as measured. Bias and loss:
the tables `[bias]` and `[loss]`. Drives that a simulation does not have stay at the campaign's mean.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from studies.diagnosis.baseline import Law
from studies.diagnosis.fit import Fit
from studies.diagnosis.investigate import Diagnosis
from studies.errors import InputError
from studies.law import law_of

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

EVENTS = ("jump",)
WELL_CONDUCTING = 2000.0
"""Conductivity that makes shell, stem and base one lump behind the mount, W/(m K)."""


def relative_law(instrument: "Instrument", measured: "np.ndarray[Any, np.dtype[np.float64]]") -> Law:
    """Return the card's frequency over temperature (K), continued beyond its range for the trial states of a fit.

    Raises
    ------
    ShellError
        If a measured temperature, K, lies outside the law's range.
    """
    material = instrument.material
    material.check(measured)
    law = law_of(instrument, material.lowest, material.highest)

    def frequency(temperature: "np.ndarray[Any, np.dtype[np.float64]]") -> "np.ndarray[Any, np.dtype[np.float64]]":
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
    frequency = diagnosis.inquiries.get("frequency_Hz")
    if frequency is not None:
        fit = frequency.selection.fit
        extended, calibration = _calibrate_frequency(extended, fit)
        effects.append(calibration)
    for response, inquiry in diagnosis.inquiries.items():
        fit = inquiry.selection.fit
        if response == "bias_deg_per_h":
            extended = extended.with_table("bias", _bias_table(fit, frequency.selection.fit if frequency else None))
        if response == "inverse_q":
            extended = extended.with_table("loss", _loss_table(fit))
        effects += [_entry(fit, index, response) for index, term in enumerate(fit.terms) if term.name not in EVENTS]
    return extended.with_table("effect", effects)


def _entry(fit: Fit, index: int, response: str) -> dict[str, Any]:
    term = fit.terms[index]
    scale = float(fit.linear.coefficients[1]) if term.effect.acts_on == "temperature" else 1.0
    entry: dict[str, Any] = {"name": term.name, "response": response}
    entry |= {p.name: float(value) for p, value in zip(term.effect.shape, term.shape, strict=True)}
    if term.effect.sees_heat:  # the fit knew the temperature with it; a simulation has to solve for it
        entry["share_of_form"] = float(np.clip(fit.coefficients_of(index)[0] / scale, 0.0, 1.0))
    names = term.effect.coefficient_names(response, term.count)
    entry |= {name: float(value / scale) for name, value in zip(names, fit.coefficients_of(index), strict=True)}
    return entry


def _at_mean_drive(fit: Fit) -> float:
    """What effects of drives and lasting jumps add at the campaign's mean drive and end."""
    added = 0.0
    views = fit.problem.views(fit.problem.tau)
    for index, term in enumerate(fit.terms):
        part = fit.coefficients_of(index)
        if term.effect.needs and term.effect.acts_on == "response":
            columns = np.concatenate([term.effect.columns(v.coarse, term.shape, fit.problem.response) for v in views])
            added += float((columns[:, : term.count] @ part).mean())
        elif term.name == "jump" and term.shape[2]:
            added += float(part[0])
    return added


def _calibrate_frequency(instrument: "Instrument", fit: Fit) -> "tuple[Instrument, dict[str, Any]]":
    reference = instrument.reference_temperature
    low = min(float(s.housing.min()) for s in fit.problem.states) - 1.0
    high = max(float(s.housing.max()) for s in fit.problem.states) + 1.0
    own_law = law_of(instrument, min(low, reference - 5.0), max(high, reference + 5.0))
    f0 = float(fit.linear.coefficients[0]) + _at_mean_drive(fit)
    factor = (f0 / float(own_law.frequency(np.array([reference]))[0])) ** 2
    modulus = float(instrument.material.value("youngs_modulus", reference)) * factor
    extended = instrument.with_values({"material.youngs_modulus_GPa": modulus / 1e9})
    T = np.linspace(low, high, 61)
    x = T - reference
    law = fit.problem.law
    measured = fit.linear.coefficients[2] * x**2
    if law is None:
        measured = measured + fit.linear.coefficients[1] * x
    else:
        ends = law(np.array([reference - 0.5, reference + 0.5]))
        measured = measured + fit.linear.coefficients[1] * (law(T) - law(np.array([reference]))) / (ends[1] - ends[0])
    own = np.sqrt(factor) * (own_law.frequency(T) - own_law.frequency(np.array([reference])))
    slope, curvature = np.linalg.lstsq(np.stack([x, x**2], axis=1), measured - own, rcond=None)[0]
    calibration = {
        "name": "calibration",
        "response": "frequency_Hz",
        "slope_Hz_per_K": float(slope),
        "curvature_Hz_per_K2": float(curvature),
    }
    return _calibrate_lag(extended, fit.problem.tau), calibration


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


def _bias_table(fit: Fit, frequency: Fit | None) -> dict[str, float]:
    runs = len(fit.problem.states)
    coefficients = fit.linear.coefficients
    table = {"damping_anisotropy": 0.0, "offset_deg_per_h": float(np.mean(coefficients[3 : 3 + runs]))}
    if frequency is not None:
        slope = 10.0 * float(frequency.linear.coefficients[1])
        for power in (1, 2, 3):
            unit = "Hz" if power == 1 else f"Hz{power}"
            table[f"k{power}_deg_per_h_per_{unit}"] = float(coefficients[power - 1] / slope**power)
    return table


def _loss_table(fit: Fit) -> dict[str, float]:
    q0, slope, curvature = map(float, fit.linear.coefficients[:3])
    return {"inverse_q": q0, "slope_per_K": slope / q0, "curvature_per_K2": curvature / q0}
