"""Models of kind `frequency`: f(T) as a polynomial, HRG paper eqs. (16)–(18), and its C code.

The file has one part "frequency" (f0, a1, a2 …) and the setting `reference_temperature_degC`.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError
from studies.models.c_source import head, polynomial
from studies.models.file import Model, Source, make_part
from studies.record import COMPENSATED, Record

if TYPE_CHECKING:
    from compensation.frequency import FrequencyFit

VARIABLE = "temperature_degC"


def save_frequency(fit: "FrequencyFit", sources: tuple[Source, ...], made_by: str) -> Model:
    """Return a fitted curve as a model."""
    names = ["f0", *(f"a{k}" for k in range(1, fit.order + 1))]
    units = ["Hz", "Hz/degC", *(f"Hz/degC^{k}" for k in range(2, fit.order + 1))]
    return Model(
        kind="frequency",
        compensates="frequency_Hz",
        parts=(make_part("frequency", names, fit.coefficients, units, fit.covariance),),
        settings={"reference_temperature_degC": fit.reference_temperature_degC},
        validity={VARIABLE: fit.temperature_range_degC},
        sources=sources,
        made_by=made_by,
    )


def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, NDArray[np.float64]]:
    """Take the fitted temperature dependence out of the frequency: f − (f(T) − f₀), T the housing's.

    The curve is a settled one: while the housing's temperature moves, the resonator lags behind it and the
    difference stays in the result.
    """
    if model.compensates != "frequency_Hz":
        raise InputError(f"{model.path or 'model'}: a frequency model compensates frequency_Hz.")
    if "housing_temperature_degC" not in record:
        raise InputError("the column 'housing_temperature_degC' is missing; a frequency model needs the temperature.")
    T = record["housing_temperature_degC"]
    model.check_range(VARIABLE, T, extrapolate)
    coefficients = model.part("frequency").values
    change = np.polynomial.polynomial.polyval(T - model.number("reference_temperature_degC"), coefficients)
    return {f"{COMPENSATED}frequency_Hz": record["frequency_Hz"] - (change - coefficients[0])}


def emit_c(model: Model) -> str:
    """Return `hrg_frequency(T)` and `hrg_temperature(f, &ok)`, the inverse by bracketed bisection, in C99."""
    low, high = model.range_of(VARIABLE)
    reference = model.number("reference_temperature_degC")
    return f"""{head(model)}
{polynomial("hrg_frequency_about", "shift", model.part("frequency").values)}

/* Resonance frequency (Hz) at temperature_degC; valid from {low:g} to {high:g} degC. */
double hrg_frequency(double temperature_degC) {{
    return hrg_frequency_about(temperature_degC - ({reference!r}));
}}

/* Temperature (degC) at which the resonator has this frequency (Hz); *ok is 0 outside the calibrated range. */
double hrg_temperature(double frequency, int *ok) {{
    double low = {low!r}, high = {high!r};
    double sign = hrg_frequency(high) > hrg_frequency(low) ? 1.0 : -1.0;
    *ok = sign * (frequency - hrg_frequency(low)) >= 0.0 && sign * (hrg_frequency(high) - frequency) >= 0.0;
    for (int k = 0; k < 60; ++k) {{
        double middle = 0.5 * (low + high);
        if (sign * (hrg_frequency(middle) - frequency) < 0.0) low = middle; else high = middle;
    }}
    return 0.5 * (low + high);
}}
"""
