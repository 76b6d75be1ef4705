"""Waves around times Legendre polynomials along, in which a face is written, and their fit to scattered values."""

from dataclasses import dataclass

import numpy as np
import scipy

from shell.quadrature import Array, legendre

OUTLIER = 5.0  # standard deviations


@dataclass(frozen=True)
class WaveBasis:
    """1, cos mθ, sin mθ for m = 1 ... highest, each times P_0 ... P_degree over low ... high; coefficients flat in this order."""

    low: float
    high: float
    highest: int
    degree: int

    def along(self, position: Array) -> Array:
        """Legendre polynomials of mean square 1 at positions, (..., degree + 1); constant beyond low ... high."""
        t = 2 * (np.clip(position, self.low, self.high) - self.low) / (self.high - self.low) - 1
        values = legendre(self.degree, np.ravel(t)).values.reshape(*np.shape(t), self.degree + 1)
        return np.asarray(values * np.sqrt(2 * np.arange(self.degree + 1) + 1))

    def design(self, position: Array, theta: Array) -> Array:
        """All of them at points, (points, coefficients)."""
        turned = np.multiply.outer(theta, np.arange(1, self.highest + 1))
        around = np.stack([np.cos(turned), np.sin(turned)], axis=2).reshape(len(theta), -1)
        around = np.column_stack([np.ones(len(theta)), around])
        return np.asarray((around[:, :, None] * self.along(position)[:, None]).reshape(len(theta), -1))

    def evaluate(self, flat: Array, position: Array, theta: Array) -> Array:
        """The sum at points, by Horner's rule around: no large design matrix."""
        P, turn, c = self.along(position), np.exp(-1j * theta), self.complex(flat)
        found = np.zeros(len(position), dtype=complex)
        for m in range(self.highest, 0, -1):
            found = (found + P @ c[m]) * turn
        return np.asarray(found.real + P @ c[0].real)

    def complex(self, flat: Array) -> "np.ndarray[tuple[int, ...], np.dtype[np.complex128]]":
        """The same coefficients as a + i b, (highest + 1, degree + 1)."""
        count = self.degree + 1
        parts = flat[count:].reshape(self.highest, 2, count)
        return np.concatenate([flat[None, :count].astype(complex), parts[:, 0] + 1j * parts[:, 1]])

    def fit_roughly(self, position: Array, theta: Array, value: Array) -> tuple[Array, float]:
        """Least squares with those left out that lie far off, and how far that is."""
        good = np.ones(len(value), dtype=bool)
        limit = np.inf
        for _ in range(4):
            design = self.design(position[good], theta[good])
            normal = design.T @ design
            ridge = 1e-9 * np.trace(normal) / len(normal)
            flat = np.linalg.solve(normal + ridge * np.eye(len(normal)), design.T @ value[good])
            left = value - self.evaluate(flat, position, theta)
            scatter = float(scipy.stats.median_abs_deviation(left, scale="normal"))
            limit = OUTLIER * max(scatter, 1e-10)
            good = abs(left - np.median(left)) <= limit
        return flat, limit
