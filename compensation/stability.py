"""Allan deviation of a rate output with confidence, and the noise coefficients N, B, K read off it by a fit, with correlated noise where these miss the curve.

σ²(τ) = N²/τ + (2 ln 2/π) B² + K² τ/3 (+ a Gauss–Markov part, `compensation.noise`): angle random walk N, bias instability B (flat part over √(2 ln 2/π) = 0.664)
and rate random walk K, IEEE Std 952. With the output in °/h and τ in s, N is in °/h·√s (divide by 60 for °/√h) and
K in °/h/√s (multiply by 60 for °/h/√h). Equivalent degrees of freedom after Riley, NIST SP 1065, section 5.4.1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.noise import FLAT, Noise

UNITS = (Noise(white=1.0), Noise(flicker=FLAT), Noise(walk=1.0))  # N, B and K of 1
MISSED = 2.0  # misfit from which on correlated noise is tried, and below which it explains the curve
PER_OCTAVE = 2  # of its times that are tried
NoiseKind = Literal["phase", "white", "flicker", "random walk"]
# Slope of log σ against log τ: quantisation, angle random walk, bias instability, rate random walk.
SLOPES: dict[NoiseKind, float] = {"phase": -1.0, "white": -0.5, "flicker": 0.0, "random walk": 0.5}


@dataclass(frozen=True)
class AllanDeviation:
    """Overlapping Allan deviation at `tau` (s) with its band, degrees of freedom, and the kind of noise that dominates there, (k,)."""

    tau: Array
    deviation: Array
    degrees_of_freedom: Array
    noise: tuple[NoiseKind, ...]
    low: Array
    high: Array
    confidence: float

    @property
    def bias_instability(self) -> tuple[float, float, float]:
        """Lowest point of the curve over 0.664, with the ends of its confidence band (the classical reading)."""
        k = int(np.argmin(self.deviation))
        return float(self.deviation[k] / FLAT), float(self.low[k] / FLAT), float(self.high[k] / FLAT)


@dataclass(frozen=True)
class NoiseCoefficients:
    """N, B, K of σ²(τ) = N²/τ + 0.664² B² + K² τ/3 and their standard uncertainties, of a 0 the size that could hide.

    `misfit`: rms of (measured/fitted variance − 1) over √(2/EDF), about 1 when these kinds explain the curve; `markov` and
    `markov_time`: rms and correlation time (s) of correlated noise, 0 where the curve does not need it.
    """

    N: float
    B: float
    K: float
    N_uncertainty: float
    B_uncertainty: float
    K_uncertainty: float
    misfit: float
    markov: float = 0.0
    markov_time: float = 0.0

    @property
    def noise(self) -> Noise:
        """The levels of a noise with these coefficients, in the signal's unit and s."""
        return Noise(self.N, FLAT * self.B, self.K, markov=self.markov, markov_time=self.markov_time)

    def deviation(self, tau: ArrayLike) -> Array:
        """Return the Allan deviation of these noises at τ (s)."""
        return np.asarray(np.sqrt(self.noise.allan_variance(tau)))


def allan_deviation(
    rate: ArrayLike, step: float, points_per_octave: int = 3, confidence: float = 0.683,
    factors: Sequence[int] | None = None,
) -> AllanDeviation:  # fmt: skip
    """σ²(m τ₀) = Σ (x_{i+2m} − 2 x_{i+m} + x_i)² / (2 (m τ₀)² (n + 1 − 2m)), x the integral of even samples; τ to a third of them."""
    y = np.asarray(rate, dtype=np.float64)
    if y.ndim != 1 or y.size < 9:
        raise CompensationError(f"an Allan deviation needs at least 9 samples in a row, not {y.size}; record longer.")
    if not np.all(np.isfinite(y)):
        raise CompensationError(
            f"the output has {(lost := np.count_nonzero(~np.isfinite(y)))} missing value{'' if lost == 1 else 's'}; an Allan deviation needs an unbroken series: average over blocks first, or cut the record at its gaps."
        )
    if not step > 0:
        raise CompensationError(f"the sampling step must be positive, not {step:g} s.")
    if np.ptp(y) == 0:
        raise CompensationError(f"the output is constant ({y[0]:g}); check the column.")
    if factors is None:
        longest = y.size // 3
        count = int(points_per_octave * math.log2(longest)) + 1
        spaced = np.unique(np.round(2.0 ** (np.arange(count + 1) / points_per_octave)).astype(int))
        factors = spaced[spaced <= longest].tolist()
    x = np.concatenate([[0.0], np.cumsum(y - y.mean())]) * step

    def overlapping(m: int) -> float:
        second = x[2 * m :] - 2 * x[m:-m] + x[: -2 * m]
        return math.sqrt(float(second @ second) / (2 * second.size)) / (m * step)

    deviation = np.array([overlapping(m) for m in factors])
    tau = np.asarray(factors, dtype=np.float64) * step
    noise = _identify(tau, deviation)
    edf = np.array([equivalent_freedom(kind, x.size, m) for kind, m in zip(noise, factors, strict=True)])
    tail = (1 - confidence) / 2
    return AllanDeviation(
        tau=tau,
        deviation=deviation,
        degrees_of_freedom=edf,
        noise=noise,
        low=deviation * np.sqrt(edf / scipy.special.chdtri(edf, tail)),
        high=deviation * np.sqrt(edf / scipy.special.chdtri(edf, 1 - tail)),
        confidence=confidence,
    )


