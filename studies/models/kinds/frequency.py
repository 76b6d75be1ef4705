"""Models of kind `frequency`: f(T) as a polynomial, HRG paper eqs. (16)–(18), its inverse, and their C code.

The file has one part "frequency" (f0, a1, a2 …) and the setting `reference_temperature_degC`. The range is that of the
fit, widened by 5 % of its length on either side because readings scatter, as far as the curve does not turn round there.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError
from studies.models.c_source import head, polynomial, self_test
from studies.models.file import Model, ModelSource, make_part
from studies.plausible import check_model_frequency
from studies.record import COMPENSATED, Record

if TYPE_CHECKING:
    from compensation.frequency import FrequencyFit

Array = NDArray[np.float64]
VARIABLE = "temperature_degC"
WIDENED = 0.05
GRID = 2001


def save_frequency(fit: "FrequencyFit", sources: tuple[ModelSource, ...], made_by: str) -> Model:
    """Return a fitted curve as a model."""
    names = ["f0", *(f"a{k}" for k in range(1, fit.order + 1))]
    units = ["Hz", "Hz/degC", *(f"Hz/degC^{k}" for k in range(2, fit.order + 1))]
    return Model(
        kind="frequency",
        compensates="frequency_Hz",
        parts=(make_part("frequency", names, fit.coefficients, units, fit.covariance),),
        settings={"reference_temperature_degC": fit.reference_temperature_degC},
        validity={VARIABLE: _widen(fit)},
        sources=sources,
        made_by=made_by,
    )


def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, Array]:
    """Take the fitted temperature dependence out of the frequency: f − (f(T) − f₀), T the housing's.

    The curve is a settled one: while the housing's temperature moves, the resonator lags behind it and the
    difference stays in the result.
    """
    if model.compensates != "frequency_Hz":
        raise InputError(f"{model.path or 'model'}: a frequency model compensates frequency_Hz.")
    if "housing_temperature_degC" not in record:
        raise InputError(
            "the column 'housing_temperature_degC' is missing; without it the frequency is its own thermometer:"
            " 'hrg temperature MODEL RUN.csv --out FILE' turns it into the resonator's temperature, over which"
            " 'hrg fit bias --over temperature' compensates the other outputs."
        )
    if "frequency_Hz" in record and not extrapolate:
        ends = np.sort(evaluate(model, np.linspace(*model.range_of(VARIABLE), 201)))
        check_model_frequency(
            record["frequency_Hz"], ends[0], ends[-1], record.path or "record", model.path or "the model"
        )
    T = record["housing_temperature_degC"]
    model.check_range(VARIABLE, T, extrapolate)
    f0 = model.part("frequency").values[0]
    return {f"{COMPENSATED}frequency_Hz": record["frequency_Hz"] - (evaluate(model, T) - f0)}


def evaluate(model: Model, temperature_degC: Array) -> Array:
    """Return f(T) in Hz."""
    shift = temperature_degC - model.number("reference_temperature_degC")
    return np.asarray(np.polynomial.polynomial.polyval(shift, model.part("frequency").values))


def find_temperature(model: Model, frequency: Array, path: str = "record") -> Array:
    """Return the temperature (°C) whose frequency this is, HRG paper Table 2; NaN where no frequency is given.

    Raises
    ------
    InputError
        The curve turns round within the model's range, or a frequency lies outside it.
    """
    from scipy.optimize import elementwise

    low, high = model.range_of(VARIABLE)
    if not _is_monotonic(model):
        raise InputError(
            f"{model.path or 'model'}: the curve turns round between {low:g} and {high:g} °C, so two temperatures have"
            " the same frequency there and it cannot be inverted; fit a narrower range of temperature or another order."
        )
    ends = np.sort(evaluate(model, np.array([low, high])))
    check_model_frequency(frequency, float(ends[0]), float(ends[1]), path, model.path or "the model")
    known = np.isfinite(frequency)
    outside = known & ((frequency < ends[0]) | (frequency > ends[1]))
    if np.any(outside):
        raise InputError(
            f"frequency_Hz runs from {np.nanmin(frequency):.8g} to {np.nanmax(frequency):.8g}, outside {ends[0]:.8g} to"
            f" {ends[1]:.8g} ({low:g} to {high:g} °C) that the model was fitted to ({np.mean(outside):.1%} of the rows);"
            " calibrate over that range."
        )
    found = np.full(frequency.shape, np.nan)
    if np.any(known):

        def excess(T: Array, f: Array) -> Array:
            return evaluate(model, T) - f

        found[known] = elementwise.find_root(excess, (low, high), args=(frequency[known],)).x
    return found


def temperature_error(model: Model, temperature_degC: float) -> float:
    """Return the standard uncertainty (°C) that the fitted curve itself leaves at one temperature; NaN where unknown."""
    part, shift = model.part("frequency"), temperature_degC - model.number("reference_temperature_degC")
    if not part.covariance:
        return float("nan")
    powers = shift ** np.arange(len(part.values))
    slope = np.polynomial.polynomial.polyval(shift, np.polynomial.polynomial.polyder(np.array(part.values)))
    return float(np.sqrt(max(powers @ np.array(part.covariance) @ powers, 0.0)) / abs(slope))


def emit_c(model: Model) -> str:
    """Return `hrg_frequency(T)` and `hrg_temperature(f, &ok)`, the inverse by bracketed bisection, in C99."""
    low, high = model.range_of(VARIABLE)
    reference = model.number("reference_temperature_degC")
    turns = (
        ""
        if _is_monotonic(model)
        else "\n   The curve turns round in this range: there is no inverse, *ok is always 0."
    )
    return f"""{head(model)}
{polynomial("hrg_frequency_about", "shift", model.part("frequency").values)}

