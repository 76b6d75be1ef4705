"""The extended model: the card calibrated, with the named effects as `[[effect]]` tables.

The frequency's values are the calibrated ones; bias and loss become the tables `[bias]` and `[loss]`. Drives that a simulation
does not have stay at the campaign's mean.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.diagnosis.baseline import Followed
from studies.diagnosis.investigate import Diagnosis
from studies.diagnosis.model import Fit
from studies.diagnosis.simulated import RATE_TERMS, Simulated
from studies.effects.states import FloatArray
from studies.errors import InputError
from studies.law import law_of

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

Law = Callable[[FloatArray], FloatArray]
"""A card's frequency over temperature, K; its scale does not matter."""


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
        calibrated = clock.moved()
        if isinstance(calibrated, Simulated):
            extended = calibrated.instrument
    for column, inquiry in diagnosis.inquiries.items():
        model = inquiry.final
        if column == "bias_deg_per_h":
            stated = instrument.content.get("bias", {})
            by_rate = {key: stated[key] for key in RATE_TERMS if key in stated} if clock is not None else {}
            extended = extended.with_table("bias", _bias_table(model, clock) | by_rate)
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


def _bias_table(model: Fit, clock: Fit | None) -> dict[str, float]:
    values = model.values()
    offsets = [value for name, value in values.items() if name.startswith("offset@")]
    table = {"damping_anisotropy": 0.0, "offset_deg_per_h": float(np.mean(offsets)) + _beside_temperature(model)}
    if clock is not None and isinstance(model.baseline, Followed):
        slope = 10.0 * hertz_per_kelvin(clock)
        for power, name in enumerate(("slope", "quadratic", "cubic"), 1):
            unit = "Hz" if power == 1 else f"Hz{power}"
            table[f"k{power}_deg_per_h_per_{unit}"] = float(values[name] / slope**power)
    return table


def hertz_per_kelvin(clock: Fit) -> float:
    """Slope of the frequency at the reference."""
    if isinstance(clock.baseline, Simulated):
        law, reference = clock.baseline.law, clock.baseline.card.reference_temperature
        return float(law.frequency(reference) * law.slope(reference))
    return clock.values()["slope"] / 10.0


def _loss_table(model: Fit) -> dict[str, float]:
    values = model.values()
    q0 = values["level"] + _beside_temperature(model)
    return {
        "inverse_q": q0,
        "slope_per_K": values["slope"] / 10.0 / q0,
        "curvature_per_K2": values["quadratic"] / 100.0 / q0,
    }
