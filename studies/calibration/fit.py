"""Most probable values: Gauss–Newton steps in coloured noise that is estimated beside them.

Noise levels are at first those of the whole residual, then those of highest marginal likelihood
(`compensation.noise_estimate`), at last of each response given the others. With rows whitened by it, (JᵀJ + 1) Δ = Jᵀ r −
u, damped until the step keeps its promise, then bent as the valley bends. Blocks beyond 5 standard deviations get the
variance that they show.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.noise import Noise
from compensation.noise_rows import NoiseRows
from shell.errors import ShellError
from studies.calibration.noise_levels import larger_noise, marginal_noise, residual_noise, spare_outliers
from studies.calibration.problem import CardProblem, Progress, State
from studies.errors import InputError
from thermal.errors import ThermalError

MOST_STEPS = 30
CLOSE = 0.05  # fall of the objective that a step still promises: a move of 0.2 standard deviations in any direction
NEAR = 1.0  # the same, where no step makes the fit better: what differences and rounding leave
LITTLE = 0.02  # part of the fall so far, below which a descent ends: tails took half of its steps
SETTLED_NOISE = 1.0  # the same, below which the noise is not estimated anew
PATIENCE = 5  # steps that leave no less, after which the noise only rises: promises are not kept
LESS = 0.2  # of the logarithm of what is left, all responses together: a step that leaves less
TRIALS = 6
CORRECTIONS = 5  # of a step, towards the floor of a valley that bends
KEPT = 0.75  # of its promise, beyond which a step may be longer
LEAST_DAMPING, MOST_DAMPING, HALVINGS = -12.0, 24.0, 14  # ln of what is added to the prior's precision
LEAST_FALL = 0.1  # of the objective, over what the step promises
LONGEST_STEP = 3.0  # prior standard deviations, of any coordinate in one step
IMPOSSIBLE = (InputError, ShellError, ThermalError, CompensationError)  # what a point says that has no prediction


class Problem(Protocol):
    """What steps need of a least-squares problem whose coordinates are of unit prior variance."""

    @property
    def responses(self) -> tuple[str, ...]:
        """Names of what is compared."""

    @property
    def count(self) -> int:
        """Number of coordinates."""

    @property
    def bending(self) -> int:
        """How many coordinates come first in which it bends, and a step may not be long."""

    @property
    def ends(self) -> tuple[Array, Array]:
        """Least and largest coordinates."""

    def inside(self, point: Array) -> Array:
        """Nearest coordinates within the bounds of the values."""

    def evaluate(self, point: Array, slopes: bool = True) -> State:
        """Predict and compare."""


@dataclass(frozen=True)
class CardFit:
    """The most probable point."""

    problem: CardProblem
    state: State  # state, at the point
    # noise, rows: by response: levels, and rows with the variances of outliers enlarged
    noise: Mapping[str, Noise]
    rows: Mapping[str, NoiseRows]
    covariance: Array  # array (p, p), (JᵀJ + 1)⁻¹
    outliers: Mapping[str, int]  # by response, how many blocks stand out
    steps: int  # how many were taken
    converged: bool  # whether the last one was small
    told: Array | None = None  # array (q, p + 1), further white rows on the coordinates

    @property
    def point(self) -> Array:
        """Independent coordinates of the most probable values."""
        return self.state.point

    @property
    def away(self) -> Array:
        """How far each value is from what the card says, in its prior standard deviations."""
        priors = self.problem.priors
        return priors.standard(self.point[: len(priors.values)])


def fit(problem: CardProblem, start: Array | None = None, progress: Progress = lambda _: None) -> CardFit:
    """Find the most probable point."""
    state = problem.evaluate(np.zeros(problem.count) if start is None else start)
    rows = dict(problem.rows)
    noise: dict[str, Noise] = {}
    converged, straight, radius, step, size = False, False, LONGEST_STEP, 0, np.inf
    least, waited, correlated = np.inf, 0, False
    outliers = dict.fromkeys(problem.responses, 0)
    for step in range(1, MOST_STEPS + 1):
        left = sum(float(np.log(np.linalg.norm(state.residual[name]))) for name in problem.responses)
        waited = 0 if left < least - LESS else waited + 1
        least = min(least, left)
        if size > SETTLED_NOISE:
            found = (
                marginal_noise(problem, rows, state, noise, waited > PATIENCE, correlated)
                if straight
                else residual_noise(problem, rows, state, noise)
            )
            noise = found if waited <= PATIENCE else {name: larger_noise(noise[name], found[name]) for name in found}
        if straight:
            for name in problem.responses:
                rows[name], outliers[name] = spare_outliers(problem.rows[name], state.residual[name], noise[name])
        linear = _Linear.of(problem, state, noise, rows)
        size = linear.fall(linear.step(np.inf)[0])
        progress(f"step {step}: −2 ln L decreases by about {size:.2g}")
        if size < CLOSE and straight and step > 2:
            if correlated:
                converged = True
                break
            correlated, size = True, np.inf
            continue
        reached, radius, whole = _advance(problem, state, linear, radius, noise, rows, size < NEAR)
        if reached is None:
            converged = size < NEAR and straight
            break
        state, straight = reached, straight or whole
    covariance = covariance_at(problem, state, noise, rows)
    return CardFit(problem, state, noise, rows, covariance, outliers, step, converged)


def at_point(found: CardFit, point: Array) -> CardFit:
    """A fit as it would begin at another point, its outliers being what stands out there."""
    problem, state = found.problem, found.problem.evaluate(point)
    rows, noise = dict(problem.rows), residual_noise(problem, problem.rows, state, {})
    for _ in range(2):  # outliers hide others as long as they are noise
        rows = {n: spare_outliers(problem.rows[n], state.residual[n], noise[n])[0] for n in problem.responses}
        noise = residual_noise(problem, rows, state, noise)
    return replace(found, state=state, noise=noise, rows=rows)


def covariance_at(problem: Problem, state: State, noise: Mapping[str, Noise], rows: Mapping[str, NoiseRows]) -> Array:
    """(JᵀJ + 1)⁻¹ at a state."""
    J, _ = whitened(problem, state, noise, rows)
    _, S, ways = np.linalg.svd(np.vstack([J, np.eye(problem.count)]), full_matrices=False)
    return np.asarray((ways.T / S**2) @ ways)


def descend(problem: Problem, state: State, noise: Mapping[str, Noise], rows: Mapping[str, NoiseRows]) -> State:
    """Step in given noise as long as the objective falls by `NEAR`, and by a `LITTLE` of what it has fallen: straight lines lead the rest of the way."""
    radius, left = LONGEST_STEP, objective(problem, state, noise, rows)
    begun = left
    for _ in range(MOST_STEPS):
        linear = _Linear.of(problem, state, noise, rows)
        if linear.fall(linear.step(np.inf)[0]) < NEAR:
            break
        reached, radius, _ = _advance(problem, state, linear, radius, noise, rows)
        if reached is None:
            break
        before, left, state = left, objective(problem, reached, noise, rows), reached
        if before - left < max(NEAR, LITTLE * (begun - left)):
            break
    return state


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


def objective(problem: Problem, state: State, noise: Mapping[str, Noise], rows: Mapping[str, NoiseRows]) -> float:
    """−2 ln of likelihood and prior, up to a constant."""
    total = float(state.point @ state.point)
    return total + sum(float(np.sum(rows[n].whiten(state.residual[n], noise[n]) ** 2)) for n in problem.responses)


def whitened(
    problem: Problem, state: State, noise: Mapping[str, Noise], rows: Mapping[str, NoiseRows]
) -> tuple[Array, Array]:
    """Slopes and residuals of all responses in rows whose noise is white of variance 1."""
    white = [
        rows[name].whiten(np.column_stack([state.slope[name], state.residual[name]]), noise[name])
        for name in problem.responses
    ]
    both = np.concatenate(white)
    return both[:, :-1], both[:, -1]


@dataclass(frozen=True)
class _Linear:
    """Whitened slopes J and residuals r at a point u; (JᵀJ + 1) Δ = Jᵀ r − u within ends, by the triangle of [J; 1]."""

    slopes: Array
    residual: Array
    triangle: Array
    target: Array
    low: Array
    high: Array
    bending: int

    @classmethod
    def of(cls, problem: Problem, state: State, noise: Mapping[str, Noise], rows: Mapping[str, NoiseRows]) -> "_Linear":
        J, r = whitened(problem, state, noise, rows)
        both = np.column_stack([np.vstack([J, np.eye(problem.count)]), np.append(r, -state.point)])
        triangle = np.linalg.qr(both).R
        low, high = (end - state.point for end in problem.ends)
        return cls(J, r, triangle[:, :-1], triangle[:, -1], low, high, problem.bending)

    def length(self, move: Array) -> float:
        """How far a move goes in any coordinate in which the problem bends."""
        return float(np.abs(move[: self.bending]).max(initial=0.0))

    def fall(self, move: Array) -> float:
        """What a move promises of the objective."""
        return float(self.target @ self.target - np.sum((self.target - self.triangle @ move) ** 2))

    def step(self, radius: float) -> tuple[Array, float]:
        """The move of the largest fall of those that are no longer than the radius, and its damping (Levenberg, Marquardt)."""
        move = self._damped(0.0)
        if self.length(move) <= radius:
            return move, 0.0
        low, high = LEAST_DAMPING, MOST_DAMPING
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if self.length(self._damped(np.exp(middle))) <= radius else (middle, high)
        return self._damped(np.exp(high)), float(np.exp(high))

    def bend(self, move: Array, damping: float, bent: Array, reached: Array) -> Array:
        """What a move is short of a valley that bends, from the whitened residuals reached when it was `bent` already,
        damped as the move was.
        """
        missed = reached - (self.residual - self.slopes @ (move + bent))
        count = len(move)
        R = np.linalg.qr(np.vstack([self.triangle, np.sqrt(damping) * np.eye(count)])).R
        way = scipy.linalg.solve_triangular(R, scipy.linalg.solve_triangular(R, self.slopes.T @ missed, trans="T"))
        return np.clip(way, self.low - move, self.high - move)

    def _damped(self, damping: float) -> Array:
        more = np.sqrt(damping) * np.eye(self.triangle.shape[1])
        target = np.append(self.target, np.zeros(len(more)))
        return step_within(np.vstack([self.triangle, more]), target, self.low, self.high)


def _advance(
    problem: Problem,
    state: State,
    linear: _Linear,
    radius: float,
    noise: Mapping[str, Noise],
    rows: Mapping[str, NoiseRows],
    near: bool = False,
) -> tuple[State | None, float, bool]:
    """Go the longest step that keeps what it promises, or None; with the next radius, and whether a whole step kept half its promise.

    Where a step is `near` the end and keeps its promise, its straight lines hold there too, and none are drawn anew.
    """
    before = objective(problem, state, noise, rows)
    for _ in range(TRIALS):
        move, damping = linear.step(radius)
        length, promised = linear.length(move), max(linear.fall(move), 1e-300)
        reached = _reach(problem, state.point + move)
        kept = -np.inf if reached is None else (before - objective(problem, reached, noise, rows)) / promised
        bent = np.zeros_like(move)
        for _ in range(CORRECTIONS):
            if reached is None or kept >= KEPT:
                break
            there = np.concatenate([rows[n].whiten(reached.residual[n], noise[n]) for n in problem.responses])
            bent = linear.bend(move, damping, bent, there)
            other = _reach(problem, state.point + move + bent) if linear.length(bent) < length else None
            gained = -np.inf if other is None else (before - objective(problem, other, noise, rows)) / promised
            if gained <= kept:
                break
            reached, kept = other, gained
        if reached is not None and kept > LEAST_FALL:
            whole = length < 0.999 * radius and kept > 0.5
            wider = min(LONGEST_STEP, max(radius, 2 * length)) if kept > KEPT else radius
            drawn = replace(reached, slope=state.slope) if near and kept > KEPT else problem.evaluate(reached.point)
            return drawn, wider if kept > 0.5 else length / 2, whole
        radius = length / 4
    return None, radius, False


def _reach(problem: Problem, point: Array) -> State | None:
    """The model at a point, its values within their bounds; None where it is impossible there."""
    try:
        return problem.evaluate(problem.inside(point), slopes=False)
    except IMPOSSIBLE:
        return None
