"""Polynomials of one variable, fitted in u = (x − centre) / half_span, whose powers are nearly independent columns."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.regression import LinearFit, fit_linear

APART = 0.01
"""Part of the span of x by which two values are apart; closer ones tell a polynomial hardly more than one does."""


@dataclass(frozen=True)
class PolynomialFit:
    """y = Σ cₖ uᵏ with u = (x − centre) / half_span; `regression` holds c and everything about the fit."""

    centre: float
    half_span: float
    regression: LinearFit

    @property
    def order(self) -> int:
        """Highest power."""
        return self.regression.coefficients.size - 1

    def scaled(self, x: ArrayLike) -> Array:
        """Return u = (x − centre) / half_span."""
        return (np.asarray(x, dtype=np.float64) - self.centre) / self.half_span

    def powers(self, x: ArrayLike) -> Array:
        """Return the rows 1, u, u², … at x, shape (…, order + 1)."""
        u = self.scaled(x)
        return np.asarray(np.stack([u**k for k in range(self.order + 1)], axis=-1), dtype=np.float64)

    def value(self, x: ArrayLike) -> Array:
        """Return y(x)."""
        return self.powers(x) @ self.regression.coefficients

    def slope(self, x: ArrayLike) -> Array:
        """Return dy/dx."""
        c = self.regression.coefficients
        return self.powers(x)[..., :-1] @ (np.arange(1, c.size) * c[1:]) / self.half_span

    def variance(self, x: ArrayLike) -> Array:
        """Return the variance of the fitted curve at x that the coefficients' covariance causes."""
        rows = self.powers(x)
        return np.asarray(np.einsum("...i,ij,...j->...", rows, self.regression.covariance, rows))

    def about(self, reference: float, covariance: Array | None = None) -> tuple[Array, Array]:
        """Return coefficients b and covariance (of c: the regression's unless given) of the same curve, y = Σ bⱼ (x − reference)ʲ."""
        own = self.regression.covariance if covariance is None else covariance
        size = self.order + 1
        offset = np.longdouble(reference - self.centre) / np.longdouble(self.half_span)
        M = np.zeros((size, size), dtype=np.longdouble)
        for k in range(size):
            for j in range(k + 1):
                M[j, k] = math.comb(k, j) * offset ** (k - j) / np.longdouble(self.half_span) ** j
        return (M @ self.regression.coefficients).astype(np.float64), (M @ own @ M.T).astype(np.float64)


def count_apart(x: ArrayLike) -> int:
    """Return how many values are apart from each other by `APART` of their span: readings of one soak are one value."""
    values = np.unique(np.asarray(x, dtype=np.float64))
    place, count = 0, 0
    while place < len(values):
        place, count = np.searchsorted(values, values[place] + APART * np.ptp(values), "right"), count + 1
    return count


def fit_polynomial(
    x: ArrayLike, y: ArrayLike, order: int, name: str = "x", least_variance: float = 0.0
) -> PolynomialFit:
    """Fit a polynomial of the given order by least squares."""
    if order < 1:
        raise CompensationError(f"a polynomial fit needs an order of 1 or more, not {order}.")
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape:
        raise CompensationError(f"'{name}' and its observations must be equally long, not {x.shape} and {y.shape}.")
    if not np.all(np.isfinite(x)):
        raise CompensationError(f"'{name}' has missing or infinite values; remove those rows.")
    distinct = count_apart(x)
    if np.ptp(x) == 0:
        raise CompensationError(f"'{name}' is constant ({x[0]:g}); record data in which it varies.")
    if distinct <= order or x.size <= order + 1:
        raise CompensationError(
            f"order {order} needs at least {order + 1} different values of '{name}' and {order + 2} rows, "
            f"not {distinct} and {x.size} (values within {100 * APART:.0f} % of their span count as one); lower the order or measure more."
        )
    # A centre and span with few bits make the scaled variable exact for tabulated values.
    half_span = float(2.0 ** np.ceil(np.log2(np.ptp(x) / 2)))
    centre = float(np.round((x.min() + x.max()) / 2 / half_span * 16) / 16 * half_span)
    u = (x - centre) / half_span
    powers = u[:, None] ** np.arange(1, order + 1)
    names = [name] + [f"{name}^{k}" for k in range(2, order + 1)]
    regression = fit_linear(powers, y, names, least_variance=least_variance)
    return PolynomialFit(centre, half_span, regression)
