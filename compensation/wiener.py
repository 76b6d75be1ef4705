"""Optimal static (Wiener) filter of a gyro's sensor noise, by spectral factorisation.

Equation numbers are those of the paper on demodulated dynamics and optimal noise filtering for CVGs. Spectral
densities are even rational functions of s, two-sided: variance = ∫ S(jω) dω / 2π. (The paper's criterion (30) lacks
this 1/2π, which moves no minimum.) An asterisk is s → −s; rate and noise are uncorrelated, as in the paper.

With S_Ω = N_a/(d_a d_a*), S_φ = N_b/(d_b d_b*), W = n_w/d_w and Δ Δ* = N_a n_w n_w* d_b d_b* + N_b d_a d_a* d_w d_w*,
equations (32), (34) become G = t d_w d_b / Δ, where t/d_a is the causal part of N_a n_w* d_b* / (d_a Δ*).
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.errors import CompensationError
from compensation.transfer import TransferFunction

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Spectrum:
    """An even rational spectral density S(s) = numerator(s) / denominator(s), highest power of s first.

    Raises
    ------
    CompensationError
        When a polynomial has an odd power of s, or S(jω) is negative somewhere.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            coefficients = np.trim_zeros(np.asarray(getattr(self, name), dtype=float), "f")
            if not len(coefficients) or not np.all(np.isfinite(coefficients)):
                raise CompensationError(
                    f"the {name} of a spectral density must have finite coefficients, not all zero."
                )
            if np.any(coefficients[-2::-2]):
                raise CompensationError(f"the {name} of a spectral density must be even in s.")
            object.__setattr__(self, name, tuple(coefficients.tolist()))
        corner = np.abs(np.r_[1.0, np.roots(self.numerator), np.roots(self.denominator)])
        corner = corner[corner > 0]
        frequency = np.geomspace(corner.min() / 100, corner.max() * 100, 999)
        if np.any(_sign(self.numerator, frequency) * _sign(self.denominator, frequency) < 0):
            raise CompensationError("the spectral density is negative at some frequency; check its signs (s² = −ω²).")

    def density(self, frequency: ArrayLike) -> Real:
        """Return S(jω) at angular frequencies (rad/s)."""
        s = 1j * np.asarray(frequency, dtype=float)
        values: Real = (np.polyval(self.numerator, s) / np.polyval(self.denominator, s)).real
        return values

    @property
    def variance(self) -> float:
        """∫ S(jω) dω / 2π; infinite when S does not fall with frequency.

        S is split into a(s)/d(s) + a(−s)/d(−s), d stable; the variance is then the limit of s a(s)/d(s).
        """
        if len(self.numerator) >= len(self.denominator):
            return float("inf")
        d = factorise(self.denominator)
        causal = separate(np.array(self.numerator), d, reflect(d))
        return float(causal[1] / d[0]) if len(d) > 1 else 0.0


def rate_spectrum(sigma: float, B: float) -> Spectrum:
    """S_Ω = σ² B² / (B² − s²), the rate of a moving object of bandwidth B (rad/s): eq. (27); variance σ² B/2."""
    return Spectrum(((sigma * B) ** 2,), (-1.0, 0.0, B**2))


def white_spectrum(gamma: float, sigma: float) -> Spectrum:
    """S_φ = γ² σ², white sensor noise: eq. (28)."""
    return Spectrum(((gamma * sigma) ** 2,), (1.0,))


def high_pass_spectrum(gamma: float, sigma: float, B: float) -> Spectrum:
    """S_φ = −γ² σ² s² / (B² − s²), sensor noise above the bandwidth B (rad/s): eq. (29)."""
    return Spectrum((-((gamma * sigma) ** 2), 0.0, 0.0), (-1.0, 0.0, B**2))


def reflect(polynomial: ArrayLike) -> Real:
    """Return p(−s) for the coefficients of p(s), highest power first."""
    p = np.array(polynomial, dtype=float)
    p[-2::-2] *= -1
    return p


