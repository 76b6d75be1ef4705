"""The interpolant through full solves on which an optimiser steps: cubic radial functions with a linear tail.

    s(x) = Σ_i w_i φ(x − x_i) − Σ_i v_i·∇φ(x − x_i) + a + b·x,      φ(d) = |d|³,      Σ w_i = 0,  Σ w_i x_i + Σ v_i = 0,

through scattered designs (Powell 1992; in trust regions: Wild and Shoemaker, CONORBIT 2013) and, where slopes of a column are
known, with these (Hermite and Birkhoff's conditions, Wu 1992). Values and gradients of all columns come together; columns over
decades are taken by their logarithm.
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
    turns: Array  # v, (m, columns, p), 0 where slopes are not known
    tail: Array  # a and b, (1 + p, columns)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Values (columns,) and gradients (columns, p) at a point."""
        d = x - self.centres
        r = np.sqrt(np.einsum("ij,ij->i", d, d))
        along = np.einsum("icj,ij->ic", self.turns, d)
        values = r**3 @ self.weights - 3 * r @ along + self.tail[0] + x @ self.tail[1:]
        pull = r[:, None] * self.weights - along / np.maximum(r, 1e-300)[:, None]
        slopes = 3 * (pull.T @ d - np.einsum("i,icj->cj", r, self.turns)) + self.tail[1:].T
        return values, slopes

    def of(self, columns: NDArray[np.intp]) -> "Interpolant":
        """Return the interpolant of some columns alone."""
        return Interpolant(self.centres, self.weights[:, columns], self.turns[:, columns], self.tail[:, columns])


def interpolate(x: Array, values: Array, slopes: Array) -> Interpolant:
    """Lay the interpolant through values (m, columns) at points (m, p), with the slopes (m, columns, p) that are not NaN."""
    kept = [k for k in range(len(x)) if not k or np.abs(x[:k] - x[k]).max(axis=1).min() > APART]
    x, values, slopes = x[kept], values[kept], slopes[kept]
    (m, p), count = x.shape, values.shape[1]
    known = np.isfinite(slopes).all(axis=2)
    weights, turns, tail = np.zeros((m, count)), np.zeros((m, count, p)), np.zeros((1 + p, count))
    has, tells = np.any(known, axis=0), np.any(known, axis=1)
    for columns, sure in ((has, tells), (~has, np.zeros(m, dtype=bool))):
        given = values[:, columns], slopes[sure][:, columns]
        weights[:, columns], turns[np.ix_(sure, columns)], tail[:, columns] = _solve(x, sure, *given)
    return Interpolant(x, weights, turns, tail)


def _solve(x: Array, sure: NDArray[np.bool_], values: Array, slopes: Array) -> tuple[Array, Array, Array]:
    """Return w, v of the points that are `sure` of their slopes, and the tail; along what no point varies it is level."""
    (m, p), s = x.shape, int(sure.sum())
    varied = (np.ptp(x, axis=0) > APART) | (s > 0)
    middle, scale = values.mean(axis=0), np.maximum(np.ptp(values, axis=0), 1e-300)
    d = x[:, None] - x
    r = np.sqrt((d**2).sum(axis=2))
    tilt = -3 * (r[..., None] * d)[:, sure].reshape(m, s * p)
    e, q = d[np.ix_(sure, sure)], r[np.ix_(sure, sure)]
    bend = e[..., :, None] * e[..., None, :] / np.maximum(q, 1e-300)[..., None, None] + q[..., None, None] * np.eye(p)
    bend = -3 * bend.swapaxes(1, 2).reshape(s * p, s * p)
    plane = np.vstack([np.column_stack([np.ones(m), x]), np.tile(np.eye(1 + p)[1:], (s, 1))])[:, [True, *varied]]
    k = plane.shape[1]
    whole = np.block([[np.block([[r**3, tilt], [tilt.T, bend]]), plane], [plane.T, np.zeros((k, k))]])
    given = slopes.swapaxes(1, 2).reshape(s * p, values.shape[1])
    right = np.vstack([(values - middle) / scale, given / scale, np.zeros((k, values.shape[1]))])
    try:
        found = np.linalg.solve(whole, right)
    except np.linalg.LinAlgError:  # fewer designs than the plane needs
        found = np.linalg.lstsq(whole, right, rcond=None)[0]
    w, v, b = np.split(found * scale, [m, m + s * p])
    tail = np.zeros((1 + p, values.shape[1]))
    tail[[True, *varied]] = b
    tail[0] += middle
    return w, v.reshape(s, p, values.shape[1]).swapaxes(1, 2), tail
