"""The interpolant through full solves on which an optimiser steps: cubic radial functions with a linear tail.

    s(x) = Σ_i w_i |x − x_i|³ + a + b·x,      Σ w_i = 0,  Σ w_i x_i = 0,

through scattered designs (Powell 1992; in trust regions: Wild and Shoemaker, CONORBIT 2013). Values and gradients of all
columns come together; columns over decades are taken by their logarithm.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
APART = 1e-9  # designs nearer than this are one


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Columns over the unit box."""

    centres: Array  # (m, p). weights : (m, columns). tail : (1 + p, columns)
    weights: Array
    tail: Array

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Values (columns,) and gradients (columns, p) at a point."""
        apart = x - self.centres
        r = np.sqrt(np.einsum("ij,ij->i", apart, apart))
        values = r**3 @ self.weights + self.tail[0] + x @ self.tail[1:]
        slopes = self.weights.T @ (3 * r[:, None] * apart) + self.tail[1:].T
        return values, slopes


def interpolate(x: Array, values: Array) -> Interpolant:
    """Lay the interpolant through values (m, columns) at points (m, p); along what no point varies it is level."""
    kept = [k for k in range(len(x)) if not k or np.abs(x[:k] - x[k]).max(axis=1).min() > APART]
    x, values = x[kept], values[kept]
    m, p = x.shape
    varied = np.ptp(x, axis=0) > APART
    middle, scale = values.mean(axis=0), np.maximum(np.ptp(values, axis=0), 1e-300)
    radial = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=2)) ** 3
    plane = np.column_stack([np.ones(m), x[:, varied]])
    q = plane.shape[1]
    whole = np.block([[radial, plane], [plane.T, np.zeros((q, q))]])
    right = np.vstack([(values - middle) / scale, np.zeros((q, values.shape[1]))])
    try:
        found = np.linalg.solve(whole, right)
    except np.linalg.LinAlgError:  # fewer designs than the plane needs
        found = np.linalg.lstsq(whole, right, rcond=None)[0]
    tail = np.zeros((1 + p, values.shape[1]))
    tail[0], tail[1:][varied] = found[m] * scale + middle, found[m + 1 :] * scale
    return Interpolant(x, found[:m] * scale, tail)
