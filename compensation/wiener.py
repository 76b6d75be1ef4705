"""Optimal static (Wiener) filter of a gyro's sensor noise, by spectral factorisation.

Equation numbers are those of the paper on demodulated dynamics and optimal noise filtering for CVGs. An asterisk is s → −s.
(The paper's criterion (30) lacks the 1/2π of `compensation.spectral`, which moves no minimum.)

With S_Ω = N_a/(d_a d_a*), S_φ = N_b/(d_b d_b*), W = n_w/d_w and rate and noise uncorrelated, as in the paper's examples,
Δ Δ* = N_a n_w n_w* d_b d_b* + N_b d_a d_a* d_w d_w*, and (32), (34) become G = t d_w d_b / Δ, where t/d_a is the causal part of
N_a n_w* d_b* / (d_a Δ*).
"""

from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.spectral import Spectrum, factorise, multiply, reflect, separate
from compensation.transfer import TransferFunction


@dataclass(frozen=True)
class WienerFilter:
    """A filter behind a gyro, with the parts of its error variance."""

    filter: TransferFunction  # G(s)
    # distortion, noise: variance (rad²/s²) of (G W − 1) Ω and of G φ; their sum is E ε² of eq. (30)
    distortion: float
    noise: float

    @property
    def error(self) -> float:
        """E ε² (rad²/s²)."""
        return self.distortion + self.noise


def design_wiener_filter(gyro: TransferFunction, rate: Spectrum, noise: Spectrum) -> WienerFilter:
    """Return the causal filter of least error variance behind `gyro`, eqs. (31)–(34): ε = (G W − 1) Ω + G φ."""
    if not gyro.is_real or not gyro.is_stable:
        raise CompensationError("the Wiener filter needs a stable gyro with real coefficients, such as eq. (25).")
    n_w, d_w = np.real(gyro.numerator), np.real(gyro.denominator)
    d_a, d_b = factorise(rate.denominator), factorise(noise.denominator)
    # A factor that a density's sign carries, such as −1 in (−1, 0, B²), belongs to the numerator.
    N_a, N_b = _numerator_over(rate, d_a), _numerator_over(noise, d_b)
    signal = multiply(N_a, n_w, reflect(n_w), d_b, reflect(d_b))
    square = np.asarray(np.polyadd(signal, multiply(N_b, d_a, reflect(d_a), d_w, reflect(d_w))), dtype=float)
    square[-2::-2] = 0.0
    Delta = factorise(square)
    t = separate(multiply(N_a, reflect(n_w), reflect(d_b)), d_a, reflect(Delta))
    best = TransferFunction(tuple(multiply(t, d_w, d_b)), tuple(Delta)).cancel()
    return judge_filter(best, gyro, rate, noise)


def judge_filter(candidate: TransferFunction, gyro: TransferFunction, rate: Spectrum, noise: Spectrum) -> WienerFilter:
    """Return any filter behind the gyro with its error variances: eqs. (30), (31)."""
    n, d = np.real(candidate.numerator), np.real(candidate.denominator)
    n_w, d_w = np.real(gyro.numerator), np.real(gyro.denominator)
    whole = multiply(d, d_w)
    deviation = np.asarray(np.polysub(multiply(n, n_w), whole), dtype=float)
    return WienerFilter(candidate, _shape(rate, deviation, whole).variance, _shape(noise, n, d).variance)


def renormalise(candidate: TransferFunction, gyro: TransferFunction) -> TransferFunction:
    """Return the filter scaled to G(0) W(0) = 1, so that a constant rate is read without error: eqs. (35), (36)."""
    return candidate * (1 / (candidate.steady_gain * gyro.steady_gain))


def _numerator_over(spectrum: Spectrum, factor: Array) -> Array:
    """The numerator that belongs to the denominator factor(s) factor(−s)."""
    square = multiply(factor, reflect(factor))
    return np.array(spectrum.numerator) * float(square[0] / spectrum.denominator[0])


def _shape(spectrum: Spectrum, numerator: Array, denominator: Array) -> Spectrum:
    """The density behind a filter, |numerator/denominator|² S, with odd powers that rounding left taken out."""
    top = multiply(np.array(spectrum.numerator), numerator, reflect(numerator))
    bottom = multiply(np.array(spectrum.denominator), denominator, reflect(denominator))
    top[-2::-2] = bottom[-2::-2] = 0.0
    return Spectrum(tuple(top), tuple(bottom))
