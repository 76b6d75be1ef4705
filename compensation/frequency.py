"""Frequency against temperature as a polynomial, and temperature from frequency as its root.

f(T) = f₀ + a₁ (T − T₀) + a₂ (T − T₀)² + …, HRG paper eqs. (16)–(18), of any order. The resonator is its own
thermometer, so the inverse matters as much as the fit: it is refused where the curve is not monotonic or
where nothing was measured. Temperatures here are in °C, as the names say; frequencies in Hz.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.constants import zero_Celsius
from compensation.errors import CompensationError
from compensation.polynomial import PolynomialFit, count_apart, fit_polynomial
from compensation.regression import FTest, LinearFit, compare_nested

FARTHEST_REFERENCE = 1e4  # °C, and absolute zero
ODD = 1e-4  # probability with which a table without a mistake has an odd reading
MOST = 300  # rows of a table of which two are looked for that are exchanged
GRID = 2001  # temperatures at which a curve is looked at


@dataclass(frozen=True)
class FrequencyFit:
    """The fitted curve f(T) within the measured range: coefficients f₀ (Hz), a₁ (Hz/°C), … about a reference, `resolution` in Hz."""

    reference_temperature_degC: float
    temperature_range_degC: tuple[float, float]
    coefficients: Array
    covariance: Array
    resolution: float | None
    polynomial: PolynomialFit

    @property
    def order(self) -> int:
        """Highest power of the polynomial."""
        return self.polynomial.order

    @property
    def regression(self) -> LinearFit:
        """Residuals (Hz, in the order of the data), their sum of squares, and what else the fit tells; variance not below that of rounding."""
        return self.polynomial.regression

    @property
    def standard_errors(self) -> Array:
        """Standard deviations of the coefficients."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def chi_squared(self) -> float | None:
        """Sum of squares over the variance of rounding, resolution²/12; None when no resolution is known."""
        return None if self.resolution is None else self.regression.sum_of_squares / (self.resolution**2 / 12)

    @property
    def largest_residual_of_span(self) -> float:
        """Largest |residual| over the span of the measured frequencies (1)."""
        measured = self.regression.fitted + self.regression.residuals
        return float(np.max(np.abs(self.regression.residuals)) / np.ptp(measured))

    def frequency(self, temperature_degC: ArrayLike, *, extrapolate: bool = False) -> Array:
        """Return f(T) in Hz; temperatures that were not covered raise unless `extrapolate`."""
        return self.polynomial.value(self._within(temperature_degC, extrapolate))

    def slope(self, temperature_degC: ArrayLike, *, extrapolate: bool = False) -> Array:
        """Return df/dT in Hz/°C."""
        return self.polynomial.slope(self._within(temperature_degC, extrapolate))

    def slope_ppm(self, temperature_degC: ArrayLike) -> Array:
        """Return (df/dT) / f in ppm/°C, the TCF of HRG paper eq. (15)."""
        return 1e6 * self.slope(temperature_degC) / self.frequency(temperature_degC)

    def temperature(self, frequency: ArrayLike) -> Array:
        """Return the temperature (°C) whose frequency this is: the inverse of f(T), HRG paper Table 2, at most three residuals out of range."""
        frequency = np.asarray(frequency, dtype=np.float64)
        if not np.all(np.isfinite(frequency)):
            raise CompensationError("a frequency is missing or infinite; remove those rows.")
        return invert(self.polynomial.value, self._bracket(), frequency)

    def _within(self, temperature_degC: ArrayLike, extrapolate: bool) -> Array:
        T = np.asarray(temperature_degC, dtype=np.float64)
        low, high = self.temperature_range_degC
        outside = np.isnan(T) | np.less(T, low) | np.greater(T, high)
        if not extrapolate and np.any(outside):
            raise CompensationError(f"{T[outside][0]:g} °C lies outside the fitted range {low:g} to {high:g} °C; measure there, or ask for extrapolation.")  # fmt: skip
        return T

    def _bracket(self) -> tuple[float, float]:
        """Return the measured range, widened by the fit's own errors."""
        low, high = self.temperature_range_degC
        margin = max(3 * np.sqrt(self.regression.variance), float(np.max(np.abs(self.regression.residuals))))
        slopes = np.abs(self.polynomial.slope(np.array([low, high])))
        reach = np.minimum(margin / np.maximum(slopes, 1e-300), 0.05 * (high - low))
        return low - float(reach[0]), high + float(reach[1])


