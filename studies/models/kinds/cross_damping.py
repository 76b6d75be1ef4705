"""Models of kind `cross-damping`: ζ₁₂(T) through the filter (9) of the CVG cross-damping paper, and its C code.

The file has one part "cross-damping" (zeta_0, zeta_1 …, per power of °C of shift) and the settings
`calibration_temperature_degC`, `frequency_Hz`, `relative_damping`, `g2` and `temperature_column`.
"""

import math

import numpy as np

from compensation.arrays import Array
from compensation.cross_damping import CrossDampingModel
from studies.errors import InputError
from studies.models.c_source import head, polynomial, self_test, write_c
from studies.models.file import Known, Model, ModelPart, ModelSource, make_part, widen
from studies.record import COMPENSATED, Record

OUTPUTS = {"bias_deg_per_h": math.radians(1 / 3600), "measured_rate_deg_per_s": math.radians(1.0)}
"""Columns that a cross-damping model can compensate, with the size of their unit in rad/s."""


def save_cross_damping(
    fit: CrossDampingModel, output: str, temperature_column: str, sources: tuple[ModelSource, ...], made_by: str
) -> Model:
    """Return a fitted ζ₁₂(T) as a model that compensates the column `output`."""
    names = [f"zeta_{i}" for i in range(len(fit.coefficients))]
    return Model(
        kind="cross-damping",
        compensates=output,
        parts=(make_part("cross-damping", names, fit.coefficients, _units(len(names)), fit.covariance),),
        settings={
            "calibration_temperature_degC": fit.calibration_temperature,
            "frequency_Hz": fit.k / (2 * math.pi),
            "relative_damping": fit.zeta,
            "g2": fit.g2,
            "temperature_column": temperature_column,
        },
        validity={temperature_column: widen(fit.lowest, fit.highest)},
        sources=sources,
        made_by=made_by,
    )


def known(model: Model) -> Known:
    """Return the keys of a model of ζ₁₂(T), and the units of its polynomial."""
    settings = ("calibration_temperature_degC", "frequency_Hz", "relative_damping", "g2", "temperature_column")
    return Known(settings, (model.temperature_column,), {"cross-damping": _units(len(_part(model).values))})


def _units(count: int) -> list[str]:
    return ["1", "1/degC", *(f"1/degC^{i}" for i in range(2, count))][:count]


def load_cross_damping(model: Model) -> CrossDampingModel:
    """Return the fit that a model file holds."""
    part = _part(model)
    lowest, highest = model.range_of(model.temperature_column)
    return CrossDampingModel(
        coefficients=np.array(part.values),
        covariance=np.array(part.covariance) if part.covariance else np.full((len(part.values),) * 2, np.nan),
        calibration_temperature=model.number("calibration_temperature_degC"),
        k=2 * math.pi * model.number("frequency_Hz", above=0),
        zeta=model.number("relative_damping", above=0),
        g2=model.number("g2", above=0),
        lowest=lowest,
        highest=highest,
        noise=math.nan,
    )


def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, Array]:
    """Subtract the predicted cross-damping error; rows without temperature or output stay empty."""
    output, column = model.compensates, model.temperature_column
    model.check_inputs(record, column, outputs=OUTPUTS)
    temperature = record[column]
    model.check_range(column, temperature, extrapolate)
    known = np.isfinite(temperature)
    if np.count_nonzero(known) < 2:
        raise InputError(f"the column '{column}' has fewer than two values; nothing can be compensated.")
    predicted = load_cross_damping(model).predict(record["time_s"][known], temperature[known], extrapolate=True)
    compensated = np.full(len(record), np.nan)
    compensated[known] = record[output][known] - predicted / OUTPUTS[output]
    return {f"{COMPENSATED}{output}": compensated}


def emit_c(model: Model) -> str:
    """Return `hrg_cross_damping_step(&state, T, dt)`, the error to subtract, in C99, with a table to test it."""
    model.check_output(OUTPUTS)
    fit = load_cross_damping(model)
    gain = 2 * fit.k / fit.g2 / OUTPUTS[model.compensates]
    code = write_c(
        "cross_damping",
        polynomial=polynomial("hrg_cross_damping", "shift", fit.coefficients.tolist()),
        column=model.temperature_column, output=model.compensates, gain=repr(gain), pole=repr(fit.k * fit.zeta),
        reference=repr(fit.calibration_temperature),
    )  # fmt: skip
    return f"{head(model)}\n{code}{self_test(_test_rows(model, fit), 'dt_s (0: settle), temperature_degC, expected', STEP)}"


STEP = """    static hrg_cross_damping_state state;
    double found = row[0] > 0.0 ? hrg_cross_damping_step(&state, row[1], row[0])
                                : hrg_cross_damping_settle(&state, row[1]);
    double expected = row[2];"""


def _test_rows(model: Model, fit: CrossDampingModel) -> list[tuple[float, ...]]:
    """A few uneven steps through the calibrated range, with what Python makes of them."""
    low, high = model.range_of(model.temperature_column)
    steps = np.array([0.0, *np.resize([1.0, 2.0, 4.0, 2.0, 0.5], 23)])
    temperature = np.round((low + high) / 2 + 0.45 * (high - low) * np.sin(0.5 * np.arange(24)), 9)
    error = fit.predict(np.cumsum(steps), temperature, extrapolate=True) / OUTPUTS[model.compensates]
    return list(zip(steps.tolist(), temperature.tolist(), error.tolist(), strict=True))


def _part(model: Model) -> ModelPart:
    part = model.part("cross-damping")
    model.check_names(part, "zeta_")
    return part
