"""Demodulated dynamics of a Coriolis vibratory gyro: the angular rate is the input, the secondary amplitude the output.

Equation numbers are those of the CVG paper on demodulated dynamics and optimal noise filtering; (7) is exact
(`motion.propagate_envelope` solves it). (12) neglects the reaction of the secondary, of order (Ω/kζ)²; (24) also the
second derivative, of order ζ + λ/ω, and the mismatch of the two modes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.motion import SensitiveElement, propagate_envelope, tune
from compensation.samples import read_columns
from compensation.transfer import TransferFunction


def relate_rate_to_secondary(element: SensitiveElement) -> TransferFunction:
    """W₂(s) = A₁ (s + j g₂ ω) / ((s + jω)² + 2 ζ₂ k₂ (s + jω) + k₂²), m per rad/s: eq. (12); its response is (13), poles (15)."""
    e, A1 = element, element.primary_amplitude
    return TransferFunction((A1, 1j * A1 * e.g2 * e.omega), expand_secondary(e))


def expand_secondary(element: SensitiveElement) -> tuple[complex, ...]:
    """Coefficients of (s + jω)² + 2 ζ₂ k₂ (s + jω) + k₂², the denominator of eq. (12)."""
    e = element
    detuning = (e.k2 - e.omega) * (e.k2 + e.omega)  # k₂² − ω², written so that nothing cancels near resonance
    return 1.0, 2 * (e.zeta2 * e.k2 + 1j * e.omega), detuning + 2j * e.omega * e.zeta2 * e.k2


def respond_to_oscillating_rate(element: SensitiveElement, frequency: ArrayLike) -> tuple[Array, Array]:
    """Return amplitude A(λ) (m per rad/s) and phase φ(λ) (rad, all four quadrants) of the secondary for the rate e^{jλt}: eq. (14)."""
    response = relate_rate_to_secondary(element).respond(frequency)
    return np.abs(response), np.angle(response)


def relate_rate_to_tuned_amplitude(element: SensitiveElement) -> TransferFunction:
    """W₂₀(s) = q₁₀ g₂ √(1 − 2ζ²) / (4 k² ζ (1 − ζ²) (s + kζ)), m per rad/s: eq. (24), with k₁ and ζ₁ for both modes."""
    k, zeta = element.k1, element.zeta1
    gain = element.q10 * element.g2 * np.sqrt(1 - 2 * zeta**2) / (4 * k**2 * zeta * (1 - zeta**2))
    return TransferFunction((gain,), (1.0, k * zeta))


def relate_rate_to_measured_rate(k: float, zeta: float) -> TransferFunction:
    """W(s) = k ζ / (s + k ζ), actual rate to measured rate of a tuned gyro: eq. (25)."""
    return TransferFunction((k * zeta,), (1.0, k * zeta))


@dataclass(frozen=True)
class ErrorMap:
    """Figure 3: the integral error of the simplified dynamics over the mismatch of the two modes."""

    frequency_ratio: Array  # frequency_ratio, damping_ratio: arrays (N,), (M,), δk = k₂/k₁ and δζ = ζ₂/ζ₁ (1)
    damping_ratio: Array
    error: Array  # array (M, N), J of eq. (26) over the integral of the realistic amplitude squared (1)


def map_integral_error(frequency_ratio: ArrayLike, damping_ratio: ArrayLike, *, k: float, zeta: float) -> ErrorMap:
    """Judge the simplified transfer function (24) on mistuned gyros by its integral error: eq. (26), figure 3.

    J(δk, δζ) = ∫₀ᵀ [A₂₀ − A₂₀*]² dt / ∫ A₂₀*² dt after a step of the rate, A₂₀* from (1) for k₂ = δk k, ζ₂ = δζ ζ, the
    latter of the tuned gyro; here T = 5 / (k ζ).
    """
    ratios, dampings = np.array(frequency_ratio, float, ndmin=1), np.array(damping_ratio, float, ndmin=1)
    if np.any(ratios <= 0) or np.any(dampings <= 0):
        raise CompensationError("the ratios of frequency and of damping must be positive.")
    time = np.linspace(0.0, 5 / (k * zeta), 400)
    step = np.where(time > 0, 1.0, 0.0)
    tuned = tune(k, zeta)
    simple = relate_rate_to_tuned_amplitude(tuned).simulate(time, step)
    size = float(np.trapezoid(np.abs(propagate_envelope(tuned, time, step).secondary) ** 2, time))
    error = np.empty((len(dampings), len(ratios)))
    for i, damping in enumerate(dampings):
        for j, ratio in enumerate(ratios):
            real = SensitiveElement(k, k * ratio, zeta, zeta * damping, tuned.omega)
            amplitude = np.abs(propagate_envelope(real, time, step).secondary)
            error[i, j] = np.trapezoid((simple - amplitude) ** 2, time) / size
    return ErrorMap(ratios, dampings, error)


def measure_rate(element: SensitiveElement, time: ArrayLike, rate: ArrayLike) -> Array:
    """Return the rate (rad/s) of the 'realistic' gyro of figures 5–7: the full dynamics, demodulated in the phase of W₂(0), scaled."""
    read_columns(time=time, rate=rate)
    secondary = propagate_envelope(element, time, rate).secondary
    return np.asarray((secondary / relate_rate_to_secondary(element).steady_gain).real)
