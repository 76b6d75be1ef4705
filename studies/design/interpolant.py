"""The interpolant through full solves on which an optimiser steps: cubic radial functions with a linear tail.

    s(x) = Σ_i w_i |x − x_i|³ + a + b·(x − x̄),      Σ w_i = 0,  Σ w_i x_i = 0,

through scattered designs (Powell 1992; in trust regions: Wild and Shoemaker, CONORBIT 2013). Values and gradients of all columns come
together; columns over decades are taken by their logarithm.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array

APART = 1e-9  # designs nearer than this are one


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Columns over the unit box."""

    centres: Array  # (m, p)
    weights: Array  # w, (m, columns)
    tail: Array  # a and b, (1 + p, columns)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Values (columns,) and gradients (columns, p) at a point."""
        d = x - self.centres
        r = np.linalg.norm(d, axis=1)
        values = r**3 @ self.weights + self.tail[0] + (x - self.centres.mean(axis=0)) @ self.tail[1:]
        return values, (3 * r[:, None] * self.weights).T @ d + self.tail[1:].T

    def of(self, columns: NDArray[np.intp]) -> "Interpolant":
        """Return the interpolant of some columns alone."""
        return Interpolant(self.centres, self.weights[:, columns], self.tail[:, columns])


def interpolate(x: Array, values: Array) -> Interpolant:
    """Lay the interpolant through values (m, columns) at points (m, p); along what no point varies it is level."""
    kept = [k for k in range(len(x)) if not k or np.abs(x[:k] - x[k]).max(axis=1).min() > APART]
    x, values = x[kept], values[kept]
    middle, scale = values.mean(axis=0), np.maximum(np.ptp(values, axis=0), 1e-300)
    plane = np.column_stack([np.ones(len(x)), x - x.mean(axis=0)])
    cubes = np.linalg.norm(x[:, None] - x, axis=2) ** 3
    whole = np.block([[cubes, plane], [plane.T, np.zeros((plane.shape[1],) * 2)]])
    right = np.vstack([(values - middle) / scale, np.zeros((plane.shape[1], values.shape[1]))])
    found = np.linalg.lstsq(whole, right, rcond=None)[0] * scale  # also of fewer designs than the plane needs
    weights, tail = np.split(found, [len(x)])
    tail[0] += middle
    return Interpolant(x, weights, tail)
