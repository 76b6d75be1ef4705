"""Models of kind `bias`: B(f, ḟ) of HRG paper eq. (21), applied to a record or emitted as C.

One part "bias" (constant and terms) and the settings `variable` (`frequency_Hz` or a temperature), its reference,
`rate_window_s` and `rate_lag_s`: the rate is the slope over the last window when the lag is half of it, over a centred
one when it is 0. A temperature may act behind `memory_lag_s` and `play_degC`. Ranges are the fit's and 5 % more. A
causal model holds what ten-second blocks gave until the next is complete, in Python as in C.
"""

from math import ceil

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.bias import BLOCK, FREQUENCY, POWERS, TEMPERATURE, BiasFit, BiasRun, Variable, term_columns
from compensation.decimation import average_blocks
from compensation.derivative import differentiate
from compensation.memory import NO_MEMORY, Memory, follow_lag, follow_play
from compensation.samples import check_time
from studies.errors import InputError, nearest
from studies.models.c_source import head, self_test, write_c
from studies.models.file import Known, Model, ModelSource, Setting, make_part, widen
from studies.record import COMPENSATED, Record

OUTPUTS = {"bias_deg_per_h": "deg/h", "measured_rate_deg_per_s": "deg/s"}
TEST_ROWS = 80  # of the emitted code
LEAST_BLOCKS = 3  # and half a window, before a causal rate is known


def save_bias(
    fit: BiasFit, run: BiasRun, output: str, column: str, sources: tuple[ModelSource, ...], made_by: str
) -> Model:
    """Return a fitted bias model; `run` tells how the rate was taken, `output` the column fitted, `column` over which."""
    units = [unit_of_term(OUTPUTS[output], name, fit.variable) for name in ("constant", *fit.terms)]
    names = [name_term(name, fit.variable) for name in fit.terms]
    settings: dict[str, Setting] = {
        "variable": column,
        _reference_key(column): fit.reference,
        "rate_window_s": run.window,
        "rate_lag_s": run.lag,
    }
    if fit.memory.lag or fit.memory.play:
        settings |= {"memory_lag_s": fit.memory.lag, "play_degC": fit.memory.play}
    return Model(
        kind="bias",
        compensates=output,
        parts=(make_part("bias", ("constant", *names), fit.coefficients, units, fit.covariance),),
        settings=settings,
        validity={column: widen(*fit.state_range), rate_name(column): widen(*fit.rate_range)},
        sources=sources,
        made_by=made_by,
    )


def known(model: Model) -> Known:
    """Return the keys of a model of the bias, and the units of its terms."""
    column, (terms, _) = variable_column(model), read_terms(model)
    units = [unit_of_term(OUTPUTS[model.compensates], name, _variable(model)) for name in ("constant", *terms)]
    settings = ("variable", _reference_key(column), "rate_window_s", "rate_lag_s", "memory_lag_s", "play_degC")
    return Known(settings, (column, rate_name(column)), {"bias": units})


def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, Array]:
    """Take the predicted bias out of the output; rows farther than a window from any reading stay NaN."""
    column, output = variable_column(model), model.compensates
    model.check_inputs(record, column, outputs=OUTPUTS)
    predict = _predict_causally if model.number("rate_lag_s", least=0) > 0 else _predict_centred
    bias = predict(model, record["time_s"], record[column], extrapolate)
    return {f"{COMPENSATED}{output}": record[output] - bias}


def emit_c(model: Model) -> str:
    """Return the model as C99 for firmware, with a table of its own to test it."""
    terms, (constant, *coefficients) = read_terms(model)
    column, memory = variable_column(model), memory_of(model)
    window, length = model.number("rate_window_s", above=0), block_length(model)
    (low, high), (r_low, r_high) = model.range_of(column), model.range_of(rate_name(column))
    products = (f"({value!r}){_product(name)}" for name, value in zip(terms, map(float, coefficients), strict=True))
    uncausal = " The model was fitted with a centred rate: fit it with --causal to match this code."
    code = write_c(
        "bias",
        column=column, unit=OUTPUTS[model.compensates], reference=repr(reference_of(model)),
        total="\n        + ".join([f"({float(constant)!r})", *products]),
        length=f"{length:g}", window=f"{window:g}", late=f"{window / 2:g}",
        warning="" if model.number("rate_lag_s", least=0) else uncausal,
        exact_length=repr(length), exact_window=repr(window), lag=repr(memory.lag), play=repr(memory.play),
        blocks=ceil(window / length) + 2, least=LEAST_BLOCKS - 1,
        low=repr(low), high=repr(high), r_low=repr(r_low), r_high=repr(r_high),
    )  # fmt: skip
    return f"{head(model)}\n{code}{self_test(_test_rows(model), 'time_s, output, value, expected (NaN: not ok)', STEP)}"


