"""Bell-shaped gyro: the four-step compensation of its output.

Equation numbers are those of the BVG paper (Sensors 2015, 15, 23684). The chain (32) is

    Ω = S₃(T) { S₂(Ω) [ S₁ (A − N₁) − N(T) ] }

rough null and scale; bias over temperature; scale over rate; scale over temperature; then a FIR filter. Rates are in °/s and
temperatures in °C, as in the paper, in records and in a model's file.
`compensation.bell_calibration` fits it to runs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.samples import read_columns, require_regular

MARGIN = 0.01  # part of a fitted range by which noise may lead out of it before that counts as extrapolation


@dataclass(frozen=True)
class PolynomialCurve:
    """y = Σ cᵢ xⁱ between `lowest` and `highest` x, with the covariance of c."""

    coefficients: Array
    covariance: Array
    lowest: float
    highest: float

    def value(self, x: ArrayLike) -> Array:
        """Return y at x."""
        return np.asarray(np.polynomial.polynomial.polyval(np.asarray(x, dtype=float), self.coefficients), dtype=float)

    def inverse(self, y: ArrayLike) -> Array:
        """Return x at y, on the rising branch of a parabola."""
        c0, c1, c2 = np.pad(self.coefficients, (0, 3))[:3]
        shift = c0 - np.asarray(y, dtype=float)
        with np.errstate(invalid="ignore"):
            return np.asarray(-2 * shift / (c1 + np.sqrt(c1**2 - 4 * c2 * shift)))

    def refuse_outside(self, x: Array, name: str, unit: str) -> None:
        """Raise when x leaves the fitted range by more than `MARGIN` of it."""
        beyond = MARGIN * (self.highest - self.lowest)
        low, high = float(np.min(x)), float(np.max(x))
        if low < self.lowest - beyond or high > self.highest + beyond:
            raise CompensationError(
                f"the {name} runs from {low:.2f} to {high:.2f} {unit}, but the chain is valid from "
                f"{self.lowest:.2f} to {self.highest:.2f} {unit}; allow extrapolation or calibrate over that range."
            )


@dataclass(frozen=True)
class Warming:
    """An output y that is another while the temperature rises (w = 1) than while it falls (w = −1): y + w (b + g (y − a))."""

    null: float  # a, in the unit of the output
    offset: float  # b
    gain: float  # g
    turn: float  # K by which the temperature goes back before it counts as turned

    def undo(self, output: Array, temperature: Array) -> Array:
        """Return the output without it; until the temperature has moved by `turn`, w = 0."""
        way, low, high, found = 0, np.inf, -np.inf, []
        for T in temperature.tolist():
            low, high = min(low, T), max(high, T)
            if way < 1 and T - low > self.turn:
                way, high = 1, T
            elif way > -1 and high - T > self.turn:
                way, low = -1, T
            found.append(way)
        w = np.array(found)
        return np.asarray((output - w * (self.offset - self.gain * self.null)) / (1 + w * self.gain))


@dataclass(frozen=True)
class BellChain:
    """The fitted steps (33)–(36) and the filter."""

    null: float  # N₁ (counts)
    scale: float  # S₁ (°/s per count)
    rough_covariance: Array  # array (2, 2), covariance of null and scale
    bias: PolynomialCurve  # N(T), °/s over °C: eq. (34)
    scale_over_rate: PolynomialCurve  # rate over rate, °/s: eq. (35), or a `rate_law.RateCurve`
    scale_over_temperature: PolynomialCurve  # factor (1) over °C: eq. (36)
    taps: Array  # array, FIR coefficients, empty for none
    sampling: float  # step (s) that the taps were designed for
    warming: Warming | None = None  # taken out of the output before all steps

    @property
    def delay(self) -> float:
        """Time (s) by which the FIR filter delays the output: half its order."""
        return (len(self.taps) - 1) / 2 * self.sampling if len(self.taps) else 0.0


@dataclass(frozen=True)
class ChainOutput:
    """Rate (°/s) after each step: (33), (34), (35), (36) and the filter."""

    rough: Array
    bias_compensated: Array
    rate_compensated: Array
    temperature_compensated: Array
    filtered: Array


def apply_chain(
    chain: BellChain, time: ArrayLike, output: ArrayLike, temperature: ArrayLike, *, extrapolate: bool = False
) -> ChainOutput:
    """Return the rate after each step of eq. (32), and after the filter."""
    t, A, T = read_columns(time=time, output=output, temperature=temperature)
    rough = chain.scale * ((chain.warming.undo(A, T) if chain.warming else A) - chain.null)
    straight = rough - chain.bias.value(T)
    if not extrapolate:
        chain.bias.refuse_outside(T, "temperature", "°C")
        chain.scale_over_temperature.refuse_outside(T, "temperature", "°C")
        chain.scale_over_rate.refuse_outside(straight, "rate", "°/s")
    linear = chain.scale_over_rate.value(straight)
    steady = linear * chain.scale_over_temperature.value(T)
    if len(chain.taps):
        step = require_regular(t, "the FIR filter")
        if abs(step - chain.sampling) > 1e-3 * chain.sampling:
            raise CompensationError(f"the filter is designed for an output every {chain.sampling:g} s, not {step:g} s.")
    return ChainOutput(rough, straight, linear, steady, smooth(steady, chain.taps))


def invert_chain(chain: BellChain, rate: ArrayLike, temperature: ArrayLike) -> Array:
    """Return the raw output (counts) that the chain, without its filter and warming, turns into this rate (°/s)."""
    T = np.asarray(temperature, dtype=float)
    target = np.asarray(rate, dtype=float) / chain.scale_over_temperature.value(T)
    counts: Array = (chain.scale_over_rate.inverse(target) + chain.bias.value(T)) / chain.scale + chain.null
    if not np.all(np.isfinite(counts)):
        raise CompensationError("the scale over rate has a turning point in this range and cannot be inverted.")
    return counts


def design_smoother(sampling: float, cutoff: float, order: int = 50) -> Array:
    """Return the taps of a low-pass FIR filter (Hamming window) with unit gain at rest and half of it at the `cutoff` (Hz)."""
    from scipy.signal import firwin

    if order < 1 or sampling <= 0:
        raise CompensationError("a FIR filter needs an order of 1 or more and a positive sampling step.")
    if not 0 < cutoff < 0.5 / sampling:
        raise CompensationError(f"a cut-off of {cutoff:g} Hz is impossible at an output every {sampling:g} s: it must lie below {0.5 / sampling:g} Hz.")  # fmt: skip
    return np.asarray(firwin(order + 1, cutoff, fs=1 / sampling), dtype=float)


def smooth(values: ArrayLike, taps: Array) -> Array:
    """Return the causal FIR output, settled on the first value at the start, as firmware computes it.

    Unknown values (NaN) stay so and leave the mean of the others; a value after which less than half of the weight is known stays as it is.
    """
    x = np.asarray(values, dtype=float)
    if not len(taps):
        return x
    past = np.r_[np.full(len(taps) - 1, x[0]), x]
    known = np.isfinite(past)
    if known.all():
        return np.convolve(past, taps, mode="valid")
    total, share = (np.convolve(one, taps, mode="valid") for one in (np.where(known, past, 0.0), known.astype(float)))
    return np.where(np.isfinite(x) & (share > 0.5), total / np.maximum(share, 0.5), x)
