"""How values that the data tells move with those that it does not, to second order: a valley that is bent at its lowest point.

Where the frequency is even in Poisson's ratio, as near the least of a cylinder's, the straight line says nothing of it, and
Young's modulus would seem as sure as the frequency; yet f² ∝ E (1 + c ν²), and E follows c ν². With s_j independent unit
normals along what is left unknown (a pivoted Cholesky factor of the posterior), and Q_j how much the others move,

    z = z₀ + L (W s + rest + Σ_j Q_j s_j²),

of which an interval is summed.
"""

from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from shell.errors import ShellError
from studies.calibration.fit import LONGEST_STEP, CardFit, objective, step_within, whitened
from studies.errors import InputError
from thermal.errors import ThermalError

STRAIGHT = ("bias.", "loss.")
"""Values in which every response is a straight line."""
UNKNOWN = 0.1  # variance that is left of a value, over its prior's, from which on the others may follow it in a curve
REACH = 1.5  # standard deviations to both sides at which the curve is measured
TURNS, FRESH = 8, 5  # steps to the bottom of a valley, and from which on slopes are taken anew
NEAR = 0.1  # relative, of the objective: where the bottom of a valley is reached
FAR = 30.0  # of what is enough: where steps with the slopes of the fit have not come closer, others hardly do
HELD = 1e6  # weight of a value that is held
DRAWS = 20_000
FIVE, NINETY_FIVE = 5.0, 95.0


@dataclass(frozen=True)
class Bend:
    """What the curve adds to each value, in prior standard deviations: to both ends of its 90 % interval, and to its spread."""

    # low, high: arrays (n,)
    low: Array
    high: Array
    sd: Array  # array (n,), of the posterior, the curve included


def find_bend(fit: CardFit, J: Array) -> Bend:
    """Follow what is left unknown to both sides; `J`, (M, p), are slopes in rows whose noise is white."""
    ways, curves, rest = _follow(fit, J)
    generator = np.random.default_rng(0)
    count = len(fit.problem.priors.values)
    L = fit.problem.priors.root
    root = np.linalg.cholesky(rest + 1e-12 * np.eye(len(rest)))[:count]
    s = generator.standard_normal((len(ways), DRAWS))
    straight = L @ (root @ generator.standard_normal((root.shape[1], DRAWS)) + ways[:, :count].T @ s)
    bent = straight + L @ (curves[:, :count].T @ s**2)
    before, after = (np.percentile(z, (FIVE, NINETY_FIVE), axis=1) for z in (straight, bent))
    C = L @ fit.covariance[:count, :count] @ L.T
    more = np.maximum(bent.var(axis=1) / straight.var(axis=1), 1.0)
    return Bend(after[0] - before[0], after[1] - before[1], np.sqrt(np.diag(C) * more))


def _follow(fit: CardFit, J: Array) -> tuple[Array, Array, Array]:
    """Ways of one standard deviation, (m, p), how the others curve along each, (m, p), and the covariance that is left."""
    problem, priors = fit.problem, fit.problem.priors
    count = len(priors.values)
    rows = np.zeros((count, problem.count))
    rows[:, :count] = priors.root
    bendable = np.array([not value.name.startswith(STRAIGHT) for value in priors.values], dtype=bool)
    left = np.array(fit.covariance)
    ways, curves = [], []
    while True:
        variance = np.einsum("ki,ij,kj->k", rows, left, rows) * bendable
        k = int(np.argmax(variance)) if count else 0
        if not count or variance[k] < UNKNOWN:
            break
        way = left @ rows[k] / np.sqrt(variance[k])
        left -= np.outer(way, way)
        bendable[k] = False
        ways.append(way)
        curves.append(_curve(fit, J, rows[k], way))
    shape = (len(ways), problem.count)
    return np.array(ways).reshape(shape), np.array(curves).reshape(shape), left


def _curve(fit: CardFit, J: Array, row: Array, way: Array) -> Array:
    """Half the second derivative of the most probable point along a way, the value that it follows held; none where it ends."""
    total = np.zeros(len(way))
    for t in (-REACH, REACH):
        straight = fit.point + t * way
        found, risen = follow(fit, J, row, straight, (1 + NEAR) * t**2)
        if not np.isfinite(risen):
            return np.zeros(len(way))
        total += found - straight
    return total / (2 * REACH**2)


def follow(fit: CardFit, J: Array, row: Array, point: Array, enough: float) -> tuple[Array, float]:
    """Go down to the bottom of a valley beside a point, `row` · point held; return it and its rise, infinite where it is not `enough`."""
    problem = fit.problem
    least = objective(problem, fit.state, fit.noise, fit.rows)
    point = np.clip(point, *problem.ends)
    found, lower = point, np.inf
    for turn in range(1 + TURNS):
        fresh = turn >= FRESH
        try:
            state = problem.evaluate(point, slopes=fresh)
        except (InputError, ShellError, ThermalError):
            break
        risen = objective(problem, state, fit.noise, fit.rows) - least
        if risen < lower:
            found, lower = point, risen
        if lower < enough:
            return found, lower
        if fresh and lower > FAR * enough:
            break
        if fresh:
            J, r = whitened(problem, state, fit.noise, fit.rows)
        else:
            r = np.concatenate([fit.rows[n].whiten(state.residual[n], fit.noise[n]) for n in problem.responses])
        both, target = np.vstack([J, np.eye(len(point)), HELD * row]), np.concatenate([r, -point, [0.0]])
        move = step_within(both, target, *(end - point for end in problem.ends))
        if fresh and target @ target - np.sum((target - both @ move) ** 2) < NEAR * enough:
            return found, lower
        point = point + move / max(1.0, float(np.abs(move).max()) / LONGEST_STEP)
    return found, np.inf