def equivalent_freedom(noise: NoiseKind, n: int, m: int) -> float:
    """Return the equivalent degrees of freedom of σ²(m τ₀) from n phase points, NIST SP 1065, table 5."""
    if noise == "phase":
        return (n + 1) * (n - 2 * m) / (2 * (n - m))
    if noise == "white":
        return (3 * (n - 1) / (2 * m) - 2 * (n - 2) / n) * 4 * m**2 / (4 * m**2 + 5)
    if noise == "flicker":
        return 2 * (n - 2) ** 2 / (2.3 * n - 4.9) if m == 1 else 5 * n**2 / (4 * m * (n + 3 * m))
    return (n - 2) / m * ((n - 1) ** 2 - 3 * m * (n - 1) + 4 * m**2) / (n - 3) ** 2


def fit_noise(allan: AllanDeviation) -> NoiseCoefficients:
    """Fit N, B, K, and correlated noise where they miss the curve: errors know shared samples and grow with the misfit."""
    if allan.tau.size < 5:
        raise CompensationError(f"fitting N, B and K needs five values of τ or more, not {allan.tau.size}; record longer.")  # fmt: skip
    found = _fit(allan, UNITS)
    if found[0] > MISSED:
        times = 2.0 ** np.arange(np.log2(allan.tau[0]), np.log2(allan.tau[-1]), 1 / PER_OCTAVE)
        more = min((_fit(allan, (*UNITS, Noise(markov=1.0, markov_time=T))) for T in times.tolist()), key=lambda one: one[0])  # fmt: skip
        found = more if more[0] < MISSED else found
    misfit, c, weighted, time = found
    Q, R = np.linalg.qr(weighted)
    root = np.linalg.solve(R, Q.T)
    errors = max(1.0, misfit) * np.sqrt(np.diag(root @ _correlation(allan, c, time) @ root.T))
    values = np.sqrt(c)
    # u(√c) = u(c) / (2 √c); where that linearisation fails, √u(c) bounds what may be hidden.
    uncertainties = np.minimum(errors / np.maximum(2 * values, 1e-150), np.sqrt(errors))
    markov = float(values[3]) if time else 0.0
    N, B, K = values[:3].tolist()
    N_uncertainty, B_uncertainty, K_uncertainty = uncertainties[:3].tolist()
    return NoiseCoefficients(
        N, B, K, N_uncertainty, B_uncertainty, K_uncertainty, misfit, markov, time if markov else 0.0
    )


def _fit(allan: AllanDeviation, units: Sequence[Noise]) -> tuple[float, Array, Array, float]:
    """Fit squared levels c of noises by non-negative least squares on σ²/σ²_fit, weights EDF/2; first the misfit, then c, the weighted columns and the correlation time."""
    A, variance = np.stack([one.allan_variance(allan.tau) for one in units], axis=-1), allan.deviation**2
    fitted, c = variance, np.zeros(len(units))
    for _ in range(50):
        weight = np.sqrt(allan.degrees_of_freedom / 2) / fitted
        size = np.linalg.norm(A * weight[:, None], axis=0)
        new = scipy.optimize.nnls(A * weight[:, None] / size, variance * weight)[0] / size
        settled = np.allclose(new, c, rtol=1e-9, atol=0.0)
        c, fitted = new, A @ new
        if settled:
            break
    deviates = (variance / fitted - 1) * np.sqrt(allan.degrees_of_freedom / 2)
    return float(np.sqrt(np.mean(deviates**2))), c, A * weight[:, None], units[-1].markov_time


def _correlation(allan: AllanDeviation, c: Array, time: float) -> Array:
    """Correlation of points that share samples, cov(σ²_i, σ²_j) ∝ ∫ S² |H_i|² |H_j|² df, |H|² = 2 sin⁴(πfτ)/(πfτ)²."""
    f = np.geomspace(0.02 / allan.tau[-1], 0.5 / allan.tau[0], 8000)
    S = 2 * c[0] + c[1] / (np.pi * f) + 2 * c[2] / (2 * np.pi * f) ** 2
    S += 4 * c[3] * time / (1 + (2 * np.pi * f * time) ** 2) if time else 0.0
    angle = np.pi * np.outer(allan.tau, f)
    response = 2 * np.sin(angle) ** 4 / angle**2 * S * np.sqrt(np.gradient(f))
    covariance = response @ response.T
    return np.asarray(covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance))))


def _identify(tau: Array, deviation: Array) -> tuple[NoiseKind, ...]:
    """Name the noise of the slope over about an octave either side; quantisation (−1) only from the shortest τ on."""
    u, v = np.log2(tau), np.log2(np.maximum(deviation, 1e-300))
    apart = u - u[:, None]
    near = np.abs(apart) <= 1.0
    apart -= (apart * near).sum(axis=1, keepdims=True) / near.sum(axis=1, keepdims=True)
    spread = (near * apart**2).sum(axis=1)
    slopes = np.where(spread > 0, (near * apart) @ v / np.where(spread > 0, spread, 1.0), -0.5)
    kinds: list[NoiseKind] = []
    for slope in slopes.tolist():
        nearest = min(SLOPES, key=lambda kind: abs(SLOPES[kind] - slope))
        kinds.append("white" if nearest == "phase" and any(kind != "phase" for kind in kinds) else nearest)
    return tuple(kinds)
