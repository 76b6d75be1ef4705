"""Rational two-sided spectral densities in s, variance = ∫ S(jω) dω / 2π: stable factors, separation of causal parts."""

from dataclasses import dataclass
from functools import reduce

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError


@dataclass(frozen=True)
class Spectrum:
    """An even rational spectral density S(s) = numerator(s) / denominator(s), highest power of s first."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            coefficients = np.trim_zeros(np.asarray(getattr(self, name), dtype=float), "f")
            if not len(coefficients) or not np.all(np.isfinite(coefficients)):
                raise CompensationError(f"the {name} of a spectral density needs finite coefficients, not all zero.")
            if np.any(coefficients[-2::-2]):
                raise CompensationError(f"the {name} of a spectral density must be even in s.")
            object.__setattr__(self, name, tuple(coefficients.tolist()))
        corner = np.abs(np.r_[1.0, np.roots(self.numerator), np.roots(self.denominator)])
        corner = corner[corner > 0]
        frequency = np.geomspace(corner.min() / 100, corner.max() * 100, 999)
        if np.any(_sign(self.numerator, frequency) * _sign(self.denominator, frequency) < 0):
            raise CompensationError("the spectral density is negative at some frequency; check its signs (s² = −ω²).")

    def density(self, frequency: ArrayLike) -> Array:
        """Return S(jω) at angular frequencies (rad/s)."""
        s = 1j * np.asarray(frequency, dtype=float)
        return np.asarray((np.polyval(self.numerator, s) / np.polyval(self.denominator, s)).real)

    @property
    def variance(self) -> float:
        """∫ S(jω) dω / 2π, or infinite: the limit of s a(s)/d(s), S = a(s)/d(s) + a(−s)/d(−s), d stable."""
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


def reflect(polynomial: ArrayLike) -> Array:
    """Return p(−s) for the coefficients of p(s), highest power first."""
    p = np.array(polynomial, dtype=float)
    p[-2::-2] *= -1
    return p


def factorise(even: ArrayLike) -> Array:
    """Return the polynomial d with d(s) d(−s) = ± even(s) and all roots to the left, found from the roots in s²."""
    p = np.trim_zeros(np.asarray(even, dtype=float), "f")
    squares = np.roots(p[::2])
    # A double root on the axis comes out of the root finder as a pair that is 1e-8 apart.
    on_axis = (squares.real <= 0) & (np.abs(squares.imag) <= 1e-6 * np.abs(squares))
    if np.any(on_axis):
        at = float(np.sqrt(np.abs(squares[on_axis][0])))
        raise CompensationError(
            f"a spectral density is zero or infinite at {at:g} rad/s, so it has no stable factor; add a little white noise, or give a drift a corner frequency."
        )
    factor = np.poly(-np.sqrt(squares.astype(complex))).real
    return np.asarray(np.sqrt(abs(p[0])) * np.atleast_1d(factor), dtype=float)


def separate(numerator: Array, stable: Array, antistable: Array) -> Array:
    """Return t (the constant part in it) of numerator / (stable · antistable) = t / stable + antistable rest: Wiener–Hopf, eq. (34)."""
    n, m = len(stable) - 1, len(antistable) - 1
    if len(numerator) > n + m + 1:
        raise CompensationError("the ratio of spectral densities grows with frequency; the optimum does not exist.")
    # Solve numerator = t · antistable + b · stable, in units of s in which the coefficients are of order one.
    scale = float(np.abs(np.r_[np.roots(stable), np.roots(antistable)]).max(initial=0.0)) or 1.0
    S, U, N = (p * scale ** np.arange(len(p) - 1, -1, -1.0) for p in (stable, antistable, numerator))
    size = n + m + 1
    matrix = np.zeros((size, size))
    matrix[:, : n + 1] = scipy.linalg.convolution_matrix(U, n + 1)
    if m:
        matrix[1:, n + 1 :] = scipy.linalg.convolution_matrix(S, m)
    right = np.zeros(size)
    right[size - len(N) :] = N
    t = np.asarray(np.linalg.solve(matrix, right)[: n + 1], dtype=float)
    if len(N) < size:
        t[0] = 0.0  # the constant part, zero but for rounding
    return t / scale ** np.arange(n, -1, -1.0)


@dataclass(frozen=True)
class CrossSpectrum:
    """A rational cross-spectral density S_φΩ(s) = E{Ω φ*}, of any parity; S_Ωφ(s) = S_φΩ(−s). No pole is on the imaginary axis."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def split_poles(self) -> tuple[Array, Array]:
        """Return the factors of the denominator with roots to the left (with its leading factor) and to the right."""
        p = np.trim_zeros(np.asarray(self.denominator, dtype=float), "f")
        roots = np.roots(p)
        if np.any(np.abs(roots.real) <= 1e-9 * np.abs(roots)):
            raise CompensationError("a cross-spectral density has a pole on the imaginary axis; give it a corner frequency.")  # fmt: skip
        left, right = (np.atleast_1d(np.poly(roots[side]).real) for side in (roots.real < 0, roots.real > 0))
        return np.asarray(p[0] * left, dtype=float), np.asarray(right, dtype=float)


