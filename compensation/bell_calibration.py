"""Calibration of the chain of a bell-shaped gyro, step by step, each *given* those before it: BVG paper equations (33)–(36)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.bell import BellChain, PolynomialCurve, design_smoother
from compensation.errors import CompensationError
from compensation.noise_regression import correlated_covariance
from compensation.polynomial import fit_polynomial
from compensation.rate_law import fit_rate_curve
from compensation.samples import own_columns, read_columns, require_regular

Fitted = TypeVar("Fitted")
NEAR = 0.5  # K from a run within which what it tells is taken to hold


@dataclass(frozen=True)
class BellRun:
    """One calibration run: time (s), raw output (counts), temperature (°C), applied rate (°/s); arrays (N,)."""

    time: Array
    output: Array
    temperature: Array
    rate: Array

    def __post_init__(self) -> None:
        own_columns(self)


def fit_rough(run: BellRun) -> tuple[float, float, Array]:
    """Fit null N₁ (counts) and scale S₁ (°/s per count), with covariance, to a run at rest and then at one rate: eq. (33)."""
    line = fit_polynomial(run.rate, run.output, 1, "rate")
    (null, slope), covariance = line.about(0.0, correlated_covariance(line.regression))
    if slope == 0:
        raise CompensationError("the output does not change with the rate; the rough scale cannot be found.")
    to_scale = np.diag([1.0, -1 / slope**2])
    return float(null), float(1 / slope), to_scale @ covariance @ to_scale.T


def fit_scale_over_temperature(temperature: ArrayLike, rate_compensated: ArrayLike, rate: ArrayLike) -> PolynomialCurve:
    """Fit the factor that brings the output to the applied rate (°/s), over temperature (°C): eq. (36)."""
    T, measured, applied = read_columns(temperature=temperature, rate_compensated=rate_compensated, rate=rate)
    if np.any(applied == 0) or np.any(np.abs(measured) < 0.1 * np.abs(applied)):
        raise CompensationError("the scale over temperature needs an applied rate in every row of the run.")
    return fit_curve(T, applied / measured, "temperature")


def fit_chain(
    rates: BellRun, rest: BellRun | None = None, turning: BellRun | None = None, *, rough: BellRun | None = None,
    cutoff: float | None = 1.0, order: int = 50, sampling: float | None = None, form: str | None = None,
) -> BellChain:  # fmt: skip
    """Fit all steps in the paper's order.

    `rates` has several at one temperature (35); `rest` is over temperature (34), `turning` one rate over temperature
    (36), `rough` at rest and turning (33); what is missing changes nothing. The FIR filter has a `cutoff` (Hz; None:
    none), an `order` and a step (s); `form` is a law of `compensation.rate_law` instead of (35)'s parabola.
    """
    null, scale, covariance = _step("rough null and scale (33)", fit_rough, rates if rough is None else rough)
    bias = _nothing(rates, 0.0)
    if rest is not None:
        bias = _step(
            "bias over temperature (34)", fit_curve, rest.temperature, scale * (rest.output - null), "temperature"
        )
    straight = scale * (rates.output - null) - bias.value(rates.temperature)
    averaged = 1.0 if sampling is None else max(float(np.median(np.diff(rates.time))) / sampling, 1.0)
    # noise of the measured rate flattens (35)'s line by some 1e-7
    fit = partial(fit_curve, name="measured rate") if form is None else partial(fit_rate_curve, form, averaged)
    over_rate = _step("scale over rate (35)", fit, straight, rates.rate)
    over_temperature = _nothing(rates, 1.0)
    if turning is not None:
        constant = over_rate.value(scale * (turning.output - null) - bias.value(turning.temperature))
        over_temperature = _step(
            "scale over temperature (36)", fit_scale_over_temperature, turning.temperature, constant, turning.rate
        )
    step, taps = 0.0, np.empty(0)
    if cutoff is not None:
        step = require_regular((rest or rates).time, "the FIR filter") if sampling is None else sampling
        taps = design_smoother(step, cutoff, order)
    return BellChain(null, scale, covariance, bias, over_rate, over_temperature, taps, step)


def _nothing(run: BellRun, value: float) -> PolynomialCurve:
    """Return the curve of a step for which there is no run: it changes nothing, where the temperature of another run is."""
    T = run.temperature
    ends = float(T.min()) - NEAR, float(T.max()) + NEAR
    return PolynomialCurve(np.array([value, 0.0, 0.0]), np.zeros((3, 3)), *ends)


def fit_curve(x: ArrayLike, y: ArrayLike, name: str) -> PolynomialCurve:
    """Fit a parabola with errors that wander, as of eqs. (34)–(36); `name` is that of x in messages."""
    fit = fit_polynomial(x, y, 2, name)
    coefficients, covariance = fit.about(0.0, correlated_covariance(fit.regression))
    return PolynomialCurve(coefficients, covariance, float(np.min(x)), float(np.max(x)))


def _step(name: str, fit: Callable[..., Fitted], *arguments: Any) -> Fitted:
    try:
        return fit(*arguments)
    except CompensationError as error:
        raise CompensationError(f"{name}: {error}") from error
