"""Noise of a gyro's output: white, flicker, a random walk, an offset of each turn-on and correlated noise (IEEE Std 952, annex C).

A row is the mean over its span Δ about its time t; runs are independent. With N (`white`), a (`flicker`) and K (`walk`),

    Allan variance   σ²(τ) = N²/τ + a² + K² τ/3,       a = √(2 ln 2/π) B = 0.664 B
    white            variance N²/Δ
    flicker          Σ over T = 60 s · 4^k of Gauss–Markov processes of variance a² each: S(f) = a²/(2 ln 2 · f) within 0.4 %
    random walk      variance K² after 1 s, from 0 where the run begins
    offset           one draw for the whole run
    correlated       a Gauss–Markov process of rms `markov` and correlation time `markov_time`

The ladder of correlation times T goes from 14 µs to 68 h: what is faster than a row averages out, and what is slower than
some ten hours is not told from an offset. A Gauss–Markov process of time T has between means over Δ and Δ′, d apart, the covariance
e^(−(d − Δ/2 − Δ′/2)/T) g(Δ/T) g(Δ′/T) with g(x) = (1 − e⁻ˣ)/x, and the variance 2 (x − 1 + e⁻ˣ)/x².
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.samples import robust_spread

FLAT = math.sqrt(2 * math.log(2) / math.pi)  # Allan deviation of flicker noise of bias instability B = 1
FLICKER_TIMES = np.asarray(60.0 * 4.0 ** np.arange(-11, 7), dtype=np.float64)  # correlation times of flicker noise, s
SLOW_TIMES = 7
"""How many of them are a minute and longer: flicker noise of a = 1 has this variance in rows of some seconds to minutes."""
FORGOTTEN = 40.0  # correlation times after which nothing is left to double precision
BRIEF = 50.0  # correlation times in a span beyond which a row remembers its neighbours only


@dataclass(frozen=True)
class Noise:
    """Levels in the unit of a signal: Allan deviation of the white part at 1 s, flat part, walk in 1 s, offsets of runs, rms of correlated noise and its time (s)."""

    white: float = 0.0
    flicker: float = 0.0
    walk: float = 0.0
    offset: float = 0.0
    markov: float = 0.0
    markov_time: float = 0.0

    def allan_variance(self, tau: ArrayLike) -> Array:
        """Return the Allan variance at averaging times τ (s)."""
        t = np.asarray(tau, dtype=np.float64)
        total = self.white**2 / t + self.walk**2 * t / 3.0
        if self.flicker:
            total = total + self.flicker**2 * _allan_of_gauss_markov(t[..., None] / FLICKER_TIMES).sum(axis=-1)
        if self.markov:
            total = total + self.markov**2 * _allan_of_gauss_markov(t / self.markov_time)
        return np.asarray(total)

    def covariance(self, times: Array, spans: ArrayLike) -> Array:
        """Return the covariance (n, n) of rows of one run: means over `spans` (s), each or all, about increasing `times` (s)."""
        spans = np.broadcast_to(np.asarray(spans, dtype=np.float64), times.shape)
        total = np.full((times.size, times.size), self.offset**2)
        if self.flicker:
            total += self.flicker**2 * flicker(times, spans)
        if self.walk:
            total += self.walk**2 * random_walk(times, spans)
        if self.markov:
            total += self.markov**2 * gauss_markov(times, spans, self.markov_time)
        if self.white:
            total[np.diag_indices_from(total)] += self.white**2 / spans
        return total

    def draw(self, count: int, rate: float, generator: np.random.Generator) -> Array:
        """Draw `count` rows, each the mean over a period of the rate (Hz): exactly, in O(count log count)."""
        span = 1.0 / rate
        slow = np.zeros(count)
        if self.flicker:
            slow += self.flicker * _draw_gauss_markov(count, span, FLICKER_TIMES, generator)
        if self.walk:
            slow += self.walk * math.sqrt(span) * _draw_walk(count, generator)
        if self.white:
            slow += self.white / math.sqrt(span) * generator.standard_normal(count)
        if self.offset:
            slow += self.offset * generator.standard_normal()
        if self.markov:
            slow += self.markov * _draw_gauss_markov(count, span, np.array([self.markov_time]), generator)
        return slow


def gauss_markov(times: Array, spans: ArrayLike, tau: float) -> Array:
    """Return the covariance of rows of a Gauss–Markov process of correlation time τ (s) and variance 1."""
    return gauss_markov_and_slope(times, spans, tau, sloped=False)[0]


def gauss_markov_and_slope(times: Array, spans: ArrayLike, tau: float, sloped: bool = True) -> tuple[Array, Array]:
    """Return that covariance and, where it is asked for, its slope by ln τ, by which x = Δ/τ moves as −x: g as g − e⁻ˣ, the variance v as 2 (v − g)."""
    spans = np.broadcast_to(np.asarray(spans, dtype=np.float64), times.shape)
    near = spans / tau
    apart = np.maximum(np.abs(times[:, None] - times) - 0.5 * (spans[:, None] + spans), 0.0) / tau
    g, variance, diagonal = _mean_of_decay(near), variance_of_mean(near), slice(None, None, len(times) + 1)
    out = np.exp(-apart) * (g[:, None] * g)
    slope = np.zeros((0, 0))
    if sloped:
        grown = 1.0 - np.exp(-near) / g
        slope = out * (apart + grown[:, None] + grown)
        slope.reshape(-1)[diagonal] = 2.0 * (variance - g)
    out.reshape(-1)[diagonal] = variance
    return out, slope


def flicker(times: Array, spans: ArrayLike) -> Array:
    """Return the covariance of rows of flicker noise whose Allan deviation is flat at 1."""
    spans = np.broadcast_to(np.asarray(spans, dtype=np.float64), times.shape)
    brief = spans.min() > BRIEF * FLICKER_TIMES
    total = np.zeros((times.size, times.size))
    for tau in FLICKER_TIMES[~brief]:
        total += gauss_markov(times, spans, float(tau))
    row = np.arange(times.size)
    between = np.maximum(np.diff(times) - 0.5 * (spans[1:] + spans[:-1]), 0.0)
    for tau in FLICKER_TIMES[brief]:
        total[row, row] += variance_of_mean(spans / tau)
        g = _mean_of_decay(spans / tau)
        beside = g[1:] * g[:-1] * np.exp(-between / tau)
        total[row[1:], row[:-1]] += beside
        total[row[:-1], row[1:]] += beside
    return total


def random_walk(times: Array, spans: ArrayLike) -> Array:
    """Return the covariance of rows of a random walk of variance 1 after 1 s, which is 0 where the first row begins."""
    spans = np.broadcast_to(np.asarray(spans, dtype=np.float64), times.shape)
    since = times - times[0] + 0.5 * spans[0]
    total = np.minimum(since[:, None], since[None, :])
    total[np.diag_indices_from(total)] -= spans / 6.0
    return np.asarray(total)


def white_rms(*series: Array) -> float:
    """Return the white noise, rms, of series that change slowly, from the median size of their second differences; 0 of none."""
    second = np.concatenate([np.diff(values, 2) for values in series])
    second = second[np.isfinite(second)]
    return float(robust_spread(second) / np.sqrt(6.0)) if second.size else 0.0


def variance_of_mean(x: Array) -> Array:
    """Return the variance of the mean of a Gauss–Markov process of variance 1 over x of its correlation times."""
    x = np.maximum(x, 1e-12)
    series = 1.0 - x / 3.0 + x**2 / 12.0 - x**3 / 60.0
    return np.asarray(np.where(x < 1e-3, series, 2.0 * (x + np.expm1(-x)) / x**2))


def _mean_of_decay(x: Array) -> Array:
    """(1 − e⁻ˣ)/x."""
    x = np.maximum(x, 1e-12)
    return np.asarray(-np.expm1(-x) / x)


def _allan_of_gauss_markov(x: Array) -> Array:
    """Allan variance at x of its correlation times of variance 1, (2/x) (1 − (3 − 4 e⁻ˣ + e⁻²ˣ)/(2x)): IEEE Std 952 eq. C.17."""
    bracket = 4.0 * np.expm1(-x) - np.expm1(-2.0 * x)  # −(3 − 4 e⁻ˣ + e⁻²ˣ)
    return np.asarray(np.where(x < 1e-4, x * (2.0 / 3.0 - x / 2.0), 2.0 / x * (1.0 + bracket / (2.0 * x))))


def _draw_gauss_markov(count: int, span: float, times: Array, generator: np.random.Generator) -> Array:
    """Draw the sum of processes of these correlation times and variance 1 by circulant embedding (Dietrich & Newsam 1997, SIAM J. Sci. Comput. 18, 1088)."""
    x = span / times
    lag = np.arange(count + 1.0)
    r = np.zeros(count + 1)
    for one, g in zip(x, _mean_of_decay(x), strict=True):
        seen = min(count, 1 + int(FORGOTTEN / one))
        r[1 : seen + 1] += g * g * np.exp(-one * lag[:seen])
    r[0] = variance_of_mean(x).sum()
    length = 2 * count
    power = scipy.fft.rfft(np.concatenate([r, r[-2:0:-1]])).real
    amplitude = np.sqrt(power * length / 2.0) * (generator.standard_normal((2, power.size)).T @ [1.0, 1j])
    amplitude[[0, -1]] = np.sqrt(2.0) * amplitude[[0, -1]].real  # the mean and the alternating part are real
    return np.ascontiguousarray(scipy.fft.irfft(amplitude, length)[:count])


def _draw_walk(count: int, generator: np.random.Generator) -> Array:
    """Draw means over unit steps of a walk from 0: half a step's change is in its mean, and 1/12 beside it."""
    e, own = generator.standard_normal((2, count))
    return np.asarray(np.cumsum(e) - 0.5 * e + own / math.sqrt(12.0))