def factorise(even: ArrayLike) -> Real:
    """Return the polynomial d with d(s) d(−s) = ± even(s) and all roots to the left, found from the roots in s².

    Raises
    ------
    CompensationError
        When a root lies on the imaginary axis, where no stable factor exists.
    """
    p = np.trim_zeros(np.asarray(even, dtype=float), "f")
    squares = np.roots(p[::2])
    # A double root on the axis comes out of the root finder as a pair that is 1e-8 apart.
    on_axis = (squares.real <= 0) & (np.abs(squares.imag) <= 1e-6 * np.abs(squares))
    if np.any(on_axis):
        at = float(np.sqrt(np.abs(squares[on_axis][0])))
        raise CompensationError(
            f"a spectral density is zero or infinite at {at:g} rad/s, so it has no stable factor; "
            "add a little white noise, or give a drift a corner frequency."
        )
    factor = np.poly(-np.sqrt(squares.astype(complex))).real
    return np.asarray(np.sqrt(abs(p[0])) * np.atleast_1d(factor), dtype=float)


def separate(numerator: Real, stable: Real, antistable: Real) -> Real:
    """Return t of numerator / (stable · antistable) = t / stable + (what has only antistable poles).

    t includes the constant part, so it has as many coefficients as `stable` (Wiener–Hopf separation of eq. (34)).
    """
    n, m = len(stable) - 1, len(antistable) - 1
    if len(numerator) > n + m + 1:
        raise CompensationError("the ratio of spectral densities grows with frequency; the optimum does not exist.")
    # Solve numerator = t · antistable + b · stable, in units of s in which the coefficients are of order one.
    scale = float(np.abs(np.r_[np.roots(stable), np.roots(antistable)]).max(initial=0.0)) or 1.0
    S, U, N = (p * scale ** np.arange(len(p) - 1, -1, -1.0) for p in (stable, antistable, numerator))
    size = n + m + 1
    matrix = np.zeros((size, size))
    for column in range(n + 1):
        matrix[column : column + m + 1, column] = U
    for column in range(m):
        matrix[column + 1 : column + n + 2, n + 1 + column] = S
    right = np.zeros(size)
    right[size - len(N) :] = N
    t = np.asarray(np.linalg.solve(matrix, right)[: n + 1], dtype=float)
    if len(N) < size:
        t[0] = 0.0  # the constant part, zero but for rounding
    return t / scale ** np.arange(n, -1, -1.0)


@dataclass(frozen=True)
class WienerFilter:
    """A filter behind a gyro, with the two parts of its error variance.

    Attributes
    ----------
    filter : TransferFunction
        G(s).
    distortion, noise : float
        Variance (rad²/s²) of (G W − 1) Ω and of G φ; their sum is E ε² of eq. (30).
    """

    filter: TransferFunction
    distortion: float
    noise: float

    @property
    def error(self) -> float:
        """E ε² (rad²/s²)."""
        return self.distortion + self.noise


def design_wiener_filter(gyro: TransferFunction, rate: Spectrum, noise: Spectrum) -> WienerFilter:
    """Return the causal filter of least error variance behind `gyro`: eqs. (32), (34) with H = R = 1.

    Parameters
    ----------
    gyro : TransferFunction
        W(s) from rate to output, stable with real coefficients, such as eq. (25).
    rate, noise : Spectrum
        S_Ω of the rate (rad²/s) and S_φ of the sensor noise at the output; any even rational densities.

    Raises
    ------
    CompensationError
        When W is not stable or not real, or the densities have no stable factors.
    """
    if not gyro.is_real or not gyro.is_stable:
        raise CompensationError("the Wiener filter needs a stable gyro with real coefficients, such as eq. (25).")
    n_w, d_w = np.real(gyro.numerator), np.real(gyro.denominator)
    d_a, d_b = factorise(rate.denominator), factorise(noise.denominator)
    # A factor that a density's sign carries, such as −1 in (−1, 0, B²), belongs to the numerator.
    N_a, N_b = _numerator_over(rate, d_a), _numerator_over(noise, d_b)
    square = np.polyadd(
        _multiply(N_a, n_w, reflect(n_w), d_b, reflect(d_b)),
        _multiply(N_b, d_a, reflect(d_a), d_w, reflect(d_w)),
    )
    Delta = factorise(square)
    t = separate(_multiply(N_a, reflect(n_w), reflect(d_b)), d_a, reflect(Delta))
    best = TransferFunction(tuple(_multiply(t, d_w, d_b)), tuple(Delta)).cancel()
    return judge_filter(best, gyro, rate, noise)


