"""Lowest eigenpairs of K x = λ M x by Cholesky, element by element, and a Krylov subspace of K⁻¹ M.

λ_min/λ_max of a thin shell is about (h/R)², so dense eigensolvers lose the digits that matter; here K is only inverted.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from shell.errors import ShellError
from shell.quadrature import Array
from shell.sparse import Index, assemble_elements

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

    def assemble(self, elements: Sequence[NDArray[Any]]) -> "scipy.sparse.csc_matrix":
        """The sum of the elements' matrices, (size, size)."""
        return assemble_elements(self.unknowns, elements, self.size)


def find_pattern(unknowns: list[Index], size: int, in_order: bool = False) -> Pattern:
    """Split the unknowns of every element and order the shared ones (reverse Cuthill-McKee) unless they are in order."""
    return _find_pattern(tuple(np.asarray(members, dtype=np.intp).tobytes() for members in unknowns), size, in_order)


@lru_cache(maxsize=32)  # the same for all designs whose elements join alike
def _find_pattern(numbers: tuple[bytes, ...], size: int, in_order: bool) -> Pattern:
    unknowns = [np.frombuffer(members, dtype=np.intp) for members in numbers]
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
    entries = []
    for w in where:
        rows, columns = np.tril_indices(len(w))
        one, two = w[rows], w[columns]
        entries.append((np.maximum(one, two) + band * np.minimum(one, two), rows * len(w) + columns))
    return Pattern(tuple(unknowns), order, own, tuple(where), tuple(entries), shared, size, band)


def _in_a_narrow_band(elements: list[Index], size: int) -> Index:
    """Places of unknowns in which those of one element lie near one another: elements by reverse Cuthill-McKee, unknowns by their first and last."""
    owner, members = np.repeat(np.arange(len(elements)), [len(one) for one in elements]), np.concatenate(elements)
    users: list[set[int]] = [set() for _ in range(size)]
    for unknown, element in zip(members.tolist(), owner.tolist(), strict=True):
        users[unknown].add(element)
    rank = np.argsort(_cuthill_mckee([set().union(*(users[unknown] for unknown in one.tolist())) for one in elements]))
    first, last = np.full(size, len(elements)), np.zeros(size, dtype=np.intp)
    np.minimum.at(first, members, rank[owner])
    np.maximum.at(last, members, rank[owner])
    return np.argsort(np.lexsort((first, last)))


def _cuthill_mckee(beside: list[set[int]]) -> list[int]:
    """An order of nodes in which neighbours lie near one another, as `scipy.sparse.csgraph` has it, which takes 20 ms to load."""
    found: dict[int, None] = {}
    for start in sorted(range(len(beside)), key=lambda one: len(beside[one])):
        queue = [start]
        for one in queue:
            if one not in found:
                found[one] = None
                queue += sorted(beside[one] - found.keys(), key=lambda other: len(beside[other]))
    return [*found][::-1]


class Factor:
    """Cholesky factor of the assembled K: own unknowns element by element, then the band of the shared ones."""

    def __init__(self, pattern: Pattern, stiffness: list[Array]) -> None:
        self.pattern = pattern
        self.parts: list[tuple[Array, Array, Index, Index]] = []  # L, L⁻¹ K_own,shared, own unknowns, place in the band
        band = np.zeros((pattern.band + 1, len(pattern.shared)), order="F")
        flat = band.reshape(-1, order="F")
        shapes = zip(pattern.unknowns, pattern.own, pattern.skeleton, pattern.entries, strict=True)
        for K, (members, own, where, (target, source)) in zip(stiffness, shapes, strict=True):
            L, W = K[:own, :own], np.zeros((own, len(K) - own))
            if own:
                L = _definite(*scipy.linalg.lapack.dpotrf(L.T, lower=1, clean=0))
            if W.size:
                W = scipy.linalg.blas.dtrsm(1.0, L, K[own:, :own].T, lower=1)
            if len(source):
                flat[target] += (K[own:, own:] - W.T @ W).ravel()[source]
            self.parts.append((L, W, members[:own], where))
        self.band = _definite(*scipy.linalg.lapack.dpbtrf(band, lower=1, overwrite_ab=1)) if band.size else band

    def solve(self, load: Array) -> Array:
        """K⁻¹ load for several columns."""
        x, right, half = np.empty_like(load), load[self.pattern.shared], []
        for L, W, own, where in self.parts:
            half.append(scipy.linalg.blas.dtrsm(1.0, L, load[own], lower=1) if len(own) else load[:0])
            right[where] -= W.T @ half[-1]
        if len(right):
            right = scipy.linalg.lapack.dpbtrs(self.band, right, lower=1)[0]
            x[self.pattern.shared] = right
        for y, (L, W, own, where) in zip(half, self.parts, strict=True):
            if len(own):
                x[own] = scipy.linalg.blas.dtrsm(1.0, L, y - W @ right[where], lower=1, trans_a=1)
        return x


class Mass(Protocol):
    """Anything that multiplies columns by the mass matrix."""

    def __matmul__(self, x: Array) -> Array: ...


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
    start = np.random.default_rng(5).standard_normal((size, wide))  # has a share of every mode
    block, used = _orthonormal(mass, start)[0], 0
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
            theta, turn = np.linalg.eigh((T[:used, :used] + T[:used, :used].T) / 2)
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
    columns, right = np.linalg.qr(x)
    loaded = mass @ columns
    squares, axes = np.linalg.eigh(columns.T @ loaded)
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


def _definite(factor: Array, fault: int) -> Array:
    if fault:
        raise ShellError(TOO_THIN)
    return np.asarray(factor)
