"""Decay of an amplitude or a power that was recorded without its phase, such as a spectrum analyser's trace in dB.

    L(t) = ln a(t) = c − t/τ + e(t),   var e = v₀ + ½ (σ/a)²

v₀ is the scatter of the reading, σ the noise that adds to the amplitude and takes over as it decays. The line is fitted with
these weights, so the late record counts for what it tells; it ends where a < 3 σ, because a logarithm of noise is biased.
"""

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.ringdown.answer import Curve, Estimate, RingDown
from compensation.samples import block_means

BINS = 100
DROP = 0.25
"""Fall of ln a from one hundredth of the record to the next that is no decay but a drive switched off, where it is six times the usual step."""
FLOOR = 3.0


def analyse_trace(time: ArrayLike, amplitude: ArrayLike, frequency: float | None = None) -> RingDown:
    """Find the free part of a trace and return its decay; with its `frequency` (Hz), 1/Q."""
    t, a = np.asarray(time, dtype=np.float64), np.asarray(amplitude, dtype=np.float64)
    keep = np.isfinite(t) & np.isfinite(a) & (a > 0)
    whole, level_dB = t, 20 * np.log10(np.where(keep, a, np.nan))
    t, L = t[keep], np.log(a[keep])
    if t.size < 32:
        raise CompensationError(f"a decay needs 32 rows or more with a positive amplitude, not {t.size}.")
    first = _find_release(t, L)
    last = t.size
    noise = scatter = 0.0
    slope = level = 0.0

    def weigh(x: Array) -> Array:
        return np.asarray(1.0 / (scatter + _noise_part(level + slope * x, noise)))

    for _ in range(12):
        weights = weigh(t[first:last] - t[first]) if scatter else np.ones(last - first)
        slope, level = _fit_line(t[first:last] - t[first], L[first:last], weights)
        if not slope < 0:
            raise CompensationError("nothing decays in this trace: it rises or stays; record a free ring-down, longer.")
        line = level + slope * (t[first:] - t[first])
        scatter, noise = _fit_scatter(line[: last - first], L[first:last])
        above = np.flatnonzero(line > np.log(FLOOR * noise)) if noise > 0 else np.arange(line.size)
        end = first + max(int(above[-1]) + 1 if above.size else 0, min(32, line.size))
        if end == last:
            break
        last = end
    x = t[first:last] - t[first]
    straight = _find_straight(x, L[first:last], weigh(x))
    bent, last = straight < last - first, first + straight
    used, x = L[first:last], t[first:last] - t[first]
    slope, level = _fit_line(x, used, weigh(x))
    line, weights = level + slope * x, weigh(x)
    bound = float(1 / np.sqrt(np.sum(weights * (x - np.average(x, weights=weights)) ** 2)))
    # the largest ratio between the variance of block means and that of independent rows
    scaled, widest, size = (used - line) * np.sqrt(weights), 1.0, 2
    while scaled.size // size >= 6:
        widest = max(widest, size * float(np.mean(block_means(scaled, size) ** 2)))
        size *= 2
    sd = bound * float(np.sqrt(widest))
    if not -slope > 2 * sd:
        raise CompensationError(f"nothing decays in this trace (1/τ = {-slope:.3g} ± {sd:.2g} 1/s); record longer.")
    rate = Estimate.normal(-slope, sd)
    most = 1 / rate.low if rate.low > 0 else np.inf
    estimates = {"decay_per_s": rate, "decay_time_s": Estimate(1 / rate.value, sd / rate.value**2, 1 / rate.high, most)}
    estimates |= {"inverse_q": rate.over(np.pi * frequency)} if frequency is not None else {}
    said = []
    if first:
        said.append(f"The first {t[first] - t[0]:.4g} s are not a free decay (drive or release) and are left out.")
    if bent:
        said.append(
            f"After {t[last - 1]:.4g} s the decay is not exponential (interference, a second mode, or amplitude dependence): only the part before is used."
        )
    elif last < t.size:
        said.append(f"The last {t[-1] - t[last - 1]:.4g} s are below {FLOOR:g} times the noise and are left out.")
    if sd > 3 * bound:
        said.append(
            f"Poor fit: the interval is {sd / bound:.2g} times as wide as white noise makes it; a floor may bend the decay."
        )
    if x[-1] * -slope < 0.5:
        said.append(
            "The amplitude falls by less than 40 %: a decay that is not exponential is not seen; record longer."
        )
    window = (float(t[first]), float(t[last - 1]))
    fitted = 20 / np.log(10) * (level + slope * (whole - t[first]))
    fitted[(whole < window[0]) | (whole > window[1])] = np.nan
    curve = Curve(whole, level_dB, fitted, level_dB - fitted)
    return RingDown(estimates, tuple(said), (noise,), sd / bound, (curve,), window)


