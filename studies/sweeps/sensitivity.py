"""Which parameter matters: Sobol indices, local slopes, linear shares; each with an interval, none where cases lack."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError
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


def sobol_indices(results: Results, column: str) -> SobolIndices:
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
    """S_i = ⟨f_B (f_ABi − f_A)⟩ / V and T_i = ½ ⟨(f_A − f_ABi)²⟩ / V, about the mean; 0 where V is."""
    from scipy import stats

    found = stats.sobol_indices(func={"f_A": A[None], "f_B": B[None], "f_AB": AB[:, None]}, n=len(A))
    return np.ravel(found.first_order), np.ravel(found.total_order)


def local_slopes(results: Results, column: str) -> list[LocalSlope]:
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


def linear_shares(results: Results, column: str) -> LinearShares | None:
    """Return the linear influence of every numeric parameter over a sample; None of too few cases or a constant column."""
    from scipy.special import stdtrit

    study = results.study
    numeric = [p.name for p in study.parameters if not isinstance(p.nominal, str)]
    if not numeric:
        return None
    # normal equations of what lies about the first block's means, over its spreads
    d = len(numeric)
    about = over = np.zeros(0)
    count, sums, products, ends = 0, np.zeros(d + 1), np.zeros((d + 1, d + 1)), np.tile([[np.inf], [-np.inf]], d + 1)
    for z in _numbers(results, numeric, column):
        if not about.size:
            about = z.mean(axis=1)
            over = np.maximum(z.std(axis=1), 1e-9 * np.abs(about) + 1e-300)
        ends = np.array([np.minimum(ends[0], z.min(axis=1)), np.maximum(ends[1], z.max(axis=1))])
        z = (z - about[:, None]) / over[:, None]
        count, sums, products = count + z.shape[1], sums + z.sum(axis=1), products + z @ z.T
    if count - d - 1 < 2 or not (ends[1] > ends[0]).all():
        return None
    mean = sums / count
    scatter = products - count * np.outer(mean, mean)
    inverse = np.linalg.pinv(scatter[:d, :d])
    slopes = inverse @ scatter[:d, d]
    shift, squares = mean[d] - slopes @ mean[:d], 0.0
    for z in _numbers(results, numeric, column):
        z = (z - about[:, None]) / over[:, None]
        residual = z[d] - slopes @ z[:d] - shift
        squares += float(residual @ residual)
    deviation = np.sqrt(squares / (count - d - 1) * np.diag(inverse))
    half = stdtrit(count - d - 1, 0.95) * deviation
    scale, spread = over[d] / over[:d], np.sqrt(np.diag(scatter)[:d] / count)
    share = (slopes * spread) ** 2 / (scatter[d, d] / count)
    return LinearShares(tuple(numeric), slopes * scale, half * scale, share, 1 - squares / float(scatter[d, d]))


def _numbers(results: Results, numeric: Sequence[str], column: str) -> Iterator[Array]:
    """Give the numeric parameters and a column of the designs that have it, some thousand at a time."""
    for z in results.pieces([*numeric, column]):
        kept = z[:, np.isfinite(z[-1])]
        if kept.size:
            yield kept


def _complete(results: Results, column: str) -> Array:
    """Return a column of which every case is there, or refuse with the list."""
    if results.done < results.total:
        raise InputError(f"{results.total - results.done} cases are not computed yet; resume the study.")
    y = results.column(column)
    lacking = np.flatnonzero(~np.isfinite(y))
    if lacking.size:
        words = [f"case {place} ({results.remark(place)})" for place in lacking[:SHOWN].tolist()]
        words += [f"and {lacking.size - SHOWN} more"] if lacking.size > SHOWN else []
        what = f"{lacking.size} of {len(y)} cases have no {column}(missing values are not filled in)"
        raise InputError(f"{what}: {'; '.join(words)}. Correct the ranges, or the function, and run a new study.")
    return y
