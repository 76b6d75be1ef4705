"""Gauss points and the one-dimensional polynomial bases from which every element is a product."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre as series
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Basis:
    """Values and slopes of a polynomial basis at points of [-1, 1]; arrays of shape (points, functions)."""

    values: Array
    slopes: Array


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Points and weights of the Gauss-Legendre rule on [-1, 1], exact to degree 2 count - 1."""
    points, weights = series.leggauss(count)
    return points, weights


@cache
def lobatto(degree: int) -> Array:
    """Gauss-Lobatto-Legendre nodes: both ends of [-1, 1] and the extrema of P_degree between them."""
    last = np.zeros(degree + 1)
    last[-1] = 1.0
    inner = series.legroots(series.legder(last))
    return np.concatenate([[-1.0], np.sort(inner.real), [1.0]])


def legendre(degree: int, points: Array) -> Basis:
    """Legendre polynomials P_0 ... P_degree, the modes through the thickness."""
    values = _polynomials(degree, points)
    return Basis(values, values[:, : max(degree, 1)] @ _slopes(degree))


def _polynomials(degree: int, points: Array) -> Array:
    """P_0 ... P_degree in columns, k P_k = (2k - 1) x P_(k-1) - (k - 1) P_(k-2); called thousands of times, and numpy's own looks at axes first."""
    p = np.ones((degree + 1, len(points)))
    p[1:2] = points
    for k in range(2, degree + 1):
        p[k] = (p[k - 1] * points * (2 * k - 1) - p[k - 2] * (k - 1)) / k
    return p.T


def nodal(degree: int, points: Array) -> Basis:
    """Lagrange polynomials on the Gauss-Lobatto-Legendre nodes, the functions along the meridian."""
    modal = legendre(degree, points)
    return Basis(modal.values @ _to_modes(degree), modal.slopes @ _to_modes(degree))


def hierarchic(degree: int, points: Array) -> Basis:
    """Two linear end functions, then the integrated Legendre polynomials, φ_k = (P_k - P_(k-2)) / √(2 (2k - 1)), k = 2 ... degree."""
    p = _polynomials(degree, points)
    k = np.arange(2, degree + 1)
    bubbles = (p[:, 2:] - p[:, :-2]) / np.sqrt(2 * (2 * k - 1))
    half = np.full_like(points, 0.5)
    values = np.column_stack([(1 - points) / 2, (1 + points) / 2, bubbles])
    slopes = np.column_stack([-half, half, p[:, 1:-1] * np.sqrt((2 * k - 1) / 2)])
    return Basis(values, slopes)


@cache
def at_gauss(basis: Callable[[int, Array], Basis], degree: int, count: int) -> Basis:
    """One of these bases at the points of a Gauss rule."""
    return basis(degree, gauss(count)[0])


@cache
def values_to_hierarchic(degree: int) -> Array:
    """From values at the Gauss-Lobatto-Legendre nodes to coefficients in the hierarchic basis."""
    return np.asarray(np.linalg.inv(hierarchic(degree, lobatto(degree)).values))


@cache
def _to_modes(degree: int) -> Array:
    """Legendre coefficients of the Lagrange polynomials."""
    return np.asarray(np.linalg.inv(series.legvander(lobatto(degree), degree)), dtype=float)


@cache
def _slopes(degree: int) -> Array:
    """Legendre coefficients of the derivatives of P_0 ... P_degree."""
    return np.asarray(series.legder(np.eye(degree + 1), axis=0) if degree else np.zeros((1, 1)))
