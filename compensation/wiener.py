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
from compensation.spectral import CrossSpectrum, Spectrum, factorise, multiply, reflect, require_possible, separate
from compensation.transfer import TransferFunction

UNITY = TransferFunction((1.0,), (1.0,))


@dataclass(frozen=True)
class WienerFilter:
    """A filter behind a gyro, with the parts of its error variance."""

    filter: TransferFunction  # G(s)
    # distortion, noise, joint: variance (rad²/s²) of (G W − H) Ω and of G φ, and twice their covariance; their
    # sum is E ε² of eq. (30)
    distortion: float
    noise: float
    joint: float = 0.0

    @property
    def error(self) -> float:
        """E ε² (rad²/s²)."""
        return self.distortion + self.noise + self.joint


def design_wiener_filter(
    gyro: TransferFunction, rate: Spectrum, noise: Spectrum, wanted: TransferFunction = UNITY,
    weight: Spectrum | None = None, cross: CrossSpectrum | None = None,
) -> WienerFilter:  # fmt: skip
    """Return the causal filter of least error variance behind `gyro`, eqs. (31)–(34); `wanted` H(s), `weight` R(s), `cross` S_φΩ(s).

    ε = (G W − H) Ω + G φ: G = Γ⁻¹ (T₀ + T₊) D⁻¹, D D* = W S_Ω W* + W S_φΩ + S_Ωφ W* + S_φ, Γ Γ* = R, T = Γ H (S_Ω W* + S_φΩ)/D*.
    """
    require_possible(rate, noise, cross)
    if not gyro.is_real or not gyro.is_stable:
        raise CompensationError("the Wiener filter needs a stable gyro with real coefficients, such as eq. (25).")
    if not wanted.is_real or not wanted.is_stable:
        raise CompensationError("the wanted output H(s) must be stable with real coefficients.")
    n_w, d_w = np.real(gyro.numerator), np.real(gyro.denominator)
    n_h, d_h = np.real(wanted.numerator), np.real(wanted.denominator)
    d_a, d_b = factorise(rate.denominator), factorise(noise.denominator)
    # A factor that a density's sign carries, such as −1 in (−1, 0, B²), belongs to the numerator.
    N_a, N_b = _numerator_over(rate, d_a), _numerator_over(noise, d_b)
    n_g = d_g = np.ones(1)  # Γ with Γ Γ* = R
    if weight is not None:
        d_g = factorise(weight.denominator)
        n_g = factorise(_numerator_over(weight, d_g))
    left, right, N_c = _cross_parts(cross)
    mirrored = reflect(right)
    if len(right) % 2 == 0:
        mirrored = -mirrored  # monic, with roots to the left
    q = multiply(left, mirrored)
    both = multiply(d_a, reflect(d_a), d_b, reflect(d_b))
    # W S_φΩ over the common denominator d_w d_w* d_a d_a* d_b d_b* q q*, and its mirror image
    coupling = multiply(n_w, N_c, reflect(d_w), both, reflect(left), mirrored, _over(reflect(mirrored), right))
    square = multiply(N_a, n_w, reflect(n_w), d_b, reflect(d_b), q, reflect(q))
    for term in (multiply(N_b, d_a, reflect(d_a), d_w, reflect(d_w), q, reflect(q)), coupling, reflect(coupling)):
        square = np.asarray(np.polyadd(square, term), dtype=float)
    square[-2::-2] = 0.0
    Delta = factorise(square)
    # T over the stable d_g d_h d_a left and the antistable Δ*
    inner = multiply(N_a, reflect(n_w), reflect(d_b), reflect(q), left)
    joint = multiply(N_c, reflect(d_w), reflect(d_a), reflect(d_b), reflect(left), _over(reflect(mirrored), right), d_a)
    top = multiply(n_g, n_h, np.asarray(np.polyadd(inner, joint), dtype=float))
    stable = multiply(d_g, d_h, d_a, left)
    whole, remainder = np.polydiv(top, multiply(stable, reflect(Delta)))
    causal = separate(np.atleast_1d(remainder), stable, reflect(Delta))
    t = np.asarray(np.polyadd(multiply(np.atleast_1d(whole), stable), causal), dtype=float)
    best = TransferFunction(tuple(multiply(t, d_w, d_b, mirrored)), tuple(multiply(n_g, d_h, Delta))).cancel()
    return judge_filter(best, gyro, rate, noise, wanted, cross)


def judge_filter(
    candidate: TransferFunction, gyro: TransferFunction, rate: Spectrum, noise: Spectrum,
    wanted: TransferFunction = UNITY, cross: CrossSpectrum | None = None,
) -> WienerFilter:  # fmt: skip
    """Return any filter behind the gyro with its error variances: eqs. (30), (31), without weight."""
    require_possible(rate, noise, cross)
    n, d = np.real(candidate.numerator), np.real(candidate.denominator)
    n_w, d_w = np.real(gyro.numerator), np.real(gyro.denominator)
    n_h, d_h = np.real(wanted.numerator), np.real(wanted.denominator)
    whole = multiply(d, d_w, d_h)
    deviation = np.asarray(np.polysub(multiply(n, n_w, d_h), multiply(d, d_w, n_h)), dtype=float)
    joint = 0.0 if cross is None else _joint_variance(deviation, whole, n, d, cross)
    return WienerFilter(candidate, _shape(rate, deviation, whole).variance, _shape(noise, n, d).variance, joint)


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


def _cross_parts(cross: CrossSpectrum | None) -> tuple[Array, Array, Array]:
    """The factors of the cross density's denominator to the left and to the right, and its numerator; 1, 1, 0 without one."""
    if cross is None:
        return np.ones(1), np.ones(1), np.zeros(1)
    return *cross.split_poles(), np.asarray(cross.numerator, dtype=float)


def _over(one: Array, other: Array) -> Array:
    """The number that one polynomial is of another with the same roots."""
    return np.array([one[0] / other[0]])


def _joint_variance(deviation: Array, whole: Array, n: Array, d: Array, cross: CrossSpectrum) -> float:
    """∫ 2 Re{(G W − H) S_φΩ G*} dω/2π."""
    left, right = cross.split_poles()
    top = np.trim_zeros(multiply(deviation, np.asarray(cross.numerator, dtype=float), reflect(n)), "f")
    stable, antistable = multiply(whole, left), multiply(right, reflect(d))
    fall = len(stable) + len(antistable) - 1 - len(top)
    if not len(top):
        return 0.0
    if fall < 1:
        return float("inf")
    # the residues to the left; of a density that falls as 1/s the odd half integrates to nothing
    residues = separate(top, stable, antistable)[1] / stable[0] if len(stable) > 1 else 0.0
    return 2 * float(residues - (top[0] / (stable[0] * antistable[0]) / 2 if fall == 1 else 0.0))
