"""Which parameter matters: Sobol indices, local slopes, linear shares; each with an interval, none where cases lack."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError

if TYPE_CHECKING:
    from studies.sweeps.results import Results

RESAMPLES = 1000
SHOWN = 10


@dataclass(frozen=True)
class SobolIndices:
    """First-order and total indices of every parameter with 90 % bootstrap intervals, (parameters,); all 0 where the variance is."""

    parameters: tuple[str, ...]
    first: Array
    first_low: Array
    first_high: Array
    total: Array
    total_low: Array
    total_high: Array
    variance: float


@dataclass(frozen=True)
class LocalSlope:
    """Slope of a column by one parameter at the nominal design, its interval, and the column at both ends."""

    parameter: str
    slope: float
    uncertainty: float
    at_low: float
    at_high: float
    nominal: float

    @property
    def swing(self) -> float:
        """Change of the column from one end to the other."""
        return self.at_high - self.at_low


@dataclass(frozen=True)
class LinearShares:
    """Least squares of a column on all parameters: slopes with 90 % intervals, share of the variance, R²."""

    parameters: tuple[str, ...]
    slope: Array
    half_width: Array
    share: Array
    r_squared: float


def sobol_indices(results: "Results", column: str) -> SobolIndices:
    """Return the Sobol indices of a column from a study with method = "sensitivity" (Saltelli 2010, table 2 b and f)."""
    study = results.study
    if study.sampling.method != "sensitivity":
        raise InputError(f"Sobol indices need [sampling] method = 'sensitivity', not '{study.sampling.method}'.")
    y = _complete(results, column)
    n, d = study.sampling.cases, len(study.parameters)
    A, B, AB = y[:n], y[n : 2 * n], y[2 * n :].reshape(d, n)
    variance = float(np.var(y[: 2 * n]))
    if variance == 0:
        nothing = np.zeros(d)
        return SobolIndices(study.names, *(nothing,) * 6, variance)
    draws = np.random.default_rng(study.sampling.seed).integers(0, n, (RESAMPLES, n))
    first, total = _indices(A, B, AB)
    spread = np.array([_indices(A[i], B[i], AB[:, i]) for i in draws])
    low, high = np.quantile(spread, [0.05, 0.95], axis=0)
    return SobolIndices(study.names, first, low[0], high[0], total, low[1], high[1], variance)


def _indices(A: Array, B: Array, AB: Array) -> tuple[Array, Array]:
    """S_i = ⟨f_B (f_ABi − f_A)⟩ / V and T_i = ½ ⟨(f_A − f_ABi)²⟩ / V, about the mean, as `scipy.stats.sobol_indices`."""
    both = np.concatenate([A, B])
    mean, variance = both.mean(), both.var()
    if variance == 0:
        return np.zeros(len(AB)), np.zeros(len(AB))
    first = ((B - mean) * (AB - A)).mean(axis=1) / variance
    total = 0.5 * ((A - AB) ** 2).mean(axis=1) / variance
    return first, total


def local_slopes(results: "Results", column: str) -> list[LocalSlope]:
    """Return the slopes at the nominal design of polynomials through each parameter's levels; ±: to that of inner levels, and error."""
    study = results.study
    if study.sampling.method != "one-at-a-time":
        raise InputError(f"local slopes need [sampling] method = 'one-at-a-time', not '{study.sampling.method}'.")
    y = _complete(results, column)
    error = float(np.nan_to_num(results.error(column)).max(initial=0.0))
    slopes = []
    for k, name in enumerate(study.names):
        rows, inner = [0, *range(1 + 4 * k, 5 + 4 * k)], [0, 2 + 4 * k, 3 + 4 * k]
        x = results.parameter(name).astype(float)
        fine, rough = (_derivative(x[some], y[some]) for some in (rows, inner))
        uncertainty = abs(fine - rough) + error / float(np.ptp(x[inner]))
        slopes.append(LocalSlope(name, fine, uncertainty, *y[[1 + 4 * k, 4 + 4 * k, 0]].tolist()))
    return slopes


def _derivative(x: Array, y: Array) -> float:
    """Derivative at x[0] of the polynomial through the distinct points."""
    _, places = np.unique(x, return_index=True)
    polynomial = np.polynomial.Polynomial.fit(x[places], y[places] - y[0], len(places) - 1)
    return float(polynomial.deriv()(x[0]))


def linear_shares(results: "Results", column: str) -> LinearShares | None:
    """Return the linear influence of every numeric parameter over a sample; None of too few cases or a constant column."""
    from scipy.special import stdtrit

    study = results.study
    numeric = [p.name for p in study.parameters if not isinstance(p.nominal, str)]
    y = results.column(column)
    there = np.isfinite(y)
    y = y[there]
    free = len(y) - len(numeric) - 1
    if not numeric or free < 2 or np.ptp(y) == 0:
        return None
    X = np.empty((len(numeric), len(y)))
    for row, name in zip(X, numeric, strict=True):
        row[:] = results.parameter(name)[there]
    if not (np.ptp(X, axis=1) > 0).all():
        return None
    spread = np.array([row.std() for row in X])
    X -= X.mean(axis=1, keepdims=True)
    X /= spread[:, None]
    inverse, residual, slopes = np.linalg.pinv(X @ X.T), y - y.mean(), np.zeros(len(X))
    for _ in range(2):  # the second takes what rounding has left
        step = inverse @ (X @ residual)
        residual -= step @ X
        slopes += step
    deviation = np.sqrt(residual @ residual / free * np.diag(inverse))
    half = stdtrit(free, 0.95) * deviation
    share = slopes**2 / y.var()
    return LinearShares(tuple(numeric), slopes / spread, half / spread, share, float(1 - residual.var() / y.var()))


def _complete(results: "Results", column: str) -> Array:
    """Return a column of which every case is there, or refuse with the list."""
    if results.done < results.total:
        raise InputError(f"{results.total - results.done} cases are not computed yet; resume the study.")
    y = results.column(column)
    lacking = np.flatnonzero(~np.isfinite(y))
    if lacking.size:
        words = [f"case {place} ({results.remark(place)})" for place in lacking[:SHOWN].tolist()]
        words += [f"and {lacking.size - SHOWN} more"] if lacking.size > SHOWN else []
        raise InputError(
            f"{lacking.size} of {len(y)} cases have no {column}(missing values are not filled in): {'; '.join(words)}. Correct the ranges, or the function, and run a new study."
        )
    return y