STEP = """    static hrg_bias_state state;
    int ok;
    double found = hrg_compensate(&state, row[0], row[1], row[2], &ok), expected = row[3];
    if (!ok) return expected == expected;"""


def _product(name: str) -> str:
    a, b, c = POWERS[name]
    return " * f" * a + " * r" * b + " * play" * c


def _predict_centred(model: Model, time: Array, values: Array, extrapolate: bool) -> Array:
    """Return the bias at every row, from averages around it."""
    window = model.number("rate_window_s", above=0)
    check_time(time)
    blocks = average_blocks(time, {"state": values}, min(max(BLOCK, float(np.median(np.diff(time)))), window / 2))
    state = follow_lag(blocks.columns["state"], np.diff(blocks.time), memory_of(model).lag)
    rate = differentiate(blocks.time, state, window).slope
    predicted = _evaluate(model, state, rate, extrapolate)
    after = np.clip(np.searchsorted(blocks.time, time), 1, blocks.time.size - 1)
    distance = np.minimum(np.abs(time - blocks.time[after - 1]), np.abs(time - blocks.time[after]))
    return np.where(distance <= window, np.interp(time, blocks.time, predicted), np.nan)


def _predict_causally(model: Model, time: Array, values: Array, extrapolate: bool) -> Array:
    """Return the bias at every row, from the blocks that were complete by then, as the emitted C does."""
    window = model.number("rate_window_s", above=0)
    check_time(time)
    known = np.isfinite(values)
    if np.count_nonzero(known) < 2:
        raise InputError(f"the column '{variable_column(model)}' has fewer than two values to compensate.")
    length = block_length(model)
    numbers = np.floor((time - time[known][0]) / length).astype(int)
    used, starts = np.unique(numbers[known], return_index=True)
    counts = np.diff(np.append(starts, np.count_nonzero(known)))
    middle = np.add.reduceat(time[known], starts) / counts
    zero = float(values[known][0])
    state = np.add.reduceat(values[known] - zero, starts) / counts + zero
    state = follow_lag(state, np.diff(middle), memory_of(model).lag)
    if middle.size < LEAST_BLOCKS:
        return np.full(time.shape, np.nan)
    rate = differentiate(middle, state, window, causal=True).slope
    first = np.searchsorted(middle, middle - window - 1e-6)
    ready = (np.arange(middle.size) - first >= LEAST_BLOCKS - 1) & (middle - middle[first] >= window / 2)
    predicted = np.where(ready, _evaluate(model, state, rate, extrapolate, ready), np.nan)
    # A block is complete when a reading of a later one has come.
    latest = np.maximum.accumulate(np.where(known, numbers, -1))
    complete = np.searchsorted(used, latest) - 1
    bias = np.where(complete >= 0, predicted[np.maximum(complete, 0)], np.nan)
    fresh = time - middle[np.maximum(complete, 0)] <= window
    return np.where(fresh, bias, np.nan)


def _evaluate(
    model: Model, state: Array, rate: Array, extrapolate: bool, judged: NDArray[np.bool_] | None = None
) -> Array:
    column, (terms, coefficients) = variable_column(model), read_terms(model)
    rows = slice(None) if judged is None else judged
    model.check_range(column, state[rows], extrapolate)
    model.check_range(rate_name(column), rate[rows], extrapolate)
    play = follow_play(state, memory_of(model).play) - state
    columns = term_columns(state, rate, reference_of(model), terms, play)
    return np.asarray(coefficients[0] + columns @ coefficients[1:])


