"""Decay of an amplitude or a power that was recorded without its phase, such as a spectrum analyser's trace in dB.

    P(t) = a² = S e^{−2t/τ} + F + e(t),   var e = v m² + w (m − F/2),   m = S e^{−2t/τ} + F

F is the power of the noise floor, v the scatter of the reading, w the noise that adds to the amplitude: of |signal + noise|² it is
2F, of a mean of M such looks 2F/M. The sum of squares over this variance is made least, which asks no more of the noise than that: a logarithm of noise is biased, its power
is not. A floor is fitted where it pays, from all rows after the release.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.ringdown.answer import Curve, Estimate, RingDown
from compensation.ringdown.laws import long_run
from compensation.samples import block_means

BINS = 100
DROP = 0.25
"""Fall of ln a from one hundredth of the record to the next that is no decay but a drive switched off, where it is six times the usual step."""
FLOOR = 3.0
PAYS = 3.8  # least fall of −2 ln L, over the widening², for a floor: noise passes it once in twenty, a floor left out bends the decay
MEANS, ROWS = 500, 20_000  # means to which the decay is fitted, and rows of which the scatter is


def analyse_trace(time: ArrayLike, amplitude: ArrayLike, frequency: float | None = None) -> RingDown:
    """Find the free part of a trace and return its decay; with its `frequency` (Hz), 1/Q."""
    t, a = np.asarray(time, dtype=np.float64), np.asarray(amplitude, dtype=np.float64)
    keep = np.isfinite(t) & np.isfinite(a) & (a > 0)
    whole, level_dB = t, 20 * np.log10(np.where(keep, a, np.nan))
    t, a = t[keep], a[keep]
    if t.size < 32:
        raise CompensationError(f"a decay needs 32 rows or more with a positive amplitude, not {t.size}.")
    first = _find_release(t, np.log(a))
    unit = float(np.max(a[first:]))
    x, y = t[first:] - t[first], (a[first:] / unit) ** 2
    fit = _fit_power(x, y)
    rows = _find_end(fit, x, y)
    if rows < x.size:
        fit = _fit_power(x[:rows], y[:rows], fit.floor)
    sd = fit.bound * fit.widening
    if not fit.rate > 0:
        raise CompensationError("nothing decays in this trace: it rises or stays; record a free ring-down, longer.")
    if not fit.rate > 2 * sd:
        raise CompensationError(f"nothing decays in this trace (1/τ = {fit.rate:.3g} ± {sd:.2g} 1/s); record longer.")
    rate = Estimate.normal(fit.rate, sd)
    most = 1 / rate.low if rate.low > 0 else np.inf
    estimates = {"decay_per_s": rate, "decay_time_s": Estimate(1 / rate.value, sd / rate.value**2, 1 / rate.high, most)}
    estimates |= {"inverse_q": rate.over(np.pi * frequency)} if frequency is not None else {}
    above = int(np.count_nonzero(fit.signal(x[:rows]) > fit.floor))
    end = float(t[first + max(above, 2) - 1])
    said = []
    if first:
        said.append(f"The first {t[first] - t[0]:.4g} s are not a free decay (drive or release) and are left out.")
    if rows < x.size:
        said.append(
            f"After {t[first + rows - 1]:.4g} s the decay is not exponential (interference, a second mode, or amplitude dependence): only the part before is used."
        )
    if above < rows:
        under = 10 * np.log10(fit.signal(x[:1])[0] / fit.floor)
        said.append(
            f"The noise floor is {under:.3g} dB below the start, above the decay from {end:.4g} s on; it is fitted with it."
        )
    if fit.widening > 3:
        said.append(f"Poor fit: the interval is {fit.widening:.2g} times as wide as white noise makes it.")
    if x[above - 1] * fit.rate < 0.5:
        said.append(
            "The amplitude falls by less than 40 %: a decay that is not exponential is not seen; record longer."
        )
    fitted = np.full(whole.size, np.nan)
    used = (whole >= t[first]) & (whole <= t[first + rows - 1])
    fitted[used] = 20 * np.log10(unit) + 10 * np.log10(fit.mean(whole[used] - t[first]))
    curve = Curve(whole, level_dB, fitted, level_dB - fitted)
    noise = (unit * float(np.sqrt(fit.floor)),)
    return RingDown(estimates, tuple(said), noise, fit.widening, (curve,), (float(t[first]), end))


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
        slope, level = np.polyfit(t_mean[k:] - t_mean[k], means[k:], 1)
        falls = means[k:] - level - slope * (t_mean[k:] - t_mean[k])
        left = float(np.sum((flat - flat.mean()) ** 2) + np.sum(falls**2))
        if left < best:
            best, knee = left, k
    if knee <= 2:
        return 0
    falls = -np.diff(L[knee * size : (knee + 3) * size])  # the knee lies within a mean: a fall beside it is the drive's
    at = int(np.argmax(falls))
    sudden_row = falls[at] > max(DROP, 6 * float(np.median(np.abs(falls))))
    return knee * size + (at + 1 if sudden_row else 0)


@dataclass(frozen=True)
class _Power:
    """A fitted power, as in the head of the module; the `bound` of 1/τ in white noise, and the factor to its interval."""

    level: float  # ln S
    rate: float  # 1/τ
    floor: float  # F
    scatter: float = 1.0
    noise: float = 0.0
    bound: float = 0.0
    widening: float = 1.0

    def signal(self, x: Array) -> Array:
        return np.asarray(np.exp(self.level - 2 * self.rate * x))

    def mean(self, x: Array) -> Array:
        return self.signal(x) + self.floor

    def variance(self, x: Array) -> Array:
        return self.variance_at(self.mean(x))

    def variance_at(self, m: Array) -> Array:
        return np.asarray(self.scatter * m**2 + self.noise * (m - self.floor / 2))

    def slopes(self, x: Array) -> Array:
        """Derivatives of the mean by ln S, 1/τ and F."""
        s = self.signal(x)
        return np.stack([s, -2 * x * s, np.ones_like(s)], axis=1)


def _fit_power(x: Array, y: Array, floor: float | None = None) -> _Power:
    """Fit S, τ and, where it is not given and pays, F."""

    def start(rows: NDArray[np.bool_], floor: float) -> _Power:
        slope, level = np.polyfit(x[rows], np.log(y[rows]), 1)
        return _Power(float(level), -float(slope) / 2, floor)

    last = float(np.mean(y[-max(y.size // 10, 8) :]))
    early = y > 4 * last
    early = early if np.count_nonzero(early) > 8 else y > 0
    plain = _iterate(start(early, floor or 0.0), x, y, 2)
    if floor is not None:
        return plain
    full = _iterate(start(early, last), x, y, 3)
    return full if full.rate > 0 and _cost(plain, x, y) - _cost(full, x, y) > PAYS * full.widening**2 else plain


def _iterate(fit: _Power, x: Array, y: Array, free: int) -> _Power:
    """Fit the first two or all three values with the variance of the fit before, and that to what is left."""
    size = max(1, x.size // MEANS)
    x_mean, y_mean = block_means(x, size), block_means(y, size)
    some = slice(None, None, max(1, x.size // ROWS))
    for _ in range(12):
        weight, old = 1 / np.sqrt(fit.variance(x_mean)), fit

        def put(point: Array, fit: _Power = fit) -> _Power:
            return replace(fit, level=point[0], rate=point[1], floor=point[2] if free == 3 else fit.floor)

        def misfit(point: Array, weight: Array = weight) -> Array:
            return np.asarray((put(point).mean(x_mean) - y_mean) * weight)

        def slopes(point: Array, weight: Array = weight) -> Array:
            return np.asarray(put(point).slopes(x_mean)[:, :free] * weight[:, None])

        begin = np.array([fit.level, fit.rate, max(fit.floor, 1e-12)][:free])
        least = np.array([-np.inf, -np.inf, 0.0][:free])
        found = scipy.optimize.least_squares(misfit, begin, slopes, (least, np.inf), x_scale="jac", max_nfev=50)
        fit = put(found.x)
        fit = _fit_scatter(replace(fit, floor=max(fit.floor, 1e-12) if free == 3 else fit.floor), x[some], y[some])
        if abs(fit.rate - old.rate) < 1e-6 * abs(old.rate):
            break
    r, V = y - fit.mean(x), fit.variance(x)
    J = fit.slopes(x)[:, :free] / np.sqrt(V)[:, None]
    bound = float(np.sqrt(np.linalg.pinv(J.T @ J, hermitian=True)[1, 1]))
    # the largest ratio between the variance of block means and that of independent rows
    scaled, widest, size = r / np.sqrt(V), 1.0, 2
    while (count := scaled.size // size) >= 8:
        widest = max(widest, size * float(np.sum(block_means(scaled, size) ** 2)) / (count - free))
        size *= 2
    # and of the scores themselves: rows that tell of τ may be correlated otherwise than those of the floor
    scale = 1 / np.linalg.norm(J, axis=0)
    bread = np.linalg.pinv((J * scale).T @ (J * scale), hermitian=True)
    middle = long_run(np.arange(x.size) * MEANS // max(x.size, MEANS), J * scale * scaled[:, None])
    widest = max(widest, float((bread @ middle @ bread)[1, 1]) * scale[1] ** 2 / bound**2)
    return replace(fit, bound=bound, widening=float(np.sqrt(widest)))


def _cost(fit: _Power, x: Array, y: Array) -> float:
    """−2 ln L of normal noise of the variance found."""
    V = fit.variance(x)
    return float(np.sum(np.log(V) + (y - fit.mean(x)) ** 2 / V))


def _fit_scatter(fit: _Power, x: Array, y: Array) -> _Power:
    """Return the fit with its most probable v and w."""
    away = (y / fit.mean(x) - 1) ** 2
    usual = float(np.median(away)) + 1e-12
    if not fit.floor:  # without a floor there is no noise that adds to the amplitude
        return replace(fit, scatter=float(np.mean(away)) + 1e-12)

    def put(point: Array) -> _Power:
        return replace(fit, scatter=float(np.exp(point[0])), noise=float(np.exp(point[1])))

    m = fit.mean(x)
    square = (y - m) ** 2

    def cost(point: Array) -> float:
        V = put(point).variance_at(m)
        return float(np.sum(np.log(V) + square / V))

    start = np.log([fit.scatter if fit.noise else usual, fit.noise or fit.floor])
    limits = [(-40.0, 5.0), (-60.0, 5.0)]
    return put(scipy.optimize.minimize(cost, start, method="Nelder-Mead", bounds=limits).x)


@np.errstate(over="ignore")
def _find_end(fit: _Power, x: Array, y: Array) -> int:
    """Return the rows from the start that one decay foretells: each next fortieth within four standard deviations of it."""
    size = max(4, x.size // 40)
    rows = min(x.size, 6 * size)
    root = np.sqrt(fit.variance(x))
    while rows + size <= x.size:
        w = 1 / root[:rows]
        one = fit
        for _ in range(4):  # Gauss and Newton
            J = one.slopes(x[:rows])[:, :2] * w[:, None]
            step = np.linalg.lstsq(J, (y[:rows] - one.mean(x[:rows])) * w, rcond=None)[0]
            one = replace(one, level=one.level + step[0], rate=one.rate + step[1])
            if not np.isfinite(one.mean(x[:rows])).all():  # noise alone: it foretells nothing
                return rows
        blocks = block_means((y[:rows] - one.mean(x[:rows])) * w, size)
        spread = max(float(np.sum(blocks**2)) / max(len(blocks) - 2, 1), 1.0 / size)  # variance of a block's mean
        following = slice(rows, rows + size)
        ahead = one.slopes(x[following])[:, :2].mean(axis=0)
        known = spread * size * float(ahead @ np.linalg.pinv(J.T @ J, hermitian=True) @ ahead)
        miss = float(np.mean(y[following] - one.mean(x[following])))
        if abs(miss) > 4 * np.sqrt(known + spread * float(np.mean(root[following] ** 2))):
            return rows
        rows += size
    return x.size
