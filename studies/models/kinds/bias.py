"""Models of kind `bias`: B(f, ḟ) of HRG paper eq. (21), applied to a record or emitted as C.

The file has one part "bias" (constant and terms) and the settings `reference_frequency_Hz`, `rate_window_s` and
`rate_lag_s`: the rate is the slope of the line through the frequencies of the last `rate_window_s` seconds when the lag
is half of that, and of a window centred on the sample when it is 0. Ranges are those of the fit, widened by 5 % of their
length, because readings scatter.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from compensation.bias import TERMS, term_columns
from compensation.decimation import average_blocks
from compensation.derivative import differentiate
from compensation.samples import check_time
from studies.errors import InputError, nearest
from studies.models.c_source import head
from studies.models.file import Model, Source, make_part
from studies.record import COMPENSATED, Record

if TYPE_CHECKING:
    from compensation.bias import BiasFit, BiasRun

Array = NDArray[np.float64]
OUTPUTS = {"bias_deg_per_h": "deg/h", "measured_rate_deg_per_s": "deg/s"}
WIDENED = 0.05
BLOCK = 10.0  # s over which the frequency is averaged before it is used


def save_bias(fit: "BiasFit", run: "BiasRun", output: str, sources: tuple[Source, ...], made_by: str) -> Model:
    """Return a fitted bias model; `run` tells how the rate was taken, `output` the column that was fitted."""
    units = [OUTPUTS[output], *(unit_of_term(OUTPUTS[output], *TERMS[name]) for name in fit.terms)]
    return Model(
        kind="bias",
        compensates=output,
        parts=(make_part("bias", ("constant", *fit.terms), fit.coefficients, units, fit.covariance),),
        settings={
            "reference_frequency_Hz": fit.reference_frequency,
            "rate_window_s": run.window,
            "rate_lag_s": run.lag,
        },
        validity={
            "frequency_Hz": _widen(*fit.frequency_range),
            "frequency_rate_Hz_per_s": _widen(*fit.rate_range),
        },
        sources=sources,
        made_by=made_by,
    )


def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, Array]:
    """Take the predicted bias out of the output; rows farther than a window from any frequency reading stay NaN."""
    terms, coefficients = _terms(model)
    f, time, output = record["frequency_Hz"], record["time_s"], record[model.compensates]
    window, lag = model.number("rate_window_s", above=0), model.number("rate_lag_s", least=0)
    check_time(time)
    blocks = average_blocks(time, {"frequency_Hz": f}, min(max(BLOCK, float(np.median(np.diff(time)))), window / 2))
    smooth = blocks.columns["frequency_Hz"]
    rate = differentiate(blocks.time, smooth, window, causal=lag > 0).slope
    model.check_range("frequency_Hz", smooth, extrapolate)
    model.check_range("frequency_rate_Hz_per_s", rate, extrapolate)
    columns = term_columns(smooth, rate, model.number("reference_frequency_Hz"), terms)
    predicted = coefficients[0] + columns @ coefficients[1:]
    after = np.clip(np.searchsorted(blocks.time, time), 1, blocks.time.size - 1)
    distance = np.minimum(np.abs(time - blocks.time[after - 1]), np.abs(time - blocks.time[after]))
    bias = np.where(distance <= window, np.interp(time, blocks.time, predicted), np.nan)
    return {f"{COMPENSATED}{model.compensates}": output - bias}


def emit_c(model: Model) -> str:
    """Return `hrg_rate`, `hrg_bias` and `hrg_compensate` in C99."""
    terms, coefficients = _terms(model)
    window, lag = model.number("rate_window_s", above=0), model.number("rate_lag_s", least=0)
    products = [
        f"({value!r})" + _product(*TERMS[name]) for name, value in zip(terms, coefficients[1:].tolist(), strict=True)
    ]
    total = "\n        + ".join([f"({coefficients[0].item()!r})", *products])
    (f_low, f_high), (r_low, r_high) = model.range_of("frequency_Hz"), model.range_of("frequency_rate_Hz_per_s")
    return f"""{head(model)}
/* Slope (Hz/s) of the line through n frequencies, step seconds apart, oldest first; the fit used {window:g} s
   {f"up to the present sample, so that the rate lags by {lag:g} s" if lag else "centred on the sample: delay the rest by half of it"}. */
double hrg_rate(const double *frequency, int n, double step) {{
    double sum = 0.0, middle = 0.5 * (n - 1);
    for (int k = 0; k < n; ++k) sum += (k - middle) * (frequency[k] - frequency[0]);
    return 12.0 * sum / ((double)n * ((double)n * n - 1.0) * step);
}}

/* Bias ({OUTPUTS[model.compensates]}) at a frequency (Hz) and its rate (Hz/s). */
double hrg_bias(double frequency, double rate) {{
    double f = frequency - ({model.number("reference_frequency_Hz")!r}), r = rate;
    (void)f;
    (void)r;
    return {total};
}}

/* Output with the bias taken out; *ok is 0 outside the calibrated range. */
double hrg_compensate(double output, double frequency, double rate, int *ok) {{
    *ok = frequency >= {f_low!r} && frequency <= {f_high!r} && rate >= {r_low!r} && rate <= {r_high!r};
    return output - hrg_bias(frequency, rate);
}}
"""


def _terms(model: Model) -> tuple[tuple[str, ...], Array]:
    part = model.part("bias")
    if model.compensates not in OUTPUTS:
        raise InputError(
            f"{model.path or 'model'}: compensates = '{model.compensates}'{nearest(model.compensates, OUTPUTS)}"
        )
    if part.names[0] != "constant":
        raise InputError(f"{model.path or 'model'}: the first coefficient must be 'constant', not '{part.names[0]}'.")
    for name in part.names[1:]:
        if name not in TERMS:
            raise InputError(f"{model.path or 'model'}: unknown term '{name}'{nearest(name, TERMS)}")
    return part.names[1:], np.array(part.values)


def unit_of_term(output: str, a: int, b: int) -> str:
    """Return the unit of the coefficient of fᵃ ḟᵇ."""
    factors = [*["Hz"] * a, *["(Hz/s)"] * b]
    return f"{output}/{factors[0]}" if len(factors) == 1 else f"{output}/({'*'.join(factors)})"


def _product(a: int, b: int) -> str:
    return " * f" * a + " * r" * b


def _widen(low: float, high: float) -> tuple[float, float]:
    return low - WIDENED * (high - low), high + WIDENED * (high - low)
