"""The least-squares problem behind an identification: parameters, model, slopes, solution."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.noise_regression import Runs, runs_between
from studies.calibration.lags.followers import LagSeries
from studies.calibration.lags.housing_run import EvenRun
from studies.calibration.lags.wander import Wander, whiten
from thermal.errors import ThermalError
from thermal.network import Array

POWERS = ("slope", "curvature", "cubic")
USUAL_SLOPE = 8e-5  # 1/K, relative; where the record itself gives no first guess (HRG paper: about 80 ppm/°C)
WIDTH = 30.0  # K, over which curvature and cubic are compared with the slope
REST = 0.1  # K, change of the housing below which it tells nothing about the law
PRIOR = 20.0  # K, weak prior of the initial departures, which keeps those of the fastest nodes finite
FARTHEST_START = 100.0  # K, bound of the initial departures
STEP = 1e-4  # central differences, in logarithms or weights
STEP_K = 1e-2  # central differences of departures, K


@dataclass(frozen=True)
class LagProblem:
    """Parameters in order: follower's constants, free powers of the law, offset; then departures run by run."""

    runs: tuple[EvenRun, ...]
    follower: LagSeries
    reference_temperature: float
    coefficients: tuple[float | None, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters but for the departures."""
        constants = tuple(constant.name for constant in self.follower.constants)
        return (*constants, *(POWERS[k] for k in self.free_powers), "offset")

    @cached_property
    def free_powers(self) -> tuple[int, ...]:
        """Places of the law's coefficients that are fitted."""
        return tuple(k for k, value in enumerate(self.coefficients) if value is None)

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.names) + self.follower.states * len(self.runs)

    @property
    def rows(self) -> int:
        """Number of rows of all runs."""
        return len(self.frequency)

    @cached_property
    def frequency(self) -> Array:
        """Frequencies (Hz) of all runs in order."""
        return np.concatenate([run.frequency for run in self.runs])

    @cached_property
    def stretches(self) -> Runs:
        """Rows of each run, or of each part of a run between holes."""
        starts = np.cumsum([0, *(len(run.rows) for run in self.runs)])
        places = [start + np.concatenate([[0], run.breaks]) for start, run in zip(starts, self.runs, strict=False)]
        return runs_between([int(place) for place in np.concatenate(places)[1:]], self.rows)

    def is_logarithmic(self, k: int) -> bool:
        """Whether parameter k is the logarithm of its constant."""
        constants = self.follower.constants
        return k < len(constants) and constants[k].is_positive

    def constants(self, parameters: Array) -> dict[str, float]:
        """Constants of the follower by name."""
        values = [np.exp(p) if self.is_logarithmic(k) else p for k, p in enumerate(parameters)]
        return {c.name: float(v) for c, v in zip(self.follower.constants, values, strict=False)}

    def departures(self, parameters: Array) -> tuple[Array, ...]:
        """Initial departures (K), one array for each run."""
        states = self.follower.states
        return tuple(parameters[len(self.names) :].reshape(len(self.runs), states))

    def scales(self, parameters: Array) -> Array:
        """Size of each named parameter, by which its standard error is judged."""
        slope = self._law(parameters)[0] or USUAL_SLOPE * self.frequency.mean()
        sizes = [1.0 for _ in self.follower.constants]
        sizes += [abs(slope) / WIDTH**k for k in self.free_powers]
        return np.array([*sizes, abs(slope) * WIDTH])

    def guess(self) -> Array:
        """First parameters: the follower's starts, and a law fitted to them without departures."""
        constants = self.follower.constants
        head = np.array([np.log(c.start) if c.is_positive else c.start for c in constants])
        rest = np.zeros(self.count - len(head))
        parameters = np.concatenate([head, rest])
        x = np.concatenate([self._excess(parameters, i) for i in range(len(self.runs))])
        known = sum(value * x ** (k + 1) for k, value in enumerate(self.coefficients) if value is not None)
        columns = np.column_stack([x ** (k + 1) for k in self.free_powers] + [np.ones_like(x)])
        size = np.maximum(np.abs(columns).max(axis=0), 1e-9)
        law = np.linalg.lstsq(columns / size, self.frequency - known, rcond=1e-6)[0] / size
        if self.coefficients[0] is None and np.ptp(x) < REST:
            law = np.array([USUAL_SLOPE, *np.zeros(len(law) - 2), 1.0]) * self.frequency.mean()
        parameters[len(head) : len(head) + len(law)] = law
        return parameters

    def first_noise(self) -> Wander:
        """White noise as large as the differences of neighbouring rows say."""
        spread = float(np.median(np.abs(np.diff(self.frequency)))) / 0.954
        return Wander(0.0, 0.0, max(spread, 1e-9 * abs(float(self.frequency.mean()))))

    def model(self, parameters: Array) -> Array:
        """Frequencies (Hz) of all runs."""
        return np.concatenate([self._model_run(parameters, i) for i in range(len(self.runs))])

    def slope(self, parameters: Array) -> Array:
        """Derivative of `model` by the parameters, (rows, count)."""
        J = np.zeros((self.rows, self.count))
        heads, states = len(self.follower.constants), self.follower.states
        for k in range(heads):
            J[:, k] = self._difference(parameters, k, STEP, range(len(self.runs)))
        start = 0
        for i, run in enumerate(self.runs):
            rows = slice(start, start + len(run.rows))
            x = self._excess(parameters, i)
            for place, power in enumerate(self.free_powers):
                J[rows, heads + place] = x ** (power + 1)
            for state in range(states):
                k = len(self.names) + i * states + state
                J[rows, k] = self._difference(parameters, k, STEP_K, [i])
            start += len(run.rows)
        J[:, len(self.names) - 1] = 1.0
        return J

    def _difference(self, parameters: Array, k: int, step: float, runs: Sequence[int]) -> Array:
        unit = np.zeros_like(parameters)
        unit[k] = step
        up, down = (np.concatenate([self._model_run(parameters + sign * unit, i) for i in runs]) for sign in (1, -1))
        difference: Array = (up - down) / (2 * step)
        return difference

    def _law(self, parameters: Array) -> list[float]:
        free = iter(parameters[len(self.follower.constants) :])
        return [float(next(free)) if value is None else value for value in self.coefficients]

    def _model_run(self, parameters: Array, i: int) -> Array:
        x = self._excess(parameters, i)
        offset = parameters[len(self.names) - 1]
        a1, a2, a3 = self._law(parameters)
        f: Array = x * (a1 + x * (a2 + x * a3)) + float(offset)
        return f

    def _excess(self, parameters: Array, i: int) -> Array:
        """T_r − T_ref (K) of run i at the rows whose frequency is known."""
        run = self.runs[i]
        T = self.follower.follow(
            self.constants(parameters), self.departures(parameters)[i], run.time, run.housing_temperature
        )
        return np.interp(run.frequency_time, run.time, T) - self.reference_temperature


