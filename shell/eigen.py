"""Lowest eigenpairs of K x = λ M x by Cholesky, element by element, and inverse iteration of a small subspace.

λ_min/λ_max of a thin shell is about (h/R)², so dense eigensolvers lose the digits that matter. Here K is only ever
inverted: unknowns that live in one element are eliminated there, the rest by one dense Cholesky factor, and the
subspace is projected with Yᵀ K Y = Yᵀ M X, free of cancellation. The frequency itself is taken elsewhere, from strains.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, eigh, lapack
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from shell.errors import ShellError
from shell.quadrature import Array

Index = NDArray[np.intp]
TOO_THIN = "the stiffness lost its last digit in double precision: the shell is too thin (h/R far below 1e-6)."


@dataclass(frozen=True, eq=False)
class Pattern:
    """Which unknowns each element has, split into its own (inner) and those it shares (outer).

    `skeleton` numbers the shared unknowns so that they couple in a narrow band; `shared` are their global numbers.
    """

    unknowns: tuple[Index, ...]
    inner: tuple[Index, ...]
    outer: tuple[Index, ...]
    skeleton: tuple[Index, ...]
    shared: Index
    size: int
    band: int


def find_pattern(unknowns: list[Index], size: int) -> Pattern:
    """Split the unknowns of every element and order the shared ones (reverse Cuthill-McKee)."""
    uses = np.zeros(size, dtype=int)
    for members in unknowns:
        uses[members] += 1
    shared = np.flatnonzero(uses > 1)
    inner = tuple(np.flatnonzero(uses[members] == 1) for members in unknowns)
    outer = tuple(np.flatnonzero(uses[members] > 1) for members in unknowns)
    number = np.cumsum(uses > 1) - 1
    where = [number[members[o]] for members, o in zip(unknowns, outer, strict=True)]
    if len(shared):
        owner = np.concatenate([np.full(len(w), k) for k, w in enumerate(where)])
        element = csr_matrix((np.ones(len(owner)), (owner, np.concatenate(where))), shape=(len(unknowns), len(shared)))
        order = reverse_cuthill_mckee((element.T @ element).tocsr(), symmetric_mode=True)
        place = np.empty(len(shared), dtype=np.intp)
        place[order] = np.arange(len(shared))
        where, shared = [place[w] for w in where], shared[order]
    band = max((int(np.ptp(w)) for w in where if len(w)), default=0)
    return Pattern(tuple(unknowns), inner, outer, tuple(where), shared, size, band)


class Factor:
    """Cholesky factor of the assembled K: inner unknowns per element, then the band of the shared ones."""

    def __init__(self, pattern: Pattern, stiffness: list[Array]) -> None:
        self.pattern = pattern
        self.own: list[Array] = []
        self.coupling: list[Array] = []
        height = pattern.band + 1
        band = np.zeros((height, len(pattern.shared)), order="F")
        entries = band.reshape(-1, order="F")
        for K, inner, outer, where in zip(stiffness, pattern.inner, pattern.outer, pattern.skeleton, strict=True):
            L = _cholesky(K[inner[:, None], inner])
            W = np.zeros((len(inner), len(outer)))
            if W.size:
                W = blas.dtrsm(1.0, L, K[inner[:, None], outer], lower=1)
            rows, columns = np.nonzero(where[:, None] >= where)
            schur = K[outer[:, None], outer] - W.T @ W
            entries[where[rows] - where[columns] + height * where[columns]] += schur[rows, columns]
            self.own.append(L)
            self.coupling.append(W)
        self.band = _cholesky_band(band)

    def solve(self, load: Array) -> Array:
        """K⁻¹ load for several columns."""
        p = self.pattern
        x = np.empty_like(load)
        right = load[p.shared]
        half = []
        for L, W, members, inner, where in zip(self.own, self.coupling, p.unknowns, p.inner, p.skeleton, strict=True):
            y = blas.dtrsm(1.0, L, load[members[inner]], lower=1) if len(inner) else load[:0]
            right[where] -= W.T @ y
            half.append(y)
        if len(p.shared):
            right = lapack.dpbtrs(self.band, right, lower=1)[0]
            x[p.shared] = right
        for y, L, W, members, inner, where in zip(
            half, self.own, self.coupling, p.unknowns, p.inner, p.skeleton, strict=True
        ):
            if len(inner):
                x[members[inner]] = blas.dtrsm(1.0, L, y - W @ right[where], lower=1, trans_a=1)
        return x


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
    width = min(2 * count + 3, pattern.size)  # the more vectors beyond `count`, the faster they converge
    x = np.random.default_rng(5).standard_normal((pattern.size, width))
    before, change = np.full(count, np.inf), np.inf
    # one solve leaves little but the inextensional modes of a thin shell (two at most) in every column
    x = _set_apart(pattern, mass, factor.solve(apply_mass(pattern, mass, x)))
    loaded = apply_mass(pattern, mass, x)
    for _ in range(300):
        y = factor.solve(loaded)
        heavy = apply_mass(pattern, mass, y)
        values, turn = _project(y.T @ loaded, y.T @ heavy)
        x, loaded = y @ turn, heavy @ turn
        last, change = change, float(np.max(abs(values[:count] / before - 1)))
        before = values[:count]
        if change < accuracy or (change < 1e-8 and change > last):
            break
    return np.asarray(x[:, :count])


def _set_apart(pattern: Pattern, mass: list[Array], x: Array) -> Array:
    """Remove the first two columns from all later ones (Gram-Schmidt, twice, in the inner product of M)."""
    for k in range(min(2, x.shape[1])):
        heavy = apply_mass(pattern, mass, x[:, [k]])
        norm = float(np.sqrt(x[:, k] @ heavy[:, 0]))
        lead, heavy = x[:, [k]] / norm, heavy / norm
        for _ in range(2):
            x[:, k + 1 :] -= lead @ (heavy.T @ x[:, k + 1 :])
    return x


def _project(K: Array, M: Array) -> tuple[Array, Array]:
    """Ritz values and vectors of the subspace."""
    try:
        values, vectors = eigh(_symmetric(K), _symmetric(M), check_finite=False)
    except np.linalg.LinAlgError:
        raise ShellError(TOO_THIN) from None
    return values, vectors


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2


def _cholesky(matrix: Array) -> Array:
    if not matrix.size:
        return matrix
    factor, fault = lapack.dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
    return np.asarray(_definite(factor, fault))


def _cholesky_band(band: Array) -> Array:
    if not band.size:
        return band
    factor, fault = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
    return np.asarray(_definite(factor, fault))


def _definite(factor: Array, fault: int) -> Array:
    if fault:
        raise ShellError(TOO_THIN)
    return factor
