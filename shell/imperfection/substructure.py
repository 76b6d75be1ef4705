"""A sparse symmetric matrix that may be indefinite, inverted element by element.

Unknowns that live in one element (o) are eliminated there, the shared ones (s) of all elements together,

    x_s = S⁻¹ (b_s - Σ Wᵀ b_o),  x_o = A_oo⁻¹ b_o - W x_s,  W = A_oo⁻¹ A_os,  S = Σ (A_ss - A_so W).

The inverses are kept, so that an answer is a few small products.
"""

from collections.abc import Sequence
from copy import copy

import numpy as np

from shell.eigen import find_pattern
from shell.quadrature import Array
from shell.sparse import Index


class Substructures:
    """A = Σ of element matrices on their unknowns, prepared for answers."""

    def __init__(self, elements: Sequence[tuple[Index, Array]], size: int) -> None:
        pattern = find_pattern([unknowns for unknowns, _ in elements], size, in_order=True)
        S = np.zeros((len(pattern.shared), len(pattern.shared)))
        self.parts: list[tuple[slice, Index, Array, Array]] = []
        numbers, first = [], 0
        for (_, A), members, order, count, where in zip(
            elements, pattern.unknowns, pattern.order, pattern.own, pattern.skeleton, strict=True
        ):
            A = A[np.ix_(order, order)]
            inverse = np.linalg.inv(A[:count, :count])
            W = inverse @ A[:count, count:]
            S[np.ix_(where, where)] += A[count:, count:] - A[count:, :count] @ W
            self.parts.append((slice(first, first + count), where, (inverse + inverse.T) / 2, W))
            numbers.append(members[:count])
            first += count
        self.own, self.order = first, np.concatenate([*numbers, pattern.shared])
        inverse = np.linalg.inv(S)
        self.inverse = (inverse + inverse.T) / 2

    @property
    def layout(self) -> tuple[bytes, ...]:
        """What is equal of those that can be stacked."""
        return self.order.tobytes(), *(where.tobytes() for _, where, _, _ in self.parts)

    def solve(self, loads: Array) -> Array:
        """A⁻¹ of loads (..., size, columns)."""
        b = loads[..., self.order, :]
        x, right = np.empty_like(b), b[..., self.own :, :]
        for own, where, _, W in self.parts:
            right[..., where, :] -= np.swapaxes(W, -1, -2) @ b[..., own, :]
        shared = self.inverse @ right
        x[..., self.own :, :] = shared
        for own, where, inverse, W in self.parts:
            x[..., own, :] = inverse @ b[..., own, :] - W @ shared[..., where, :]
        found = np.empty_like(loads)
        found[..., self.order, :] = x
        return found


def stack(ones: Sequence[Substructures]) -> Substructures:
    """Several of the same layout, whose loads come in a row: (ones, size, columns)."""
    found = copy(ones[0])
    found.inverse = np.stack([one.inverse for one in ones])
    found.parts = [
        (own, where, np.stack([one.parts[k][2] for one in ones]), np.stack([one.parts[k][3] for one in ones]))
        for k, (own, where, _, _) in enumerate(found.parts)
    ]
    return found