/* Resonance frequency (Hz) at temperature_degC; valid from {low:.9g} to {high:.9g} degC. */
double hrg_frequency(double temperature_degC) {{
    return hrg_frequency_about(temperature_degC - ({reference!r}));
}}

/* Temperature (degC) at which the resonator has this frequency (Hz); *ok is 0 outside the calibrated range.{turns} */
double hrg_temperature(double frequency, int *ok) {{
    double low = {low!r}, high = {high!r};
    double sign = hrg_frequency(high) > hrg_frequency(low) ? 1.0 : -1.0;
    *ok = {int(_is_monotonic(model))} && sign * (frequency - hrg_frequency(low)) >= 0.0
          && sign * (hrg_frequency(high) - frequency) >= 0.0;
    for (int k = 0; k < 60; ++k) {{
        double middle = 0.5 * (low + high);
        if (sign * (hrg_frequency(middle) - frequency) < 0.0) low = middle; else high = middle;
    }}
    return 0.5 * (low + high);
}}

{self_test(_test_rows(model), "temperature_degC, frequency", STEP)}"""


STEP = """    double found = hrg_frequency(row[0]), expected = row[1];
    int ok;
    double back = hrg_temperature(expected, &ok);
    if (ok && !(fabs(back - row[0]) <= 1e-7 * (1.0 + fabs(row[0])))) return 1;"""


def _test_rows(model: Model) -> list[tuple[float, ...]]:
    low, high = model.range_of(VARIABLE)
    T = np.round(np.linspace(low, high, 13)[1:-1], 6)
    return list(zip(T.tolist(), evaluate(model, T).tolist(), strict=True))


def _is_monotonic(model: Model) -> bool:
    low, high = model.range_of(VARIABLE)
    rise = np.diff(evaluate(model, np.linspace(low, high, GRID)))
    return bool(np.all(rise > 0) or np.all(rise < 0))


def _widen(fit: "FrequencyFit") -> tuple[float, float]:
    """Return the fitted range, wider by a twentieth on each side, but not beyond where the curve turns round."""
    low, high = fit.temperature_range_degC
    margin = WIDENED * (high - low)
    turns = fit.polynomial.turning_points(low - margin, high + margin)
    below, above = turns[turns <= low], turns[turns >= high]
    return max([low - margin, *below.tolist()]), min([high + margin, *above.tolist()])
