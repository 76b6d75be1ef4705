r"""Which mode a reading is of: all assignments at once, by their likelihood.

About one point ln f = g + J u with u ~ N(0, 1). Readings are taken one after the other; each takes any mode that is free, the
likelihood of the innovation e = y - g - J u weighs the choice, N(e; 0, J C Jᵀ + σ²), and u is updated by it (Kalman), so that
the first readings make room and the next decide. The best assignments are kept at each step; where the last ones remain near
each other in likelihood, the readings do not decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array

KEPT = 3000
GATE = 36.0  # e² over its variance, beyond which a mode is out of question


@dataclass(frozen=True, eq=False)
class Assignment:
    """Candidate of every reading, and -2 ln of its likelihood."""

    places: tuple[int, ...]
    cost: float


def assign(y: Array, sd: Array, allowed: Sequence[Sequence[int]], g: Array, J: Array) -> list[Assignment]:
    """Return the likeliest assignments, best first; empty where none explains all readings.

    `y`, `sd`: ln f of the readings, `allowed` the places of each one's candidates; `g`, `J`: ln f of these at u = 0, and ∂ln f/∂u.
    """
    count = J.shape[1]
    order = sorted(range(len(y)), key=lambda i: len(allowed[i]))  # what is known first
    if not all(map(len, allowed)):
        return []
    cost, taken = np.zeros(1), np.full((1, len(y)), -1)
    u, C = np.zeros((1, count)), np.eye(count)[None]
    for i in order:
        grown = []
        for m in allowed[i]:
            gain = C @ J[m]
            S = gain @ J[m] + sd[i] ** 2
            e = y[i] - g[m] - u @ J[m]
            free = np.flatnonzero((e**2 < GATE * S) & ~(taken == m).any(axis=1))
            grown.append((cost[free] + e[free] ** 2 / S[free] + np.log(S[free]), free, np.full(free.size, m)))
        costs, parents, places = (np.concatenate(column) for column in zip(*grown, strict=True))
        best = np.argsort(costs, kind="stable")[:KEPT]
        cost, parent, place = costs[best], parents[best], places[best]
        gain = np.einsum("hij,hj->hi", C[parent], J[place])
        S = np.einsum("hi,hi->h", gain, J[place]) + sd[i] ** 2
        e = y[i] - g[place] - np.einsum("hi,hi->h", u[parent], J[place])
        u = u[parent] + gain * (e / S)[:, None]
        C = C[parent] - gain[:, :, None] * gain[:, None, :] / S[:, None, None]
        taken = taken[parent]
        taken[:, i] = place
    return [Assignment(tuple(map(int, places)), float(c)) for places, c in zip(taken, cost, strict=True)]
