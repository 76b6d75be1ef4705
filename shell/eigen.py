"""Lowest eigenpairs of K x = λ M x by Cholesky, element by element, and inverse iteration of a small subspace.

λ_min/λ_max of a thin shell is about (h/R)², so dense eigensolvers lose the digits that matter. Here K is only ever
inverted: unknowns that live in one element are eliminated there, the rest by one dense Cholesky factor, and the
subspace is projected with Yᵀ K Y = Yᵀ M X, free of cancellation. The frequency itself is taken elsewhere, from strains.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, eigh, lapack

from shell.errors import ShellError
from shell.quadrature import Array

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Which unknowns each element has, split into its own (inner) and those it shares (outer)."""

    unknowns: tuple[Index, ...]
    inner: tuple[Index, ...]
    outer: tuple[Index, ...]
    skeleton: tuple[Index, ...]
    size: int
    skeleton_size: int


def find_pattern(unknowns: list[Index], size: int) -> Pattern:
    """Split the unknowns of every element; `skeleton` numbers the shared ones."""
    uses = np.zeros(size, dtype=int)
    for members in unknowns:
        uses[members] += 1
    if not np.all(uses):
        raise AssertionError("an unknown belongs to no element")
    shared = np.cumsum(uses > 1) - 1
    inner = tuple(np.flatnonzero(uses[members] == 1) for members in unknowns)
    outer = tuple(np.flatnonzero(uses[members] > 1) for members in unknowns)
    skeleton = tuple(shared[members[o]] for members, o in zip(unknowns, outer, strict=True))
    return Pattern(tuple(unknowns), inner, outer, skeleton, size, int(np.sum(uses > 1)))


class Factor:
    """Cholesky factor of the assembled K: inner unknowns per element, then the skeleton."""

    def __init__(self, pattern: Pattern, stiffness: list[Array]) -> None:
        self.pattern = pattern
        self.own: list[Array] = []
        self.coupling: list[Array] = []
        skeleton = np.zeros((pattern.skeleton_size, pattern.skeleton_size), order="F")
        for K, inner, outer, where in zip(stiffness, pattern.inner, pattern.outer, pattern.skeleton, strict=True):
            L = _cholesky(K[np.ix_(inner, inner)])
            W = blas.dtrsm(1.0, L, K[np.ix_(inner, outer)], lower=1) if len(inner) and len(outer) else np.zeros((len(inner), len(outer)))
            skeleton[np.ix_(where, where)] += K[np.ix_(outer, outer)] - W.T @ W
            self.own.append(L)
            self.coupling.append(W)
        self.skeleton = _cholesky(skeleton)

    def solve(self, load: Array) -> Array:
        """K⁻¹ load for several columns."""
        x = np.empty_like(load)
        right = np.zeros((self.pattern.skeleton_size, load.shape[1]))
        half = []
        for L, W, members, inner, _, where in self._elements():
            y = blas.dtrsm(1.0, L, load[members[inner]], lower=1) if len(inner) else load[:0]
            right[where] -= W.T @ y
            half.append(y)
        shared = np.empty(self.pattern.skeleton_size, dtype=np.intp)
        for _, _, members, _, outer, where in self._elements():
            shared[where] = members[outer]
        right += load[shared]
        if len(shared):
            right = lapack.dpotrs(self.skeleton, right, lower=1)[0]
            x[shared] = right
        for y, (L, W, members, inner, _, where) in zip(half, self._elements(), strict=True):
            if len(inner):
                x[members[inner]] = blas.dtrsm(1.0, L, y - W @ right[where], lower=1, trans_a=1)
        return x

    def _elements(self):  # type: ignore[no-untyped-def]
        p = self.pattern
        return zip(self.own, self.coupling, p.unknowns, p.inner, p.outer, p.skeleton, strict=True)


def apply_mass(pattern: Pattern, mass: list[Array], x: Array) -> Array:
    """M x for several columns, element by element."""
    y = np.zeros_like(x)
    for M, members in zip(mass, pattern.unknowns, strict=True):
        y[members] += M @ x[members]
    return y


def lowest_vectors(
    pattern: Pattern, stiffness: list[Array], mass: list[Array], count: int, shift: float, accuracy: float
) -> Array:
    """The `count` lowest eigenvectors of K + shift M, M-orthonormal, as columns.

    Parameters
    ----------
    pattern : unknowns of the elements.
    stiffness, mass : their matrices, in the pattern's order.
    count : how many.
    shift : added to K as shift M so that rigid motions can be factored, 1/s².
    accuracy : relative change of the Ritz values at which the iteration stops.
    """
    if shift:
        stiffness = [K + shift * M for K, M in zip(stiffness, mass, strict=True)]
    factor = Factor(pattern, stiffness)
    width = min(count + 3, pattern.size)
    x = np.random.default_rng(5).standard_normal((pattern.size, width))
    before, change = np.full(count, np.inf), np.inf
    for _ in range(60):
        loaded = apply_mass(pattern, mass, x)
        y = factor.solve(loaded)
        values, turn = eigh(_symmetric(y.T @ loaded), _symmetric(y.T @ apply_mass(pattern, mass, y)), check_finite=False)
        x = y @ turn
        last, change = change, float(np.max(abs(values[:count] / before - 1)))
        before = values[:count]
        if change < accuracy or (change < 1e-7 and change > last / 2):
            break
    return np.asarray(x[:, :count])


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2


def _cholesky(matrix: Array) -> Array:
    if not matrix.size:
        return matrix
    scale = 1 / np.sqrt(np.diagonal(matrix))
    factor, fault = lapack.dpotrf(matrix * np.outer(scale, scale), lower=1, clean=1)
    if fault:
        raise ShellError("the stiffness lost its last digit: the shell is too thin for double precision (h/R below about 1e-6).")
    return np.asarray(factor / scale[:, None], order="F")