def require_possible(one: Spectrum, other: Spectrum, cross: CrossSpectrum | None) -> None:
    """Raise when two signals' coherence |S_φΩ|²/(S_φ S_Ω), largest at ω² = 0, ∞ or where its derivative vanishes, is above 1."""
    if cross is None:
        return
    cross.split_poles()
    mixed, below = (np.trim_zeros(np.asarray(p, dtype=float), "f") for p in (cross.numerator, cross.denominator))
    if not len(mixed):
        return
    # |p(jω)|² = p(s) p(−s); s² = −x
    tops = multiply(mixed, reflect(mixed), np.array(one.denominator), np.array(other.denominator))
    bottoms = multiply(below, reflect(below), np.array(one.numerator), np.array(other.numerator))
    top, bottom = (np.trim_zeros(p[::2] * (-1.0) ** np.arange(len(p[::2]))[::-1], "f") for p in (tops, bottoms))
    slope = np.asarray(np.polysub(np.polymul(np.polyder(top), bottom), np.polymul(top, np.polyder(bottom))), float)
    roots = np.roots(np.trim_zeros(slope, "f"))
    still = roots.real[(np.abs(roots.imag) <= 1e-6 * np.abs(roots)) & (roots.real > 0)]
    scale = float(np.max(np.abs(np.r_[np.roots(top), np.roots(bottom)]), initial=1.0))
    x = np.r_[still, scale * np.geomspace(1e-9, 1e9, 37)]
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(np.polyval(top, x) / np.polyval(bottom, x)), nan=0.0, posinf=np.inf)
    worst = int(np.argmax(coherence))
    if coherence[worst] > 1 + 1e-6:
        raise CompensationError(
            f"rate and noise have a coherence |S_φΩ|²/(S_φ S_Ω) of {coherence[worst]:.3g} at {np.sqrt(x[worst]):.3g} rad/s; no two"
            " signals have more than 1. Lower the cross-spectral density, or raise the noise's own."
        )


def _sign(polynomial: tuple[float, ...], frequency: Array) -> Array:
    """Sign of an even polynomial at jω; 0 where rounding decides it."""
    terms = np.array(polynomial)[:, None] * (1j * frequency) ** np.arange(len(polynomial) - 1, -1, -1)[:, None]
    value = np.sum(terms.real, axis=0)
    return np.where(np.abs(value) > 1e-12 * np.sum(np.abs(terms), axis=0), np.sign(value), 0.0)


def multiply(*polynomials: Array) -> Array:
    """Return the product of polynomials, highest power first."""
    return reduce(np.convolve, polynomials)
