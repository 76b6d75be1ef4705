"""Linear least squares with the statistics that a calibration states beside its coefficients.

y = X b + ε, HRG paper eqs. (19), (20). Columns are shifted by their mean and scaled to unit length, the
system is solved by Householder QR with column pivoting, and refined with
residuals in extended precision (where the machine has none beyond double, the hardest of NIST's data, Wampler5, keeps 8
digits instead of more than 9). Symbols: X design, Q R its factors, b coefficients, e residuals.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError

CONSTANT = "constant"
# A column counts as a combination of others when less than this part of its length, or less than what its
# rounding to double precision amounts to, is its own.
COLLINEAR = 1e-12
REFINEMENTS = 3


@dataclass(frozen=True)
class LinearFit:
    """Least-squares coefficients (p,) with covariance and evidence; `bread` = (XᵀX)⁻¹, `least_variance` of the observations."""

    names: tuple[str, ...]
    coefficients: Array
    fitted: Array
    residuals: Array
    leverage: Array
    design: Array
    bread: Array
    least_variance: float

    @property
    def rows(self) -> int:
        """Number of observations m."""
        return self.residuals.size

    @property
    def degrees_of_freedom(self) -> int:
        """Observations less coefficients, m − p."""
        return self.residuals.size - self.coefficients.size

    @property
    def sum_of_squares(self) -> float:
        """Residual sum of squares eᵀe."""
        return float(self.residuals @ self.residuals)

    @property
    def standard_deviation(self) -> float:
        """Residual standard deviation √(eᵀe / (m − p))."""
        return math.sqrt(self.sum_of_squares / self.degrees_of_freedom)

    @property
    def variance(self) -> float:
        """Variance of one observation: eᵀe / (m − p), but never below `least_variance`."""
        return max(self.sum_of_squares / self.degrees_of_freedom, self.least_variance)

    @property
    def covariance(self) -> Array:
        """Covariance of the coefficients, independent errors assumed: variance · (XᵀX)⁻¹, shape (p, p)."""
        return self.variance * self.bread

    @property
    def standard_errors(self) -> Array:
        """Standard deviations of the coefficients, independent errors assumed."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def r_squared(self) -> float:
        """Part of the variance about the mean (about zero without a constant) that the fit explains."""
        y = self.fitted + self.residuals
        about = y.mean() if CONSTANT in self.names else 0.0
        return 1.0 - self.sum_of_squares / float(np.sum((y - about) ** 2))

    @property
    def leave_one_out(self) -> Array:
        """Errors of predicting each observation from all the others, e / (1 − leverage), shape (m,)."""
        alone = np.flatnonzero(self.leverage > 1 - 1e-10)
        if alone.size:
            raise CompensationError(f"row {alone[0] + 1} alone fixes one of the coefficients, so it cannot be predicted from the others; lower the order or measure more.")  # fmt: skip
        return self.residuals / (1.0 - self.leverage)

    @property
    def leave_one_out_rms(self) -> float:
        """Root mean square of the leave-one-out errors."""
        return float(np.sqrt(np.mean(self.leave_one_out**2)))


@dataclass(frozen=True)
class FTest:
    """F statistic of a restriction with its degrees of freedom and p-value."""

    statistic: float
    numerator: int
    denominator: int
    p_value: float


def fit_linear(
    X: ArrayLike, y: ArrayLike, names: Sequence[str], *, constant: bool = True, least_variance: float = 0.0
) -> LinearFit:
    """Fit y = b₀ + X b by least squares, HRG paper eqs. (19), (20)."""
    X, y = _check(X, y, names)
    m, k = X.shape
    if m < k + constant + 1:
        raise CompensationError(f"{k + constant} coefficients need at least {k + constant + 1} rows, not {m}; record more or ask for fewer terms.")  # fmt: skip
    shift = X.mean(axis=0) if constant else np.zeros(k)
    Z = X - shift
    labels = tuple(names)
    if constant:
        refuse_constant_columns(X, names)
        Z, labels = np.column_stack([np.ones(m), Z]), (CONSTANT, *names)
    scale = np.sqrt(np.einsum("ij,ij->j", Z, Z))
    if np.any(scale == 0):
        raise CompensationError(f"column '{labels[int(np.argmin(scale))]}' is zero throughout; leave it out.")
    rounding = np.finfo(np.float64).eps * np.max(np.max(np.abs(X), axis=0) * math.sqrt(m) / scale[-k:])
    Q, R, order = _factor(Z / scale, labels, max(COLLINEAR, 8 * rounding))
    # From shifted and scaled columns back to the user's: b = T b_scaled.
    T = np.diag(1.0 / scale)
    if constant:
        T[0, 1:] = -shift / scale[1:]
    design = np.column_stack([np.ones(m), X]) if constant else X
    root = T[:, order] @ scipy.linalg.solve_triangular(R, np.eye(R.shape[0]))
    coefficients, residuals = _solve(Q, R, root, design, y)
    return LinearFit(
        names=labels, coefficients=coefficients, fitted=y - residuals, residuals=residuals,
        leverage=np.minimum(np.einsum("ij,ij->i", Q, Q), 1.0), design=design, bread=root @ root.T,
        least_variance=least_variance,
    )  # fmt: skip


