"""Models of kind `frequency`: f(T) as a polynomial, HRG paper eqs. (16)–(18), its inverse, and their C code.

One part "frequency" (f0, a1, a2 …) and `reference_temperature_degC`; the range is the fit's and 5 % more, to a turning
point.
"""

from functools import partial

import numpy as np

from compensation.arrays import Array
from compensation.frequency import FrequencyFit, find_turn, invert
from studies.errors import InputError, naming
from studies.models.c_source import head, polynomial, self_test, write_c
from studies.models.file import Known, Model, ModelSource, make_part, widen
from studies.record import COMPENSATED, RESONATOR, Record
from studies.record.plausible import check_model_frequency
from studies.record.rest import TEMPERATURES

VARIABLE, REFERENCE = "temperature_degC", "reference_temperature_degC"


def save_frequency(fit: FrequencyFit, sources: tuple[ModelSource, ...], made_by: str) -> Model:
    """Return a fitted curve as a model."""
    names = ["f0", *(f"a{k}" for k in range(1, fit.order + 1))]
    return Model(
        kind="frequency",
        compensates="frequency_Hz",
        parts=(make_part("frequency", names, fit.coefficients, _units(len(names)), fit.covariance),),
        settings={REFERENCE: fit.reference_temperature_degC},
        validity={VARIABLE: valid_range(fit)},
        sources=sources,
        made_by=made_by,
    )


def known(model: Model) -> Known:
    """Return the keys of a model of the frequency, and the units of its polynomial."""
    part = model.part("frequency")
    model.check_names(part, "a", "f0")
    return Known((REFERENCE,), (VARIABLE,), {"frequency": _units(len(part.values))})


def _units(count: int) -> list[str]:
    return ["Hz", "Hz/degC", *(f"Hz/degC^{k}" for k in range(2, count))][:count]


def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, Array]:
    """Take the fitted temperature dependence out of the frequency: f − (f(T) − f₀), T the housing's, the resonator's or the chamber's.

    Without any thermometer the resonator's temperature is returned. The curve is a settled one: behind a housing that
    moves the resonator lags, and the difference stays in the result.
    """
    model.check_output(("frequency_Hz",))
    column = next((name for name in TEMPERATURES if record.has_values(name)), None)
    if column is None:
        return {RESONATOR: find_temperature(model, record["frequency_Hz"], record.path or "record", spare=extrapolate)}
    if "frequency_Hz" in record and not extrapolate:
        ends = np.sort(evaluate(model, np.linspace(*model.range_of(VARIABLE), 201)))
        check_model_frequency(
            record["frequency_Hz"], ends[0], ends[-1], record.path or "record", model.path or "the model"
        )
    T = record[column]
    model.check_range(VARIABLE, T, extrapolate)
    f0 = model.part("frequency").values[0]
    return {f"{COMPENSATED}frequency_Hz": record["frequency_Hz"] - (evaluate(model, T) - f0)}


def evaluate(model: Model, temperature_degC: Array) -> Array:
    """Return f(T) in Hz."""
    shift = temperature_degC - model.number(REFERENCE)
    return np.asarray(np.polynomial.polynomial.polyval(shift, model.part("frequency").values))


def find_temperature(model: Model, frequency: Array, path: str = "record", *, spare: bool = False) -> Array:
    """Return the temperature (°C) of a frequency, HRG paper Table 2; NaN without one or, to `spare` it, outside the model's range."""
    if not np.isfinite(frequency).any():
        raise InputError(f"{path}: the column 'frequency_Hz' has no value.")
    low, high = np.sort(evaluate(model, np.array(model.range_of(VARIABLE))))
    check_model_frequency(frequency, float(low), float(high), path, model.path or "the model")
    if spare:
        frequency = np.where((frequency >= low) & (frequency <= high), frequency, np.nan)
    with naming(f"{path} with {model.where}"):
        return invert(partial(evaluate, model), model.range_of(VARIABLE), frequency)


def temperature_error(model: Model, temperature_degC: float) -> float:
    """Return the standard uncertainty (°C) that the fitted curve itself leaves at one temperature; NaN where unknown."""
    part, shift = model.part("frequency"), temperature_degC - model.number(REFERENCE)
    if not part.covariance:
        return float("nan")
    powers = shift ** np.arange(len(part.values))
    slope = np.polynomial.polynomial.polyval(shift, np.polynomial.polynomial.polyder(np.array(part.values)))
    return float(np.sqrt(max(powers @ np.array(part.covariance) @ powers, 0.0)) / abs(slope))


def emit_c(model: Model) -> str:
    """Return `hrg_frequency(T)` and `hrg_temperature(f, &ok)`, the inverse by bracketed bisection, in C99."""
    low, high = model.range_of(VARIABLE)
    reference = model.number(REFERENCE)
    none = "\n   The curve has a turning point in this range: there is no inverse, *ok is always 0."
    monotonic = find_turn(partial(evaluate, model), (low, high)) is None
    code = write_c(
        "frequency",
        polynomial=polynomial("hrg_frequency_about", "shift", model.part("frequency").values),
        lowest=f"{low:.9g}", highest=f"{high:.9g}", low=repr(low), high=repr(high), reference=repr(reference),
        turns="" if monotonic else none, has_inverse=int(monotonic),
    )  # fmt: skip
    return f"{head(model)}\n{code}{self_test(_test_rows(model), 'temperature_degC, frequency', STEP)}"


STEP = """    double found = hrg_frequency(row[0]), expected = row[1];
    int ok;
    double back = hrg_temperature(expected, &ok);
    if (ok && !(fabs(back - row[0]) <= 1e-7 * (1.0 + fabs(row[0])))) return 1;"""


def _test_rows(model: Model) -> list[tuple[float, ...]]:
    low, high = model.range_of(VARIABLE)
    T = np.round(np.linspace(low, high, 13)[1:-1], 6)
    return list(zip(T.tolist(), evaluate(model, T).tolist(), strict=True))


def valid_range(fit: FrequencyFit) -> tuple[float, float]:
    """Return the fitted range, wider by a twentieth on each side, but not beyond where the curve turns round."""
    low, high = fit.temperature_range_degC
    lowest, highest = widen(low, high)
    below, above = (find_turn(fit.polynomial.value, span) for span in ((lowest, low), (high, highest)))
    return lowest if below is None else below, highest if above is None else above
