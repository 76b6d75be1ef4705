"""Lowest eigenpairs of K x = λ M x by Cholesky, element by element, and a Krylov subspace of K⁻¹ M.

λ_min/λ_max of a thin shell is about (h/R)², so dense eigensolvers lose the digits that matter; here K is only inverted.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from shell.errors import ShellError
from shell.quadrature import Array
from shell.sparse import Index

TOO_THIN = "double precision cannot resolve the stiffness: the shell is too thin (h/R far below 1e-6)."
BLOCK = 3  # vectors a step; modes that coincide (torsion and axial, mirror images) need two
MOST = 300  # vectors in all, and four for each mode


@dataclass(frozen=True, eq=False)
class Pattern:
    """Which unknowns each element has: first the ones of its own, then those it shares with others."""

    unknowns: tuple[Index, ...]
    order: tuple[Index, ...]  # how the unknowns of each element, as they were given, are rearranged to that end
    own: tuple[int, ...]  # how many of them are its own
    skeleton: tuple[Index, ...]  # numbers of the shared ones in an order in which they couple in a narrow band
    # where the lower triangle of what each element leaves on its shared unknowns (flat) goes in the band (flat)
    entries: tuple[tuple[Index, Index], ...]
    shared: Index  # global numbers of the shared unknowns, in that order
    size: int
    band: int
    is_whole: bool  # whether there is one element, with all unknowns in their order


def find_pattern(unknowns: list[Index], size: int, in_order: bool = False) -> Pattern:
    """Split the unknowns of every element and order the shared ones (reverse Cuthill-McKee) unless they are in order."""
    uses = np.bincount(np.concatenate(unknowns), minlength=size)
    shared = np.flatnonzero(uses > 1)
    place = np.full(size, -1, dtype=np.intp)  # in the band; -1 for an element's own
    place[shared] = np.arange(len(shared))
    if len(shared) and not in_order:
        ranks = _in_a_narrow_band([place[members][place[members] >= 0] for members in unknowns], len(shared))
        place[shared] = ranks
        shared = shared[np.argsort(ranks)]
    order = tuple(np.argsort(place[members] >= 0, kind="stable") for members in unknowns)
    unknowns = [members[first] for members, first in zip(unknowns, order, strict=True)]
    own = tuple(int(np.count_nonzero(place[members] < 0)) for members in unknowns)
    where = [place[members[k:]] for members, k in zip(unknowns, own, strict=True)]
    band = max((int(w.max() - w.min()) for w in where if len(w)), default=0)
    is_whole = len(unknowns) == 1 and np.array_equal(unknowns[0], np.arange(size))
    entries = []
    for w in where:
        rows, columns, source = _lower_triangle(len(w))
        one, two = w[rows], w[columns]
        entries.append((np.maximum(one, two) + band * np.minimum(one, two), source))
    return Pattern(tuple(unknowns), order, own, tuple(where), tuple(entries), shared, size, band, is_whole)


@lru_cache(maxsize=16)
def whole_pattern(size: int) -> Pattern:
    """The pattern of one element with all unknowns."""
    return find_pattern([np.arange(size)], size)


@lru_cache(maxsize=64)
def _lower_triangle(size: int) -> tuple[Index, Index, Index]:
    """Rows, columns and flat places of the lower triangle of a matrix."""
    rows, columns = np.tril_indices(size)
    return rows, columns, rows * size + columns


def _in_a_narrow_band(elements: list[Index], size: int) -> Index:
    """Places of unknowns in an order (reverse Cuthill-McKee) in which those of one element lie near one another."""
    # unknowns that the same elements share stay together
    marks = np.zeros(size, dtype=np.uint64)
    for members, mark in zip(elements, _marks(len(elements)), strict=True):
        marks[members] += mark
    _, bundle = np.unique(marks, return_inverse=True)
    known = [np.unique(bundle[members]) for members in elements]
    owner = np.repeat(np.arange(len(known)), [len(k) for k in known])
    shares = scipy.sparse.csr_matrix((np.ones(len(owner)), (owner, np.concatenate(known))))
    rank = np.empty(shares.shape[1], dtype=np.intp)
    rank[scipy.sparse.csgraph.reverse_cuthill_mckee((shares.T @ shares).tocsr(), symmetric_mode=True)] = np.arange(
        shares.shape[1]
    )
    place = np.empty(size, dtype=np.intp)
    place[np.argsort(rank[bundle], kind="stable")] = np.arange(size)
    return place


class Factor:
    """Cholesky factor of the assembled K: own unknowns element by element, then the band of the shared ones."""

    def __init__(self, pattern: Pattern, stiffness: list[Array]) -> None:
        self.pattern = pattern
        self.own: list[Array] = []
        self.coupling: list[Array] = []
        band = np.zeros((pattern.band + 1, len(pattern.shared)), order="F")
        flat = band.reshape(-1, order="F")
        for K, own, (target, source) in zip(stiffness, pattern.own, pattern.entries, strict=True):
            L = _cholesky(K[:own, :own])
            W = np.zeros((own, len(K) - own))
            if W.size:
                W = scipy.linalg.blas.dtrsm(1.0, L, K[own:, :own].T, lower=1)
            if len(source):
                flat[target] += (K[own:, own:] - W.T @ W).ravel()[source]
            self.own.append(L)
            self.coupling.append(W)
        self.band = _cholesky_band(band)

    def solve(self, load: Array) -> Array:
        """K⁻¹ load for several columns."""
        p = self.pattern
        if p.is_whole:
            return np.asarray(scipy.linalg.lapack.dpotrs(self.own[0], load, lower=1)[0])
        x = np.empty_like(load)
        right = load[p.shared]
        half = []
        for L, W, members, own, where in zip(self.own, self.coupling, p.unknowns, p.own, p.skeleton, strict=True):
            y = scipy.linalg.blas.dtrsm(1.0, L, load[members[:own]], lower=1) if own else load[:0]
            right[where] -= W.T @ y
            half.append(y)
        if len(p.shared):
            right = scipy.linalg.lapack.dpbtrs(self.band, right, lower=1)[0]
            x[p.shared] = right
        for y, L, W, members, own, where in zip(
            half, self.own, self.coupling, p.unknowns, p.own, p.skeleton, strict=True
        ):
            if own:
                x[members[:own]] = scipy.linalg.blas.dtrsm(1.0, L, y - W @ right[where], lower=1, trans_a=1)
        return x


class Mass(Protocol):
    """Anything that multiplies columns by the mass matrix."""

    def __matmul__(self, x: Array) -> Array: ...


@dataclass(frozen=True, eq=False)
class ElementMass:
    """The mass element by element."""

    pattern: Pattern
    matrices: list[Array]

    def __matmul__(self, x: Array) -> Array:
        """M x for several columns."""
        y = np.zeros_like(x)
        for M, members in zip(self.matrices, self.pattern.unknowns, strict=True):
            y[members] += M @ x[members]
        return y


def lowest_pairs(factor: Factor, mass: Mass, count: int, accuracy: float) -> tuple[Array, Array]:
    """The `count` lowest eigenvectors as columns, M-orthonormal, lowest first, and what is left undone of each eigenvalue, relative.

    Block Lanczos of K⁻¹ M with full orthogonalisation gains about exp(4 √(gap)) at a step. A Ritz vector x of value θ
    leaves r = K⁻¹ M x - θ x; the eigenvalue is off by the square of |r| over the distance to the others, or by |r|/θ at most.
    """
    size = factor.pattern.size
    wide = min(BLOCK + count // 4, size)
    most = min(size, MOST + 4 * count)
    basis, heavy, answers = (np.empty((size, most), order="F") for _ in range(3))
    T = np.zeros((most, most))
    block, used = _orthonormal(mass, _random(size, wide))[0], 0
    while True:
        first, used = used, used + block[0].shape[1]
        basis[:, first:used], heavy[:, first:used] = block
        answers[:, first:used] = factor.solve(block[1])
        rest = answers[:, first:used]
        for _ in range(2):  # twice is enough
            share = heavy[:, :used].T @ rest
            rest = rest - basis[:, :used] @ share
            T[:used, first:used] += share
        block, link = _orthonormal(mass, rest)
        is_last = not block[0].shape[1] or used + block[0].shape[1] > most
        if used >= max(count, 2 * wide) or (is_last and used >= count):
            theta, turn = _eigenpairs((T[:used, :used] + T[:used, :used].T) / 2)
            theta, turn = theta[::-1], turn[:, ::-1]
            undone = _undone(theta, np.linalg.norm(link @ turn[first:used, :count], axis=0), count)
            if is_last or np.max(undone) < accuracy:
                break
        elif is_last:
            raise ShellError(f"the discretisation has {used} modes, fewer than the {count} asked for.")
        T[used : used + len(link), first:used] = link
    # K⁻¹ M x instead of x takes what is left of the highest modes down once more
    vectors = answers[:, :used] @ (turn[:, :count] / theta[:count])
    return vectors / np.sqrt(np.einsum("ij,ij->j", vectors, mass @ vectors)), undone


def _orthonormal(mass: Mass, x: Array) -> tuple[tuple[Array, Array], Array]:
    """An M-orthonormal basis of the columns, and M times it; and the factors, x = basis @ factors."""
    # one solve leaves little but the inextensional modes of a thin shell (two at most) in every column
    reflectors, tau, _, _ = scipy.linalg.lapack.dgeqrf(x)
    right = reflectors[: x.shape[1]] * _upper(x.shape[1])
    columns = np.asarray(scipy.linalg.lapack.dorgqr(reflectors, tau)[0])
    loaded = mass @ columns
    squares, axes = _eigenpairs(columns.T @ loaded)
    kept = squares > 1e-14 * squares[-1]
    scale = np.sqrt(squares[kept])
    axes = axes[:, kept]
    return (columns @ (axes / scale), loaded @ (axes / scale)), (axes * scale).T @ right


def _undone(theta: Array, residual: Array, count: int) -> Array:
    """Relative errors of the first eigenvalues by their residuals."""
    apart = np.full(count, np.inf)
    if len(theta) > 1:
        gaps = np.append(-np.diff(theta), theta[-1])
        apart = np.minimum(gaps, np.append(np.inf, gaps[:-1]))[:count]
    with np.errstate(divide="ignore", invalid="ignore"):
        by_angle = np.where(apart > 0, (residual / apart) ** 2, np.inf)
    return np.asarray(np.minimum(by_angle, residual / theta[:count]))


def _eigenpairs(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues, rising, and eigenvectors of a small symmetric matrix."""
    values, vectors, fault = scipy.linalg.lapack.dsyevd(matrix)
    if fault:
        raise ShellError("the eigenvalues of the subspace did not converge.")
    return np.asarray(values), np.asarray(vectors)


@lru_cache(maxsize=16)
def _upper(size: int) -> Array:
    return np.triu(np.ones((size, size)))


@lru_cache(maxsize=16)
def _marks(count: int) -> NDArray[np.uint64]:
    """Numbers whose sums tell every set of elements from every other one."""
    return np.random.default_rng(3).integers(2**63, size=count, dtype=np.uint64)


@lru_cache(maxsize=16)
def _random(size: int, width: int) -> Array:
    """A start with a share of every mode, always the same."""
    return np.random.default_rng(5).standard_normal((size, width))


def _cholesky(matrix: Array) -> Array:
    if not matrix.size:
        return matrix
    factor, fault = scipy.linalg.lapack.dpotrf(matrix.T, lower=1, clean=0)
    return np.asarray(_definite(factor, fault))


def _cholesky_band(band: Array) -> Array:
    if not band.size:
        return band
    factor, fault = scipy.linalg.lapack.dpbtrf(band, lower=1, overwrite_ab=1)
    return np.asarray(_definite(factor, fault))


def _definite(factor: Array, fault: int) -> Array:
    if fault:
        raise ShellError(TOO_THIN)
    return factor