def block_length(model: Model) -> float:
    """Length (s) of the blocks that a causal model averages over."""
    return min(BLOCK, model.number("rate_window_s", above=0) / 2)


def variable_column(model: Model) -> str:
    """Return the column that the bias is a function of; the frequency where an older file does not say."""
    column = model.settings.get("variable", "frequency_Hz")
    if not isinstance(column, str):
        raise InputError(f"{model.where} [settings]: the key 'variable' must name a column.")
    return column


def rate_name(column: str) -> str:
    """Return the name of a column's rate in `[validity]`: frequency_rate_Hz_per_s for frequency_Hz."""
    name, _, unit = column.rpartition("_")
    return f"{name}_rate_{unit}_per_s"


def reference_of(model: Model) -> float:
    """Return the value from which changes are counted, Hz or °C."""
    return model.number(_reference_key(variable_column(model)))


def memory_of(model: Model) -> Memory:
    """Return the lag and play that stand before the bias."""
    if "memory_lag_s" not in model.settings:
        return NO_MEMORY
    return Memory(model.number("memory_lag_s", least=0), model.number("play_degC", least=0))


def read_terms(model: Model) -> tuple[tuple[str, ...], Array]:
    """Return the terms in the names of `compensation.bias`, and all coefficients, the constant first."""
    part, variable = model.part("bias"), _variable(model)
    where = model.where
    model.check_output(OUTPUTS)
    if part.names[0] != "constant":
        raise InputError(f"{where}: the first coefficient must be 'constant', not '{part.names[0]}'.")
    known = {name_term(name, variable): name for name in POWERS}
    for name in part.names[1:]:
        if name not in known:
            raise InputError(f"{where}: unknown term '{name}'{nearest(name, known)}")
    if "play" in part.names and not memory_of(model).play:
        raise InputError(f"{where} [settings]: the term 'play' needs play_degC above 0; add it.")
    return tuple(known[name] for name in part.names[1:]), np.array(part.values)


def name_term(name: str, variable: Variable) -> str:
    """Return a term's name in a file: fdot is Tdot where the bias is a function of temperature."""
    return name.replace("f", variable.symbol)


def unit_of_term(output: str, name: str, variable: Variable) -> str:
    """Return the unit of the coefficient of a term."""
    unit = variable.unit.replace("°", "deg")
    if name == "constant":
        return output
    a, b, c = POWERS[name]
    factors = [*[unit] * (a + c), *[f"({unit}/s)"] * b]
    return f"{output}/{factors[0]}" if len(factors) == 1 else f"{output}/({'*'.join(factors)})"


def _test_rows(model: Model) -> list[tuple[float, ...]]:
    """Inputs inside the calibrated range, with what Python makes of them."""
    column, window = variable_column(model), model.number("rate_window_s")
    (low, high), (r_low, r_high) = model.range_of(column), model.range_of(rate_name(column))
    time = np.arange(TEST_ROWS) * window / 24
    middle, speed = (low + high) / 2, 0.4 * max(abs(r_low), abs(r_high))
    speed = min(speed, 0.3 * (high - low) / time[-1])
    value = middle + (0.0 if r_low <= 0 <= r_high else (r_low + r_high) / 2) * (time - time[-1] / 2)
    value = np.round(value + speed * window / 3 * np.sin(time * 3 / window), 9)
    output = np.round(1.0 + 0.25 * np.cos(0.7 * np.arange(TEST_ROWS)), 9)
    lag = model.number("rate_lag_s") or model.number("rate_window_s") / 2
    causal = replace(model, settings={**model.settings, "rate_lag_s": lag})
    record = Record({"time_s": time, column: value, model.compensates: output})
    expected = compensate(causal, record, extrapolate=True)[f"{COMPENSATED}{model.compensates}"]
    return list(zip(time.tolist(), output.tolist(), value.tolist(), expected.tolist(), strict=True))


def _variable(model: Model) -> Variable:
    return FREQUENCY if variable_column(model) == "frequency_Hz" else TEMPERATURE


def _reference_key(column: str) -> str:
    return "reference_frequency_Hz" if column == "frequency_Hz" else "reference_temperature_degC"
