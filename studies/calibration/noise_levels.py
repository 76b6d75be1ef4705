"""Noise of a calibration: its levels by response, and the rows that stand out of it."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import Noise
from compensation.noise_estimate import estimate_noise
from compensation.noise_rows import KINDS, NoiseRows
from compensation.samples import robust_spread
from studies.calibration.observed import SETTLED
from studies.calibration.problem import CardProblem, State
from studies.simulation.noise import bias_noise, frequency_noise

if TYPE_CHECKING:
    from studies.instrument.tables.noise import NoiseKeys

OUTLIER, LOOKS = 5.0, 2  # standard deviations; looks, for one outlier hides another
UNSEEN = 0.1  # of the noise of one row: a column whose whole length is less tells nothing
LASTING = ("frequency_Hz", "inverse_q")  # responses without an offset of turn-on


def residual_noise(
    problem: CardProblem, rows: Mapping[str, NoiseRows], state: State, near: Mapping[str, Noise]
) -> dict[str, Noise]:
    """Noise that the residuals would be as they are, looked for `near` another: far from the values, a straight line promises what no step keeps."""
    left = state.residual
    return {n: _levels(problem, rows[n], n, left[n], None, near.get(n), correlated=False) for n in problem.responses}


def marginal_noise(
    problem: CardProblem, rows: Mapping[str, NoiseRows], state: State, noise: Mapping[str, Noise], given: bool,
    correlated: bool,
) -> dict[str, Noise]:  # fmt: skip
    """Noise of highest marginal likelihood, each response's by itself or `given` the others'; `correlated` noise only near the end of a fit, for it follows what a wrong valley leaves."""
    target = {name: state.residual[name] + state.slope[name] @ state.point for name in problem.responses}
    if given:
        return estimate_levels(problem, rows, target, state.slope, noise, problem.responses, None, correlated)
    alone = (
        estimate_levels(problem, rows, target, state.slope, {name: noise[name]}, [name], None, correlated)
        for name in problem.responses
    )
    return {name: level for one in alone for name, level in one.items()}


def estimate_levels(
    problem: CardProblem,
    rows: Mapping[str, NoiseRows],
    target: Mapping[str, Array],
    slopes: Mapping[str, Array],
    noise: Mapping[str, Noise],
    names: Sequence[str],
    known: Array | None = None,
    correlated: bool = True,
) -> dict[str, Noise]:
    """Return the noise of highest marginal likelihood of some responses, each given the others'.

    `target`, `slopes` (response -> (M,), (M, p)) are about the prior mean; `known`, (q, p + 1), is what else says
    something of the unknowns. What the model cannot follow is left to the slow noise (Kennedy & O'Hagan 2001, J. R. Stat. Soc. B 63, 425).
    """
    found = dict(noise)
    for name in names:
        left, columns = beside_others(problem, rows, target, slopes, found, name, known)
        found[name] = _levels(problem, rows[name], name, left, columns, found.get(name), correlated)
    return found


def beside_others(
    problem: CardProblem,
    rows: Mapping[str, NoiseRows],
    target: Mapping[str, Array],
    slopes: Mapping[str, Array],
    noise: Mapping[str, Noise],
    name: str,
    known: Array | None = None,
) -> tuple[Array, Array]:
    """Rows of a response and columns of unit prior, of all that the other responses leave unknown and coarse rows see."""
    count = slopes[name].shape[1]
    told = [other for other in problem.responses if other != name and other in noise]
    white = [rows[n].whiten(np.column_stack([slopes[n], target[n]]), noise[n]) for n in told]
    white += [] if known is None else [known]
    triangle = np.linalg.qr(np.vstack([np.eye(count, count + 1), *white])).R[:count]
    R, move = triangle[:, :-1], scipy.linalg.solve_triangular(triangle[:, :-1], triangle[:, -1])
    left = target[name] - slopes[name] @ move
    # Rotated coordinates of unit prior are of unit prior again; those that the rows do not see are left out.
    J = scipy.linalg.solve_triangular(R, slopes[name].T, trans="T").T
    U, S, turn = np.linalg.svd(rows[name].means(J), full_matrices=False)
    means = rows[name].means(left)
    seen = S > UNSEEN * float(np.median(np.abs(np.diff(means - U @ (U.T @ means)))))
    return left, J @ turn[seen].T


def _levels(
    problem: CardProblem,
    rows: NoiseRows,
    name: str,
    target: Array,
    columns: Array | None,
    near: Noise | None,
    correlated: bool,
) -> Noise:
    left_out = {"offset": not has_levels(problem, name), "markov": not correlated}
    kinds = ["white"] if name == SETTLED else [kind for kind in KINDS if not left_out.get(kind)]
    precision = None if columns is None else np.ones(columns.shape[1])
    stated = None if columns is None else stated_noise(problem.instrument.noise, name)
    noise = estimate_noise(rows, target, columns, precision, kinds, near, stated)
    if name == SETTLED:  # a reading is not better than its last digit, and a level or a slope is no noise
        least, most = (max(getattr(table, end) for table in problem.tables) for end in ("rounding", "scatter"))
        return replace(noise, white=float(np.clip(noise.white, least, most)))
    return noise


def larger_noise(one: Noise, other: Noise) -> Noise:
    """Return the larger of two noises, level by level."""
    return Noise(*(max(pair) for pair in zip(astuple(one), astuple(other), strict=True)))


def has_levels(problem: CardProblem, name: str) -> bool:
    """Whether each run may have a level of its own of a response."""
    return name not in LASTING or (problem.levels and name == "frequency_Hz")


def stated_noise(noise: "NoiseKeys", response: str) -> Noise | None:
    """Slow levels and offset of a response as a card's `[noise]` states them; None where it says nothing of them."""
    stated = {"frequency_Hz": frequency_noise, "bias_deg_per_h": bias_noise}
    return replace(stated[response](noise), white=0.0) if response in stated else None


def spare_outliers(rows: NoiseRows, residual: Array, noise: Noise) -> tuple[NoiseRows, int]:
    """Rows with larger variances where one stands out of its neighbours: its square over 5², times its own white variance."""
    spared, beyond = rows, 0
    for _ in range(LOOKS):
        error, variance = spared.left_out(residual, noise)
        white = np.concatenate([noise.white**2 / own for own in rows.spans])
        more = np.concatenate(spared.stretch) - np.concatenate(rows.stretch)
        z = np.abs(error) / np.sqrt(variance - more * white)
        ratio = np.maximum((z / (OUTLIER * max(robust_spread(z), 1.0))) ** 2, 1.0)
        beyond = int(np.count_nonzero(ratio > 1))
        if not beyond:
            return rows, 0
        stretch = np.concatenate(rows.stretch) * np.where(ratio > 1, 25.0 * ratio, 1.0)
        spared = replace(rows, stretch=tuple(stretch[s] for s in rows.slices))
    return spared, beyond
