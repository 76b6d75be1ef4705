"""A = K - λ M and M of the imperfect body in a growing basis of vectors in twos: the pair, then answers to forces."""

import numpy as np

from shell.imperfection.body import Body
from shell.quadrature import Array


class PairBasis:
    """The pair, of eigenvalue λ, which the perfect body leaves without forces, and its answers to loads."""

    def __init__(self, body: Body, value: float) -> None:
        self.body, self.value = body, value
        self.rounds: list[tuple[Array, Array, Array]] = []  # vectors X with A X and M X
        self.A = self.M = np.zeros((0, 0))

    def extend(self, X: Array, load: Array) -> None:
        """Add two vectors (unknowns, 2, 2) with what the perfect body's A makes of them (but for what holds back the pair)."""
        change, mass = self.body.respond(X, self.value)
        self.rounds.append((X, load + change, mass))
        self.A, self.M = (
            _border(old, [products(one[kind], X) for one in self.rounds]) for old, kind in ((self.A, 1), (self.M, 2))
        )

    def forces(self, T: Array) -> Array:
        """A of combinations T (basis, 2) of the vectors."""
        both = np.kron(T, np.eye(2)).reshape(-1, 4, 4)
        found = sum(force.reshape(-1, 4) @ w for (_, force, _), w in zip(self.rounds, both, strict=True))
        return np.asarray(found).reshape(-1, 2, 2)

    def fold(self, at: float = 0.0) -> tuple[Array, Array, Array]:
        """A at λ + at on the pair with the rest folded onto it, T, and Tᵀ M T."""
        A = self.A - at * self.M
        rest = np.linalg.pinv(A[2:, 2:], rcond=1e-13, hermitian=True) @ A[2:, :2]
        T = np.vstack([np.eye(2), -rest])
        return A[:2, :2] - A[:2, 2:] @ rest, T, T.T @ self.M @ T


def products(one: Array, other: Array) -> Array:
    """Of two times two vectors, (2, 2)."""
    return np.asarray(np.einsum("vcwc->vw", (one.reshape(-1, 4).T @ other.reshape(-1, 4)).reshape(2, 2, 2, 2)))


def _border(old: Array, columns: list[Array]) -> Array:
    """A symmetric matrix grown by two columns."""
    last = (columns[-1] + columns[-1].T) / 2
    if not len(old):
        return last
    side = np.concatenate(columns[:-1])
    return np.block([[old, side], [side.T, last]])
