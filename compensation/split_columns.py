"""What several columns of a record tell of one split of a wave: together, or in contradiction."""

from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array

CHANCE = 1e-3  # of a disagreement that is none
LARGE = 0.1  # part of what columns tell, by which they disagree, beyond which one is wrong
LEAST = 2.0  # standard deviations from which on a split has an axis
FAR = 10.0  # standard deviations apart, from which one that a factor mends is wrong too
Told = tuple[Array, Array]
"""Both components of a split, and their covariance."""


@dataclass(frozen=True)
class Conflict:
    """Two columns that disagree about a split, and the `factor` on the second with which they agree (NaN: there is none).

    `widened`, where it is not 0: they disagree by little, and the intervals were widened so many times instead.
    """

    split: str  # "frequency" or "damping"
    columns: tuple[str, str]
    factor: float
    widened: float


def join_columns(
    split: str, columns: tuple[str, str], told: dict[str, Told], conflicts: list[Conflict], W: Told | None = None
) -> tuple[Told | None, tuple[float, float] | None]:
    """Return what two columns tell together, the second less ε W, and ε; of one column what it tells; and note where they disagree."""
    if len(found := [told[name] for name in columns if name in told]) < 2:
        return (found[0] if found else None), None
    (one, one_cov), (two, two_cov) = found
    free, eye, epsilon = [] if W is None else [-W[0][:, None]], np.eye(2), 0.0
    X = np.block([[eye, *(np.zeros((2, 1)) for _ in free)], [eye, *free]])
    for _ in range(3):  # the uncertainty of W counts with ε
        V = scipy.linalg.block_diag(one_cov, two_cov + (0.0 if W is None else epsilon**2 * W[1]))
        weight = np.linalg.inv(V)
        covariance = np.linalg.inv(X.T @ weight @ X)
        b = covariance @ X.T @ weight @ np.concatenate([one, two])
        epsilon = float(b[2]) if free else 0.0
    left = np.concatenate([one, two]) - X @ b
    dof = 4 - X.shape[1]
    misfit, most = float(left @ weight @ left) / dof, float(scipy.special.chdtri(dof, CHANCE)) / dof
    if misfit > most:
        A = np.column_stack([one, *free])
        scale = np.linalg.lstsq(A, two, rcond=None)[0]
        off = two - A @ scale
        apart = float(off @ np.linalg.solve(two_cov + scale[0] ** 2 * one_cov, off))
        factor = 1 / scale[0] if apart < scipy.special.chdtri(1, CHANCE) else np.nan
        little = np.hypot(*(left[:2] - left[2:])) < LARGE * max(np.hypot(*one), np.hypot(*two))
        little &= not (misfit > FAR**2 and abs(factor - 1) > LARGE)
        conflicts.append(Conflict(split, columns, float(factor), float(np.sqrt(misfit)) if little else 0.0))
        if not little:
            return found[0], None
        covariance = covariance * misfit
    phase = (epsilon, float(np.sqrt(covariance[2, 2]))) if free else None
    return (b[:2], covariance[:2, :2]), phase


def polar(name: str, vector: Array, covariance: Array, harmonic: int) -> dict[str, tuple[float, float]]:
    """Return a split and, unless it may be none, its axis from its two components, their deviations to first order."""
    size = float(np.hypot(*vector))
    along, across = vector / size, np.array([-vector[1], vector[0]]) / size
    split = {f"{name}_split": (size, float(np.sqrt(along @ covariance @ along)))}
    if size < LEAST * split[f"{name}_split"][1]:
        return split
    return split | {
        f"{name}_axis": (
            float(np.arctan2(vector[1], vector[0])) / (2 * harmonic),
            float(np.sqrt(across @ covariance @ across)) / size / (2 * harmonic),
        ),
    }