@dataclass(frozen=True)
class OrderComparison:
    """Fits of rising order, the F-test of `fits[k]` against `fits[k + 1]`, and the lowest order that no higher one improves on."""

    fits: tuple[FrequencyFit, ...]
    against_next: tuple[FTest, ...]
    level: float
    recommended: int


def find_turn(curve: Callable[[Array], Array], span: tuple[float, float]) -> float | None:
    """Return the temperature (°C) within a span at which a curve f(T) turns round; None where it only rises or only falls."""
    T = np.linspace(*span, GRID)
    rise = np.sign(np.diff(curve(T)))
    turned = np.flatnonzero((rise != rise[GRID // 2]) | (rise == 0))
    if not turned.size:
        return None
    k = int(turned[np.argmin(np.abs(turned - GRID // 2))])
    return float(T[k + (k < GRID // 2)])  # where the way up meets the way down


def invert(curve: Callable[[Array], Array], span: tuple[float, float], frequency: Array) -> Array:
    """Return the temperatures (°C) within a span whose frequencies (Hz) these are; NaN where there is no frequency."""
    turn = find_turn(curve, span)
    if turn is not None:
        raise CompensationError(
            f"the curve has a turning point at {turn:.1f} °C: two temperatures have the same frequency there, so it cannot be inverted. Fit a narrower range of temperature or another order."
        )
    low, high = np.sort(curve(np.array(span)))
    known = np.isfinite(frequency)
    outside = known & ((frequency < low) | (frequency > high))
    if np.any(outside):
        raise CompensationError(
            f"the frequency runs from {np.nanmin(frequency):.8g} to {np.nanmax(frequency):.8g} Hz and lies outside {low:.8g}"
            f" to {high:.8g} Hz ({span[0]:.1f} to {span[1]:.1f} °C), where the curve holds, in {100 * np.mean(outside):.1f} % of the readings; calibrate over that range."
        )
    found = np.full(frequency.shape, np.nan)
    if np.any(known):
        found[known] = _reach(curve, span, frequency[known])
    return found


def _reach(curve: Callable[[Array], Array], span: tuple[float, float] | tuple[Array, Array], frequency: Array) -> Array:
    """Return where between two temperatures (°C) a curve has these frequencies (Hz), NaN where it is not found."""
    from scipy.optimize.elementwise import find_root

    def excess(T: Array, f: Array) -> Array:
        return curve(T) - f

    found = find_root(excess, span, args=(frequency,))
    return np.where(found.success, found.x, np.nan)


def fit_frequency(
    temperature_degC: ArrayLike, frequency: ArrayLike, order: int = 3, reference_temperature_degC: float = 0.0,
    resolution: float | None = None,
) -> FrequencyFit:  # fmt: skip
    """Fit f(T) by least squares, HRG paper eqs. (16)–(18); rounding to `resolution` (Hz) has the variance resolution²/12."""
    try:
        T, f = np.asarray(temperature_degC, dtype=np.float64), np.asarray(frequency, dtype=np.float64)
    except (TypeError, ValueError):
        words = "a frequency law is fitted to numbers, temperatures (°C) and frequencies (Hz); 'hrg fit frequency' reads files."
        raise CompensationError(words) from None
    if resolution is not None and not (np.isfinite(resolution) and resolution > 0):
        raise CompensationError(f"the resolution of the readings must be positive, not {resolution:g} Hz.")
    if not -zero_Celsius <= reference_temperature_degC <= FARTHEST_REFERENCE:
        raise CompensationError(f"a reference temperature of {reference_temperature_degC:g} °C is impossible; take one near those measured.")  # fmt: skip
    if resolution is not None and f.size and not np.finfo(float).eps * np.max(f) <= resolution < np.max(f):
        raise CompensationError(f"readings of up to {np.max(f):g} Hz cannot have a resolution of {resolution:g} Hz.")
    rounding = 0.0 if resolution is None else resolution**2 / 12
    polynomial = fit_polynomial(T, f, order, "temperature_degC", least_variance=rounding)
    if np.any(f <= 0):
        raise CompensationError(f"a frequency must be positive, not {f[f <= 0][0]:g} Hz.")
    if np.ptp(f) == 0:
        raise CompensationError(f"'frequency' is constant ({f[0]:g} Hz) over temperature; check the column.")
    coefficients, covariance = polynomial.about(reference_temperature_degC)
    return FrequencyFit(
        reference_temperature_degC=float(reference_temperature_degC),
        temperature_range_degC=(float(T.min()), float(T.max())), coefficients=coefficients,
        covariance=covariance, resolution=resolution, polynomial=polynomial,
    )  # fmt: skip


def compare_orders(
    temperature_degC: ArrayLike, frequency: ArrayLike, highest: int = 5, reference_temperature_degC: float = 0.0,
    resolution: float | None = None, level: float = 0.05,
) -> OrderComparison:  # fmt: skip
    """Fit every order up to `highest` and test each against higher ones: F(Δp, m − p) = ((SSE_k − SSE_l) / Δp) / (SSE_l / (m − p))."""
    readings = count_apart(temperature_degC)
    highest = min(highest, readings - 2)
    if highest < 1:
        raise CompensationError(f"comparing orders needs 3 different temperatures or more, not {readings}.")
    fits = tuple(
        fit_frequency(temperature_degC, frequency, order, reference_temperature_degC, resolution)
        for order in range(1, highest + 1)
    )
    tests = tuple(compare_nested(small.regression, large.regression) for small, large in pairwise(fits))

    def better(own: FrequencyFit) -> bool:
        higher = fits[own.order :]  # one of them, at the level shared among all: a law may lack the next power
        return any(compare_nested(own.regression, one.regression).p_value < level / len(higher) for one in higher)

    return OrderComparison(fits, tests, level, next(one.order for one in fits if not better(one)))


def odd_reading(temperature_degC: Array, frequency: Array, order: int) -> tuple[int, float] | None:
    """Return the row that lies off the curve of the others, and by how much (Hz), where chance does so once in ten thousand tables.

    t = r / (s √(1 − h)) of Student's distribution, s without the row; the largest of n (Cook and Weisberg 1982).
    """
    free = len(frequency) - order - 2
    if free < 1 or not np.ptp(temperature_degC):
        return None
    x = (temperature_degC - temperature_degC.mean()) / np.ptp(temperature_degC)
    Q = np.linalg.qr(np.vander(x, order + 1))[0]
    kept, y = 1 - np.sum(Q**2, axis=1), frequency - frequency.mean()
    away = (y - Q @ (Q.T @ y)) / np.maximum(kept, 1e-12)
    rest = float(np.sum(away**2 * kept**2)) - away**2 * kept
    t = np.abs(away) * np.sqrt(kept) / np.sqrt(np.maximum(rest, 1e-300) / free)
    k = int(np.argmax(t))
    return (k, float(away[k])) if t[k] > scipy.special.stdtrit(free, 1 - ODD / 2 / len(y)) else None


def exchanged_readings(temperature_degC: Array, frequency: Array, order: int) -> tuple[int, int] | None:
    """Return the two rows whose frequencies one curve has the other way round, where chance does so once in ten thousand tables."""
    count = len(frequency)
    free = count - order - 2
    if free < 1 or count > MOST or not np.ptp(temperature_degC):
        return None
    x, y = (temperature_degC - temperature_degC.mean()) / np.ptp(temperature_degC), frequency - frequency.mean()
    Q = np.linalg.qr(np.vander(x, order + 1))[0]
    M = np.eye(count) - Q @ Q.T
    r, by = M @ y, y[:, None] - y  # |M (y − d (e_i − e_j))|², d = y_i − y_j
    kept = np.diag(M)[:, None] + np.diag(M) - 2 * M
    left = np.maximum(float(r @ r) - 2 * by * (r[:, None] - r) + by**2 * kept, 1e-24 * float(y @ y))
    i, j = (int(k) for k in np.unravel_index(np.argmin(left), left.shape))
    surely = scipy.special.stdtrit(free, 1 - ODD / (count * (count - 1)))
    return (i, j) if (float(r @ r) / left[i, j] - 1) * free > surely**2 else None


def misreading_degC(one: FrequencyFit, other: FrequencyFit, temperature_degC: ArrayLike) -> Array:
    """Return the error T' - T of the temperature that `one` reads from `other`: one(T') = other(T), NaN if not reached within its span."""
    T = np.asarray(temperature_degC, dtype=np.float64)
    reach = np.ptp(one.temperature_range_degC)
    read = _reach(one.polynomial.value, (T - reach, T + reach), other.polynomial.value(T))
    return np.asarray(read - T)
