"""Most probable values: Gauss–Newton steps in coloured noise that is estimated beside them.

At every step each response's noise has the levels of highest marginal likelihood, the free coordinates integrated out
(`compensation.correlated`); with rows whitened by it, (JᵀJ + 1) Δ = Jᵀ r − u. Blocks whose innovation stands out by more
than 5 standard deviations are given the variance that they show: one outlier moves nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from compensation.correlated import KINDS, Noise, NoiseRows, estimate_noise
from compensation.errors import CompensationError
from compensation.wander import FLICKER_TIMES, HOUR
from shell.errors import ShellError
from studies.calibration.observed import SETTLED
from studies.calibration.problem import CardProblem, Progress, State
from studies.errors import InputError
from studies.simulation.noise import bias_noise, frequency_noise
from thermal.errors import ThermalError

if TYPE_CHECKING:
    from studies.instrument.tables.noise import NoiseKeys

Array = NDArray[np.float64]
MOST_STEPS = 30
CLOSE = 0.05  # fall of the objective that a step still promises: a move of 0.2 standard deviations in any direction
NEAR = 1.0  # the same, where no step makes the fit better: what differences and rounding leave
SETTLED_NOISE = 1.0  # the same, below which the noise is not estimated anew
OUTLIER = 5.0
SHORTENINGS = 5
LEAST_FALL = 0.1  # of the objective, over what the step promises
UNSEEN = 0.1  # of the noise of one row: a column whose whole length is less tells nothing
LONGEST_STEP = 3.0  # prior standard deviations, of any coordinate in one step


@dataclass(frozen=True)
class CardFit:
    """The most probable point.

    Attributes
    ----------
    problem : Problem
    state : State, at the point
    noise, rows : by response: levels, and rows with the variances of outliers enlarged
    covariance : array (p, p), (JᵀJ + 1)⁻¹
    outliers : by response, how many blocks stand out
    steps : how many were taken
    converged : whether the last one was small
    """

    problem: CardProblem
    state: State
    noise: Mapping[str, Noise]
    rows: Mapping[str, NoiseRows]
    covariance: Array
    outliers: Mapping[str, int]
    steps: int
    converged: bool

    @property
    def point(self) -> Array:
        """Independent coordinates of the most probable values."""
        return self.state.point


def fit(problem: CardProblem, start: Array | None = None, progress: Progress = lambda _: None) -> CardFit:
    """Find the most probable point.

    Raises
    ------
    InputError, ShellError, ThermalError
        Predictions that are impossible at the card's own values.
    """
    state = problem.evaluate(np.zeros(problem.count) if start is None else start)
    rows = dict(problem.rows)
    noise: dict[str, Noise] = {}
    converged, step, size, outliers = False, 0, np.inf, dict.fromkeys(problem.responses, 0)
    for step in range(1, MOST_STEPS + 1):
        if step <= 2 or size > SETTLED_NOISE:
            noise = {name: _noise(problem, rows[name], state, name, noise.get(name)) for name in problem.responses}
        if step > 2:
            for name in problem.responses:
                rows[name], outliers[name] = _spare_outliers(problem.rows[name], state, name, noise[name])
        J, r = whitened(problem, state, noise, rows)
        # (JᵀJ + 1) Δ = Jᵀ r − u, not by its matrix: of sharp data against a wide prior that has no digits left
        both, target = np.vstack([J, np.eye(len(state.point))]), np.append(r, -state.point)
        move = step_within(both, target, *(end - state.point for end in problem.ends))
        size = float(target @ target - np.sum((target - both @ move) ** 2))
        progress(f"step {step}: −2 ln L should fall by {size:.2g}")
        if size < CLOSE and step > 3:
            converged = True
            break
        shortened = min(1.0, LONGEST_STEP / max(float(np.abs(move).max(initial=0.0)), 1e-12))
        reached = _advance(problem, state, shortened * move, shortened * float(target @ both @ move), noise, rows)
        if reached is None:
            converged = size < NEAR
            break
        state = reached
    J, _ = whitened(problem, state, noise, rows)
    _, S, ways = np.linalg.svd(np.vstack([J, np.eye(problem.count)]), full_matrices=False)
    covariance = np.asarray((ways.T / S**2) @ ways)
    return CardFit(problem, state, noise, rows, covariance, outliers, step, converged)


def step_within(both: Array, target: Array, low: Array, high: Array) -> Array:
    """Least squares of both · x = target; where x leaves its bounds it is held at them and the others are solved anew."""
    free = np.ones(both.shape[1], dtype=bool)
    x = np.zeros(len(free))
    while True:
        x[free] = np.linalg.lstsq(both[:, free], target - both[:, ~free] @ x[~free], rcond=None)[0]
        beyond = free & ((x < low) | (x > high))
        if not beyond.any():
            return x
        x = np.clip(x, low, high)
        free &= ~beyond


def objective(problem: CardProblem, state: State, noise: Mapping[str, Noise], rows: Mapping[str, NoiseRows]) -> float:
    """−2 ln of likelihood and prior, up to a constant."""
    total = float(state.point @ state.point)
    return total + sum(float(np.sum(rows[n].whiten(state.residual[n], noise[n]) ** 2)) for n in problem.responses)


def _noise(problem: CardProblem, rows: NoiseRows, state: State, name: str, near: Noise | None) -> Noise:
    J = state.slope[name]
    target = state.residual[name] + J @ state.point
    # Rotated coordinates of unit prior are of unit prior again; those that the rows do not see are left out.
    U, S, _ = np.linalg.svd(J, full_matrices=False)
    seen = S > UNSEEN * float(np.median(np.abs(np.diff(state.residual[name]))))
    kinds = ("white",) if name == SETTLED else KINDS
    stated = stated_noise(problem.instrument.noise, name)
    noise = estimate_noise(rows, target, U[:, seen] * S[seen], np.ones(int(seen.sum())), kinds, near, stated)
    if name == SETTLED:  # a reading is not better than its last digit
        rounding = max(table.resolution for table in problem.tables) / np.sqrt(12.0)
        return replace(noise, white=max(noise.white, rounding))
    return noise


def stated_noise(noise: "NoiseKeys", response: str) -> Noise | None:
    """Slow levels and offset of a response as a card's `[noise]` states them; None where it says nothing of them.

    1/f noise of Allan deviation a, S = h/f, a² = 2 ln 2 · h, has the variance h ln 4 = a² per factor of 4 in time: one of
    the exponentials of which `flicker` is the mean.
    """
    slow = {"frequency_Hz": frequency_noise, "bias_deg_per_h": bias_noise}
    if response not in slow:
        return None
    levels = slow[response](noise)
    flicker, walk = levels.flicker * np.sqrt(len(FLICKER_TIMES)), levels.walk * np.sqrt(HOUR)
    return Noise(0.0, flicker=flicker, walk=walk, offset=levels.offset)


def _spare_outliers(rows: NoiseRows, state: State, name: str, noise: Noise) -> tuple[NoiseRows, int]:
    """Rows with larger variances where one innovation stands out: its square over 5², times its own white variance."""
    white = rows.whiten(state.residual[name], noise)
    spread = 1.4826 * float(np.median(np.abs(white)))
    ratio = np.maximum((np.abs(white) / (OUTLIER * max(spread, 1.0))) ** 2, 1.0)
    beyond = int(np.count_nonzero(ratio > 1))
    if not beyond:
        return rows, 0
    stretched = tuple(
        v * np.where(ratio[s] > 1, 25.0 * ratio[s], 1.0) for v, s in zip(rows.variances, rows.slices, strict=True)
    )
    return NoiseRows(rows.times, stretched), beyond


def whitened(
    problem: CardProblem, state: State, noise: Mapping[str, Noise], rows: Mapping[str, NoiseRows]
) -> tuple[Array, Array]:
    """Slopes and residuals of all responses in rows whose noise is white of variance 1."""
    white = [
        rows[name].whiten(np.column_stack([state.slope[name], state.residual[name]]), noise[name])
        for name in problem.responses
    ]
    both = np.concatenate(white)
    return both[:, :-1], both[:, -1]


def _advance(
    problem: CardProblem,
    state: State,
    move: Array,
    fall: float,
    noise: Mapping[str, Noise],
    rows: Mapping[str, NoiseRows],
) -> State | None:
    """Go a step, or the part of it that a parabola through the objective promises most of; None where it does not fall."""
    count = len(problem.priors.values)
    before = objective(problem, state, noise, rows)
    part = 1.0
    for _ in range(SHORTENINGS):
        trial = state.point + part * move
        trial = np.concatenate([problem.priors.inside(trial[:count]), trial[count:]])
        try:
            reached = problem.evaluate(trial, slopes=part == 1)
        except (InputError, ShellError, ThermalError, CompensationError):
            part /= 4
            continue
        after = objective(problem, reached, noise, rows)
        if after < before - LEAST_FALL * part * fall:
            return reached if part == 1 else problem.evaluate(trial)
        lowest = part * fall / (after - before + 2 * part * fall)  # of the parabola of slope −2 fall at the start
        part *= float(np.clip(lowest, 0.1, 0.5))
    return None