def refuse_constant_columns(X: Array, names: Sequence[str]) -> None:
    """Raise a CompensationError that names the first column of X (m, k) without variation."""
    for name, column in zip(names, X.T, strict=True):
        if np.ptp(column) <= 1e-13 * np.max(np.abs(column)):
            raise CompensationError(f"column '{name}' is constant ({column[0]:g}): it determines nothing; leave it out or record data in which it varies.")  # fmt: skip


def compare_nested(small: LinearFit, large: LinearFit) -> FTest:
    """Test whether the terms that `large` has beyond `small` are needed: F = (ΔSSE / Δp) / (SSE / (m − p)), errors independent."""
    extra = large.coefficients.size - small.coefficients.size
    if extra < 1 or small.rows != large.rows:
        raise CompensationError("the F-test compares a model with a larger one fitted to the same rows.")
    reduction = (small.sum_of_squares - large.sum_of_squares) / extra
    left = large.sum_of_squares / large.degrees_of_freedom
    # Rounded readings can lie on a curve exactly; then any reduction is infinitely significant.
    statistic = max(reduction, 0.0) / left if left else math.inf if reduction > 0 else 0.0
    p_value = float(scipy.special.fdtrc(extra, large.degrees_of_freedom, statistic))
    return FTest(statistic, extra, large.degrees_of_freedom, p_value)


def _check(X: ArrayLike, y: ArrayLike, names: Sequence[str]) -> tuple[Array, Array]:
    X = np.asarray(X, dtype=np.float64)
    y = np.asarray(y, dtype=np.float64)
    if X.ndim != 2 or y.shape != (X.shape[0],) or len(names) != X.shape[1]:
        raise CompensationError(f"a fit needs one row per observation and one name per column: X is {X.shape}, y is {y.shape}, {len(names)} names.")  # fmt: skip
    for name, column in zip([*names, "y"], [*X.T, y], strict=True):
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise CompensationError(f"column '{name}' has {bad.size} missing or infinite values (first in row {bad[0] + 1}); remove those rows.")  # fmt: skip
    return X, y


def _factor(Z: Array, names: Sequence[str], tolerance: float) -> tuple[Array, Array, NDArray[np.intp]]:
    """Pivoted QR of unit columns; a pivot of rounding size names the column that others make up."""
    Q, R, order = scipy.linalg.qr(Z, mode="economic", pivoting=True)
    small = np.flatnonzero(np.abs(np.diag(R)) < tolerance)
    if small.size:
        rank = int(small[0])
        share = scipy.linalg.solve_triangular(R[:rank, :rank], R[:rank, rank])
        others = [f"'{names[order[j]]}'" for j in range(rank) if abs(share[j]) > 1e-6]
        raise CompensationError(
            f"column '{names[order[rank]]}' is a linear combination of {', '.join(others)}: "
            "their coefficients cannot be told apart; leave one of them out, or lower the order if they are powers."
        )
    return np.asarray(Q, dtype=np.float64), np.asarray(R, dtype=np.float64), np.asarray(order, dtype=np.intp)


def _solve(Q: Array, R: Array, root: Array, design: Array, y: Array) -> tuple[Array, Array]:
    """Solve r + X b = y, Xᵀ r = 0, refined together with residuals in extended precision (Björck 1967)."""
    X, target = design.astype(np.longdouble), y.astype(np.longdouble)
    b, r = np.zeros(X.shape[1], np.longdouble), np.zeros(X.shape[0], np.longdouble)
    for _ in range(REFINEMENTS + 1):
        f = (target - r - X @ b).astype(np.float64)
        # rootᵀ X = Qᵀ, so the small triangular system of the normal part is already solved by root.
        d = Q.T @ f - root.T @ (-(X.T @ r)).astype(np.float64)
        b += root @ d
        r += f - Q @ d
    return b.astype(np.float64), r.astype(np.float64)