@dataclass(frozen=True)
class LagSolution:
    """Parameters with covariance, residuals (Hz) and the Jacobian (unwhitened) of a fit under a given noise."""

    parameters: Array
    covariance: Array
    residual: Array
    slope: Array
    cost: float
    noise: Wander


def solve(problem: LagProblem, start: Array, noise: Wander) -> LagSolution:
    """Minimise the whitened residuals with weak priors."""
    low, high = _bounds(problem)
    prior = _prior(problem)

    def residuals(x: Array) -> Array:
        white = whiten(problem.model(x) - problem.frequency, noise, problem.stretches)
        return np.concatenate([white, prior @ x])

    def slopes(x: Array) -> Array:
        return np.asfortranarray(np.vstack([whiten(problem.slope(x), noise, problem.stretches), prior]))

    inside = np.clip(start, low + 1e-9, high - 1e-9)
    result = scipy.optimize.least_squares(
        residuals, inside, slopes, bounds=(low, high), x_scale="jac", xtol=1e-7, ftol=1e-9, max_nfev=60
    )
    if not np.isfinite(result.cost):
        raise ThermalError("the fit of the thermal constants broke down; start it nearer or fix a constant.")
    x, covariance = np.asarray(result.x), _invert(np.asarray(result.jac))
    rest = problem.frequency - problem.model(x)
    return LagSolution(x, covariance, rest, problem.slope(x), float(2 * result.cost), noise)


def _prior(problem: LagProblem) -> Array:
    """Rows of weak priors around zero: of the departures, and of the law's curvature against its usual slope.

    Without the second a relaxation could pass for the square of one that is twice as slow.
    """
    usual = USUAL_SLOPE * abs(float(problem.frequency.mean()))
    rows = np.zeros((problem.count, problem.count))
    for k, name in enumerate(problem.names):
        if name in POWERS[1:]:
            rows[k, k] = WIDTH ** POWERS.index(name) / usual
    rows[len(problem.names) :, len(problem.names) :] = np.eye(problem.count - len(problem.names)) / PRIOR
    return rows


def _bounds(problem: LagProblem) -> tuple[Array, Array]:
    low, high = np.full(problem.count, -np.inf), np.full(problem.count, np.inf)
    for k, constant in enumerate(problem.follower.constants):
        ends = np.array([constant.low, constant.high])
        low[k], high[k] = np.log(ends) if constant.is_positive else ends
    low[len(problem.names) :], high[len(problem.names) :] = -FARTHEST_START, FARTHEST_START
    return low, high


def _invert(J: NDArray[np.float64]) -> Array:
    """Covariance (JᵀJ)⁻¹, very large but finite along directions that J does not see."""
    size = np.maximum(np.linalg.norm(J, axis=0), 1e-12)
    _, s, axes = np.linalg.svd(J / size, full_matrices=False)
    s = np.maximum(s, 1e-9 * s[0])
    scaled = axes.T / s
    covariance: Array = (scaled @ scaled.T) / np.outer(size, size)
    return covariance