def judge_filter(candidate: TransferFunction, gyro: TransferFunction, rate: Spectrum, noise: Spectrum) -> WienerFilter:
    """Return any filter behind the gyro with its error variances: eqs. (30), (31)."""
    n, d = np.real(candidate.numerator), np.real(candidate.denominator)
    n_w, d_w = np.real(gyro.numerator), np.real(gyro.denominator)
    whole = _multiply(d, d_w)
    deviation = np.asarray(np.polysub(_multiply(n, n_w), whole), dtype=float)
    return WienerFilter(candidate, _shape(rate, deviation, whole).variance, _shape(noise, n, d).variance)


def renormalise(candidate: TransferFunction, gyro: TransferFunction) -> TransferFunction:
    """Return the filter scaled to G(0) W(0) = 1, so that a constant rate is read without error: eqs. (35), (36)."""
    return candidate * (1 / (candidate.steady_gain * gyro.steady_gain))


@dataclass(frozen=True)
class WienerDerivation:
    """SymPy results of the derivation: the factor Δ of the output's density, the optimum G, and G renormalised."""

    factor: Any
    optimum: Any
    renormalised: Any


def derive_wiener_filter(noise: Literal["white", "high-pass"]) -> WienerDerivation:
    """Derive eq. (35) or (36) in symbols (γ, B, ζ, k, s), for W of eq. (25) and the rate (27).

    Δ Δ* = p s⁴ − q s² + r gives Δ = √p s² + √(q + 2√(p r)) s + √r; the causal part is one residue at s = −B.
    """
    import sympy

    gamma, B, zeta, k = sympy.symbols("gamma B zeta k", positive=True)
    s = sympy.Symbol("s")
    a = k * zeta
    square = (B * a) ** 2 + gamma**2 * (a**2 - s**2) * (B**2 - s**2 if noise == "white" else -(s**2))
    p, _, q, _, r = sympy.Poly(sympy.expand(square), s).all_coeffs()
    root_r = sympy.sqrt(sympy.factor(r))
    Delta = sympy.sqrt(p) * s**2 + sympy.sqrt(sympy.factor(2 * sympy.sqrt(p) * root_r - q)) * s + root_r
    # Here t d_b is constant for both noises: with (29) the factor B + s of d_b cancels one of Δ.
    residue = sympy.simplify(B**2 * a / Delta.subs(s, -s).subs(s, -B))
    optimum = residue * (s + a) / Delta
    return WienerDerivation(Delta, optimum, sympy.simplify(optimum / optimum.subs(s, 0)))


def _sign(polynomial: tuple[float, ...], frequency: Real) -> Real:
    """Sign of an even polynomial at jω; 0 where rounding decides it."""
    terms = np.array(polynomial)[:, None] * (1j * frequency) ** np.arange(len(polynomial) - 1, -1, -1)[:, None]
    value = np.sum(terms.real, axis=0)
    return np.where(np.abs(value) > 1e-12 * np.sum(np.abs(terms), axis=0), np.sign(value), 0.0)


def _multiply(*polynomials: Real) -> Real:
    product = np.ones(1)
    for polynomial in polynomials:
        product = np.convolve(product, polynomial)
    return product


def _numerator_over(spectrum: Spectrum, factor: Real) -> Real:
    """The numerator that belongs to the denominator factor(s) factor(−s)."""
    square = _multiply(factor, reflect(factor))
    return np.array(spectrum.numerator) * float(square[0] / spectrum.denominator[0])


def _shape(spectrum: Spectrum, numerator: Real, denominator: Real) -> Spectrum:
    """The density behind a filter, |numerator/denominator|² S, with odd powers that rounding left taken out."""
    top = _multiply(np.array(spectrum.numerator), numerator, reflect(numerator))
    bottom = _multiply(np.array(spectrum.denominator), denominator, reflect(denominator))
    top[-2::-2] = bottom[-2::-2] = 0.0
    return Spectrum(tuple(top), tuple(bottom))