def _find_release(t: Array, L: Array) -> int:
    """Return the first row of the free decay: after the last sudden fall in the first half, or after a plateau."""
    size = max(1, t.size // BINS)
    means, t_mean = block_means(L, size), block_means(t, size)
    count = means.size
    steps = -np.diff(means)
    usual = float(np.median(np.abs(steps)))
    half = steps[: count // 2]
    sudden = np.flatnonzero(half > max(DROP, 6 * usual))
    if sudden.size:
        return (int(sudden[-1]) + 2) * size
    # a plateau: the knee of two lines, the first of them level, above the noise floor
    floor = np.flatnonzero(means < float(np.median(means[-(count // 10) :])) + np.log(FLOOR))
    count = max(int(floor[0]), 12) if floor.size and floor[0] < count else count
    means, t_mean = means[:count], t_mean[:count]
    best, knee = np.inf, 0
    for k in range(0, count // 2):
        flat = means[: k + 1]
        slope, level = _fit_line(t_mean[k:] - t_mean[k], means[k:], np.ones(count - k))
        falls = means[k:] - level - slope * (t_mean[k:] - t_mean[k])
        left = float(np.sum((flat - flat.mean()) ** 2) + np.sum(falls**2))
        if left < best:
            best, knee = left, k
    return knee * size if knee > 2 else 0


def _noise_part(line: Array, noise: float) -> Array:
    return np.asarray(0.5 * noise**2 * np.exp(-2 * line))


def _fit_line(x: Array, y: Array, weights: Array) -> tuple[float, float]:
    middle_x, middle_y = np.average(x, weights=weights), np.average(y, weights=weights)
    slope = float(np.sum(weights * (x - middle_x) * (y - middle_y)) / np.sum(weights * (x - middle_x) ** 2))
    return slope, float(middle_y - slope * middle_x)


def _fit_scatter(line: Array, L: Array) -> tuple[float, float]:
    """Return v₀ and σ by maximum likelihood of the residual about the line."""
    squares = (L - line) ** 2
    top = float(line.max())

    def cost(point: Array) -> float:
        variance = np.exp(point[0]) + _noise_part(line, float(np.exp(point[1])))
        return float(np.sum(np.log(variance) + squares / variance))

    start = np.log([np.median(squares) + 1e-12, np.exp(float(line.min())) + 1e-300])
    solved = scipy.optimize.minimize(cost, start, method="Nelder-Mead", bounds=[(-40, 5), (top - 40, top)])
    return float(np.exp(solved.x[0])), float(np.exp(solved.x[1]))


def _find_straight(x: Array, y: Array, weights: Array) -> int:
    """Return the rows from the start that one line foretells: each next fortieth within four standard deviations of it."""
    size = max(4, x.size // 40)
    rows = min(x.size, 6 * size)
    while rows + size <= x.size:
        w, u = weights[:rows], x[:rows]
        slope, level = _fit_line(u, y[:rows], w)
        scaled = (y[:rows] - level - slope * u) * np.sqrt(w)
        blocks = block_means(scaled, size)
        spread = max(float(np.sum(blocks**2)) / max(len(blocks) - 2, 1), 1.0 / size)  # variance of a block's mean
        middle = np.average(u, weights=w)
        following = slice(rows, rows + size)
        ahead = float(np.mean(x[following])) - middle
        known = spread * size * (1 / np.sum(w) + ahead**2 / np.sum(w * (u - middle) ** 2))
        miss = float(np.mean(y[following] - level - slope * x[following]))
        if miss**2 > 16 * (known + spread / float(np.mean(weights[following]))):
            return rows
        rows += size
    return x.size
