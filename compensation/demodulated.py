"""Demodulated dynamics of a Coriolis vibratory gyro: the angular rate is the input, the secondary amplitude the output.

Equation numbers are those of the CVG paper on demodulated dynamics and optimal noise filtering; (7) is exact
(`motion.propagate_envelope` solves it). (12) neglects the reaction of the secondary, of order (Ω/kζ)²; (24) also the
second derivative, of order ζ + λ/ω, and the mismatch of the two modes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.motion import propagate_envelope
from compensation.samples import read_columns
from compensation.sensitive_element import SensitiveElement, tune
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


def relate_drive_to_primary(element: SensitiveElement) -> TransferFunction:
    """A₁(s) / q₁₀(s) = 1 / ((s + jω)² + 2 ζ₁ k₁ (s + jω) + k₁²), in s²: first of eqs. (7); at s = 0 it is (8)."""
    e = element
    detuning = (e.k1 - e.omega) * (e.k1 + e.omega)
    damping = e.zeta1 * e.k1
    return TransferFunction((1.0,), (1.0, 2 * (damping + 1j * e.omega), detuning + 2j * e.omega * damping))


def relate_primary_to_secondary(element: SensitiveElement, rate: float) -> TransferFunction:
    """A₂(s) / A₁(s) = g₂ Ω (s + jω) / ((s + jω)² + 2 ζ₂ k₂ (s + jω) + k₂²) for a constant rate: second of eqs. (7).

    It holds while the primary still builds up, where (9) and all that follows from it take A₁ as settled.
    """
    gain = element.g2 * rate
    return TransferFunction((gain, 1j * gain * element.omega), expand_secondary(element))


def relate_rate_to_slow_secondary(element: SensitiveElement) -> TransferFunction:
    """W₂(s) with the second derivative of the amplitude neglected: eq. (16), single pole (17)."""
    e, A1 = element, element.primary_amplitude
    return TransferFunction((A1, 1j * A1 * e.g2 * e.omega), expand_secondary(e)[1:])


def find_poles(element: SensitiveElement) -> NDArray[np.complex128]:
    """s₁,₂ = −k₂ ζ₂ ± j k₂ √(1 − ζ₂²) − jω (1/s): eq. (15); the first is the slow one, the second is near −2jω."""
    e = element
    ring = e.k2 * np.sqrt(1 - e.zeta2**2)
    return np.array([-e.k2 * e.zeta2 + 1j * (ring - e.omega), -e.k2 * e.zeta2 - 1j * (ring + e.omega)])


def find_slow_pole(element: SensitiveElement) -> complex:
    """s₁ = −(k₂² − ω² + 2jωζ₂k₂) / (2 (ζ₂ k₂ + jω)) (1/s): eq. (17)."""
    slope, constant = expand_secondary(element)[1:]
    return complex(-constant / slope)


def respond_to_oscillating_rate(element: SensitiveElement, frequency: ArrayLike) -> tuple[Array, Array]:
    """Return amplitude A(λ) (m per rad/s) and phase φ(λ) (rad, all four quadrants) of the secondary for the rate e^{jλt}: eq. (14)."""
    e, frequency = element, np.asarray(frequency, dtype=float)
    shifted = frequency + e.omega
    first, second = e.k1**2 - e.omega**2, e.k2**2 - shifted**2
    gain = e.q10 * (frequency + e.g2 * e.omega)
    amplitude = gain / np.sqrt(
        (second**2 + 4 * e.zeta2**2 * e.k2**2 * shifted**2) * (first**2 + 4 * e.zeta1**2 * e.k1**2 * e.omega**2)
    )
    delta = 2 * (e.k2 * e.zeta2 * shifted * first + e.k1 * e.zeta1 * e.omega * second)
    phase = np.arctan2(second * first - 4 * e.k1 * e.k2 * e.zeta1 * e.zeta2 * e.omega * shifted, delta)
    return amplitude, phase


def split_primary(element: SensitiveElement) -> tuple[float, float]:
    """Real and imaginary part of A₁ (m): eq. (19), without the j that the paper prints in A₁ᵢ, which is a slip."""
    e = element
    detuning, damping = e.k1**2 - e.omega**2, 2 * e.omega * e.k1 * e.zeta1
    size = detuning**2 + damping**2
    return e.q10 * detuning / size, -e.q10 * damping / size


def split_secondary(element: SensitiveElement) -> tuple[TransferFunction, TransferFunction]:
    """Real-coefficient transfer functions from rate to Re A₂ and Im A₂ (m per rad/s): eqs. (21), (22).

    A₂ᵣ = (A₁ᵣ Mᵣᵣ + A₁ᵢ Mᵣᵢ) / P · Ω and A₂ᵢ = (A₁ᵣ Mᵢᵣ + A₁ᵢ Mᵢᵢ) / P · Ω, with M and P as in (22); there
    Mᵣᵣ = Mᵢᵢ and Mᵢᵣ = −Mᵣᵢ.
    """
    e = element
    A1R, A1I = split_primary(e)
    inner = np.array([1.0, 2 * e.k2 * e.zeta2, e.k2**2 - e.omega**2])
    outer = np.array([1.0, e.k2 * e.zeta2])
    along = np.polyadd(np.polymul([1, 0], inner), 2 * e.g2 * e.omega**2 * outer)
    across = e.omega * np.polysub(2 * np.polymul([1, 0], outer), e.g2 * inner)
    P = tuple(np.polyadd(4 * e.omega**2 * np.polymul(outer, outer), np.polymul(inner, inner)))
    return (
        TransferFunction(tuple(np.polyadd(A1R * along, A1I * across)), P),
        TransferFunction(tuple(np.polysub(A1I * along, A1R * across)), P),
    )


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


def map_integral_error(
    frequency_ratio: ArrayLike, damping_ratio: ArrayLike, *, k: float, zeta: float, rate: float = 1.0,
    settling_times: float = 5.0,
) -> ErrorMap:  # fmt: skip
    """Judge the simplified transfer function (24) on mistuned gyros by its integral error: eq. (26), figure 3.

    J(δk, δζ) = ∫₀ᵀ [A₂₀ − A₂₀*]² dt / ∫ A₂₀*² dt after a step of the rate, A₂₀* from (1) for k₂ = δk k, ζ₂ = δζ ζ, the
    latter of the tuned gyro; here T = `settling_times` / (k ζ).
    """
    ratios, dampings = np.array(frequency_ratio, float, ndmin=1), np.array(damping_ratio, float, ndmin=1)
    if np.any(ratios <= 0) or np.any(dampings <= 0):
        raise CompensationError("the ratios of frequency and of damping must be positive.")
    time = np.linspace(0.0, settling_times / (k * zeta), 400)
    step = np.where(time > 0, rate, 0.0)
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
    measured: Array = (secondary / relate_rate_to_secondary(element).steady_gain).real
    return measured
