"""Bell-shaped gyro: the rate from its loop, and the four-step compensation of its output.

Equation numbers are those of the BVG paper (Sensors 2015, 15, 23684). The chain (32) is

    Ω = S₃(T) { S₂(Ω) [ S₁ (A − N₁) − N(T) ] }

rough null and scale; bias over temperature; scale over rate; scale over temperature; then a FIR filter. Every step is
fitted to what the steps before it deliver, so its intervals hold *given* those steps.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.correlated import correlated_covariance
from compensation.errors import CompensationError
from compensation.polynomial import fit_polynomial
from compensation.samples import read_columns, require_regular

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Fitted = TypeVar("Fitted")
CELSIUS_ZERO = 273.15
MARGIN = 0.01
"""Part of a fitted range by which noise may lead out of it before that counts as extrapolation."""
PLATEAU = 1e-3
"""Part of the largest applied rate within which two rates are the same."""


@dataclass(frozen=True)
class Curve:
    """y = Σ cᵢ (x − reference)ⁱ between `lowest` and `highest` x, with the covariance of c."""

    coefficients: Real
    covariance: Real
    reference: float
    lowest: float
    highest: float

    def value(self, x: ArrayLike) -> Real:
        """Return y at x."""
        shift = np.asarray(x, dtype=float) - self.reference
        return np.asarray(np.polynomial.polynomial.polyval(shift, self.coefficients), dtype=float)

    def refuse_outside(self, x: Real, name: str, show: Callable[[float], str]) -> None:
        """Raise when x leaves the fitted range by more than `MARGIN` of it; `show` writes an x for people."""
        beyond = MARGIN * (self.highest - self.lowest)
        low, high = float(np.min(x)), float(np.max(x))
        if low < self.lowest - beyond or high > self.highest + beyond:
            raise CompensationError(
                f"the {name} runs from {show(low)} to {show(high)}, but the chain was fitted between "
                f"{show(self.lowest)} and {show(self.highest)}; allow extrapolation or calibrate over that range."
            )


@dataclass(frozen=True)
class Chain:
    """The fitted steps (33)–(36) and the filter.

    Attributes
    ----------
    null : float
        N₁ (counts).
    scale : float
        S₁ (rad/s per count).
    rough_covariance : array (2, 2)
        Covariance of null and scale.
    bias : Curve
        N(T), rad/s over kelvin: eq. (34).
    scale_over_rate : Curve
        Rate (rad/s) over rate (rad/s): eq. (35).
    scale_over_temperature : Curve
        Factor (1) over kelvin: eq. (36).
    taps : array
        FIR coefficients, empty for none.
    sampling : float
        Step (s) that the taps were designed for.
    """

    null: float
    scale: float
    rough_covariance: Real
    bias: Curve
    scale_over_rate: Curve
    scale_over_temperature: Curve
    taps: Real
    sampling: float

    @property
    def delay(self) -> float:
        """Time (s) by which the FIR filter delays the output: half its order."""
        return (len(self.taps) - 1) / 2 * self.sampling if len(self.taps) else 0.0


@dataclass(frozen=True)
class ChainOutput:
    """Rate (rad/s) after each step: (33), (34), (35), (36) and the filter."""

    rough: Real
    bias_compensated: Real
    rate_compensated: Real
    temperature_compensated: Real
    filtered: Real


@dataclass(frozen=True)
class Run:
    """One calibration run: time (s), raw output (counts), temperature (K), applied rate (rad/s); arrays (N,)."""

    time: Real
    output: Real
    temperature: Real
    rate: Real

    def __post_init__(self) -> None:
        columns = read_columns(time=self.time, output=self.output, temperature=self.temperature, rate=self.rate)
        for name, values in zip(("time", "output", "temperature", "rate"), columns, strict=True):
            object.__setattr__(self, name, values)


def fit_rough(run: Run) -> tuple[float, float, Real]:
    """Fit null N₁ (counts) and scale S₁ (rad/s per count) to a run at rest and turning: eq. (33).

    The output is regressed on the rate, whose values are exact; with the paper's two plateaus the line passes through
    both means.

    Returns
    -------
    null, scale, covariance : float, float, array (2, 2)
        Of null and scale in this order.
    """
    line = fit_polynomial(run.rate, run.output, 1, "rate")
    (null, slope), _ = line.about(0.0)
    if slope == 0:
        raise CompensationError("the output does not change with the rate; the rough scale cannot be found.")
    from_scaled = np.array([[1.0, -line.centre / line.half_span], [0.0, 1 / line.half_span]])
    covariance = from_scaled @ correlated_covariance(line.regression) @ from_scaled.T
    to_scale = np.diag([1.0, -1 / slope**2])
    return float(null), float(1 / slope), to_scale @ covariance @ to_scale.T


def fit_bias(temperature: ArrayLike, rough: ArrayLike, order: int = 2) -> Curve:
    """Fit N(T) to the rough output (rad/s) of a gyro at rest, over temperature (K): eq. (34)."""
    return _fit_curve(temperature, rough, order, "temperature", CELSIUS_ZERO)


def fit_scale_over_rate(bias_compensated: ArrayLike, rate: ArrayLike, order: int = 2) -> Curve:
    """Fit the applied rate over the measured one (both rad/s), at one temperature: eq. (35).

    The measured rate carries the noise here. It flattens the line by noise² over the variance of the rates: 1e-7 for
    0.06 °/s in ± 360 °/s, which is left alone.
    """
    return _fit_curve(bias_compensated, rate, order, "measured rate", 0.0)


def fit_scale_over_temperature(
    temperature: ArrayLike, rate_compensated: ArrayLike, rate: ArrayLike, order: int = 2
) -> Curve:
    """Fit the factor that brings the output (rad/s) to the applied rate (rad/s), over temperature (K): eq. (36)."""
    T, measured, applied = read_columns(temperature=temperature, rate_compensated=rate_compensated, rate=rate)
    if np.any(applied == 0) or np.any(np.abs(measured) < 0.1 * np.abs(applied)):
        raise CompensationError("the scale over temperature needs a gyro that turns in every row of the run.")
    return _fit_curve(T, applied / measured, order, "temperature", CELSIUS_ZERO)


def design_smoother(sampling: float, cutoff: float, order: int = 50) -> Real:
    """Return the taps of a low-pass FIR filter (Hamming window) with unit gain at rest.

    Parameters
    ----------
    sampling : float
        Step (s) of the output; 0.1 s in the paper.
    cutoff : float
        Frequency (Hz) of half the amplitude.
    order : int
        Number of taps less one; 50 in the paper.

    Raises
    ------
    CompensationError
        When the cut-off is not below half the sampling rate, as with the paper's 200 Hz at 10 Hz output.
    """
    from scipy.signal import firwin

    if order < 1 or sampling <= 0:
        raise CompensationError("a FIR filter needs an order of 1 or more and a positive sampling step.")
    if not 0 < cutoff < 0.5 / sampling:
        raise CompensationError(
            f"a cut-off of {cutoff:g} Hz is impossible at an output every {sampling:g} s: it must lie below {0.5 / sampling:g} Hz."
        )
    return np.asarray(firwin(order + 1, cutoff, fs=1 / sampling), dtype=float)


def smooth(values: ArrayLike, taps: Real) -> Real:
    """Return the causal FIR output, settled on the first value at the start, as firmware computes it."""
    from scipy.signal import lfilter

    x = np.asarray(values, dtype=float)
    if not len(taps):
        return x
    before = np.full(len(taps) - 1, x[0])
    return np.asarray(lfilter(taps, [1.0], np.r_[before, x])[len(before) :], dtype=float)


def fit_chain(
    rates: Run,
    rest: Run,
    turning: Run,
    *,
    rough: Run | None = None,
    cutoff: float | None = 1.0,
    order: int = 50,
    sampling: float | None = None,
) -> Chain:
    """Fit all steps in the paper's order.

    Parameters
    ----------
    rates : Run
        Several applied rates at one temperature: eq. (35).
    rest : Run
        The gyro at rest over temperature: eq. (34).
    turning : Run
        One rate over temperature: eq. (36).
    rough : Run, optional
        A run at rest and turning for (33); `rates` when left out.
    cutoff : float or None
        Cut-off (Hz) of the FIR filter; None for no filter.
    order : int
        Its order.
    sampling : float, optional
        Step (s) of the output that it will filter; that of `rest` when left out.

    Raises
    ------
    CompensationError
        When a run does not vary what its step needs, names the step.
    """
    null, scale, covariance = _step("rough null and scale (33)", fit_rough, rates if rough is None else rough)
    bias = _step("bias over temperature (34)", fit_bias, rest.temperature, scale * (rest.output - null))
    straight = scale * (rates.output - null) - bias.value(rates.temperature)
    over_rate = _step("scale over rate (35)", fit_scale_over_rate, straight, rates.rate)
    constant = over_rate.value(scale * (turning.output - null) - bias.value(turning.temperature))
    over_temperature = _step(
        "scale over temperature (36)", fit_scale_over_temperature, turning.temperature, constant, turning.rate
    )
    if cutoff is None:
        return Chain(null, scale, covariance, bias, over_rate, over_temperature, np.empty(0), 0.0)
    step = require_regular(rest.time, "the FIR filter") if sampling is None else sampling
    return Chain(null, scale, covariance, bias, over_rate, over_temperature, design_smoother(step, cutoff, order), step)


def apply_chain(
    chain: Chain, time: ArrayLike, output: ArrayLike, temperature: ArrayLike, *, extrapolate: bool = False
) -> ChainOutput:
    """Return the rate after each step of eq. (32), and after the filter.

    Parameters
    ----------
    chain : Chain
        The fitted steps.
    time, output, temperature : array (N,)
        Times (s), raw output (counts) and temperature (K).
    extrapolate : bool
        Allow temperatures and rates outside the fitted ranges.

    Raises
    ------
    CompensationError
        On values that are not finite or out of range, or a sampling that is not the filter's.
    """
    t, A, T = read_columns(time=time, output=output, temperature=temperature)
    rough = chain.scale * (A - chain.null)
    straight = rough - chain.bias.value(T)
    if not extrapolate:
        chain.bias.refuse_outside(T, "temperature", _show_celsius)
        chain.scale_over_temperature.refuse_outside(T, "temperature", _show_celsius)
        chain.scale_over_rate.refuse_outside(straight, "rate", lambda rate: f"{np.degrees(rate):.2f} °/s")
    linear = chain.scale_over_rate.value(straight)
    steady = linear * chain.scale_over_temperature.value(T)
    if len(chain.taps):
        step = require_regular(t, "the FIR filter")
        if abs(step - chain.sampling) > 1e-3 * chain.sampling:
            raise CompensationError(
                f"the FIR filter was designed for an output every {chain.sampling:g} s, not every {step:g} s."
            )
    return ChainOutput(rough, straight, linear, steady, smooth(steady, chain.taps))


def invert_chain(chain: Chain, rate: ArrayLike, temperature: ArrayLike) -> Real:
    """Return the raw output (counts) that the chain, without its filter, turns into this rate (rad/s).

    The quadratic (35) is inverted on its rising branch; this makes the twin of a gyro that the chain describes.
    """
    T = np.asarray(temperature, dtype=float)
    target = np.asarray(rate, dtype=float) / chain.scale_over_temperature.value(T)
    c0, c1, c2 = np.pad(chain.scale_over_rate.coefficients, (0, 3))[:3]
    shift = c0 - target
    root = np.sqrt(c1**2 - 4 * c2 * shift)
    straight = chain.scale_over_rate.reference - 2 * shift / (c1 + root)
    counts: Real = (straight + chain.bias.value(T)) / chain.scale + chain.null
    if not np.all(np.isfinite(counts)):
        raise CompensationError("the scale over rate turns back within this range and cannot be inverted.")
    return counts


def same_rate(rate: ArrayLike) -> Real:
    """Return the applied rates rounded to a thousandth of the largest, so that a rate table's jitter is one rate."""
    x = np.asarray(rate, dtype=float)
    grain = PLATEAU * float(np.max(np.abs(x), initial=0.0)) or 1.0
    return np.asarray(np.round(x / grain) * grain, dtype=float)


@dataclass(frozen=True)
class Linearity:
    """The line through measured over applied rate, and the largest departure from it.

    Attributes
    ----------
    slope, intercept : float
        Of the line (1, rad/s).
    nonlinearity : float
        Largest deviation from the line over full scale (1), full scale being the largest applied rate.
    """

    slope: float
    intercept: float
    nonlinearity: float


def measure_linearity(applied: ArrayLike, measured: ArrayLike) -> Linearity:
    """Judge measured against applied rate (rad/s) by the means of each applied rate, as the BVG paper does.

    Raises
    ------
    CompensationError
        With fewer than three different applied rates.
    """
    x, y = read_columns(applied=applied, measured=measured)
    _, kind = np.unique(same_rate(x), return_inverse=True)
    rates = np.bincount(kind, x) / np.bincount(kind)
    if len(rates) < 3:
        raise CompensationError(f"nonlinearity needs three applied rates or more, not {len(rates)}.")
    means = np.bincount(kind, y) / np.bincount(kind)
    slope, intercept = np.polynomial.polynomial.polyfit(rates, means, 1)[::-1]
    worst = np.max(np.abs(means - slope * rates - intercept))
    return Linearity(float(slope), float(intercept), float(worst / np.max(np.abs(rates))))


def _fit_curve(x: ArrayLike, y: ArrayLike, order: int, name: str, reference: float) -> Curve:
    fit = fit_polynomial(x, y, order, name)
    scaled, _ = fit.about(reference)
    # The same change of variable carries the covariance that allows for correlated residuals.
    change = np.column_stack([_about(fit.centre, fit.half_span, power, reference, order) for power in range(order + 1)])
    covariance = change @ correlated_covariance(fit.regression) @ change.T
    values = np.asarray(x, dtype=float)
    return Curve(scaled, covariance, reference, float(values.min()), float(values.max()))


def _about(centre: float, half_span: float, power: int, reference: float, order: int) -> Real:
    """Coefficients in (x − reference) of ((x − centre) / half_span)^power, padded to `order`."""
    base = np.array([(reference - centre) / half_span, 1 / half_span])
    return np.pad(np.polynomial.polynomial.polypow(base, power), (0, order - power))


def _step(name: str, fit: Callable[..., Fitted], *arguments: Any) -> Fitted:
    try:
        return fit(*arguments)
    except CompensationError as error:
        raise CompensationError(f"{name}: {error}") from error


def _show_celsius(temperature: float) -> str:
    return f"{temperature - CELSIUS_ZERO:.2f} °C"
