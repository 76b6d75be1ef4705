"""Thermal constants from a record of frequency and housing temperature, with honest intervals.

f(t) = f₀ + a₁ x + a₂ x² + a₃ x³ + noise, x = T_r(t) − T_ref, T_r following the housing (`followers`) from an
unknown initial state. The noise is white with a wandering level (`studies.calibration.lags.wander`); the fit is generalised
least squares with the noise re-estimated by restricted likelihood, and the intervals are those of Student's t.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from studies.calibration.lags.followers import LagSeries, make_series
from studies.calibration.lags.housing_run import HousingRun, even_rows, row_step
from studies.calibration.lags.least_squares import LagProblem, LagSolution, solve
from studies.calibration.lags.wander import Wander, estimate_wander
from thermal.errors import ThermalError
from thermal.network import Array

ROWS = 2000  # most rows of a run that a fit uses
PASSES = 2  # fits, each with the noise of the one before; the first under white noise
VAGUE = 0.5  # relative standard error above which a constant counts as not determined
PART = 0.3  # smallest share with which a constant is named in an undetermined direction
FRACTIONS = (0.004, 0.03, 0.2)  # of the longest run, at which a further lag is tried
EVIDENCE = 10.0  # how far the information criterion must fall before something is believed


@dataclass(frozen=True)
class FrequencyPolynomial:
    """Coefficients of f(T) about a reference temperature (K); None is unknown and fitted."""

    reference_temperature: float  # K
    # slope, curvature, cubic: float or None, Hz/K, Hz/K², Hz/K³
    slope: float | None
    curvature: float | None = 0.0
    cubic: float | None = 0.0


@dataclass(frozen=True)
class LagEstimate:
    """A constant with its interval; `value` is None where the record does not determine it.

    `standard_error` is relative for a constant that is fitted in its logarithm.
    """

    value: float | None
    low: float
    high: float
    standard_error: float


@dataclass(frozen=True)
class Direction:
    """A combination of constants (relative changes, unit length) that the record leaves open."""

    parts: dict[str, float]
    standard_error: float

    def __str__(self) -> str:
        return " ".join(f"{share:+.2f}·{name}" for name, share in self.parts.items())


@dataclass(frozen=True)
class Identification:
    """What a record says about the thermal constants."""

    # by name: the follower's constants, the free ones of "slope", "curvature", "cubic", and "offset" (f₀)
    estimates: dict[str, LagEstimate]
    confidence: float  # of the intervals
    undetermined: tuple[Direction, ...]  # directions that the record leaves open
    departures: tuple[Array, ...]  # per run, the initial temperatures' distance (K) from the steady ones
    noise: Wander  # of the averaged rows (Hz)
    residual: Array  # Hz, all runs in order
    criterion: float  # Bayesian information criterion, to compare followers on the same record
    row_step: float  # distance (s) of the averaged rows
    warnings: tuple[str, ...]  # what was missing in the record
    problem: LagProblem = field(repr=False)
    solution: LagSolution = field(repr=False)


def identify(
    runs: Sequence[HousingRun], follower: LagSeries, law: FrequencyPolynomial, confidence: float = 0.9
) -> Identification:
    """Fit the follower's constants and the unknown coefficients of the law to one run or several."""
    if not runs:
        raise ThermalError("no run given; name at least one record.")
    if not 0 < confidence < 1:
        raise ThermalError(f"a confidence lies between 0 and 1, not at {confidence:g}.")
    step = row_step(runs, ROWS)
    even = tuple(even_rows(run, step) for run in runs)
    coefficients = (law.slope, law.curvature, law.cubic)
    problem = LagProblem(even, follower, law.reference_temperature, coefficients)
    if problem.count >= problem.rows / 2:
        raise ThermalError(
            f"{problem.rows} rows are too few for {problem.count} unknowns; give a longer record or fix constants."
        )
    solution = solve(problem, problem.guess(), problem.first_noise())
    for _ in range(PASSES - 1):
        noise = estimate_wander(solution.slope, solution.residual, problem.stretches)
        solution = solve(problem, solution.parameters, noise)
    noise = estimate_wander(solution.slope, solution.residual, problem.stretches)
    criterion = _refuse_constant(problem, solution, noise)
    return Identification(
        estimates=_estimates(problem, solution, confidence),
        confidence=confidence,
        undetermined=_undetermined(problem, solution),
        departures=problem.departures(solution.parameters),
        noise=noise,
        residual=solution.residual,
        criterion=criterion,
        row_step=step,
        warnings=tuple(warning for run in even for warning in run.warnings),
        problem=problem,
        solution=solution,
    )


def identify_lags(
    runs: Sequence[HousingRun],
    law: FrequencyPolynomial,
    most: int = 3,
    confidence: float = 0.9,
    progress: Callable[[str], None] = lambda _: None,
) -> Identification:
    """Identify as many lags as the record supports, each further one paid for by the information criterion."""
    best: Identification | None = None
    for count in range(1, most + 1):
        progress(f"{count} in series" if count > 1 else "one")
        trial = identify(runs, _best_start(runs, law, count, best), law, confidence)
        if best is not None and trial.criterion > best.criterion - EVIDENCE:
            break
        best = trial
    assert best is not None
    return best


def _best_start(
    runs: Sequence[HousingRun],
    law: FrequencyPolynomial,
    count: int,
    fewer: Identification | None,
) -> LagSeries:
    """Return the follower whose fit under white noise is closest: the lags found so far and one more."""
    if not runs:
        raise ThermalError("no run given; name at least one record.")
    step = row_step(runs, ROWS)
    even = tuple(even_rows(run, step) for run in runs)
    span = max(float(np.ptp(run.time)) for run in runs)
    shortest, longest = step, 10 * span
    found = [
        estimate.value if estimate.value is not None else span / 6
        for name, estimate in (fewer.estimates.items() if fewer else ())
        if name.startswith("time_constant")
    ]
    trials: list[tuple[float, LagSeries]] = []
    for fraction in FRACTIONS:
        starts = [float(np.clip(tau, 1.01 * shortest, 0.99 * longest)) for tau in (*found, fraction * span)]
        follower = make_series(*starts, shortest=shortest, longest=longest)
        problem = LagProblem(even, follower, law.reference_temperature, (law.slope, law.curvature, law.cubic))
        solution = solve(problem, problem.guess(), problem.first_noise())
        values = problem.constants(solution.parameters)
        fitted = [
            float(np.clip(values[f"time_constant_{j}"], *np.array([1.01, 0.99]) * [shortest, longest]))
            for j in range(1, count + 1)
        ]
        trials.append((solution.cost, make_series(*fitted, shortest=shortest, longest=longest)))
    return min(trials, key=lambda trial: trial[0])[1]


def _refuse_constant(problem: LagProblem, solution: LagSolution, noise: Wander) -> float:
    """Return the information criterion, or raise when an offset alone explains the record as well."""
    flat = problem.frequency - problem.frequency.mean()
    alone = estimate_wander(np.ones((problem.rows, 1)), flat, problem.stretches)

    def information(noise: Wander, count: int) -> float:
        variance = noise.innovation**2 * (problem.rows - count) / problem.rows
        return float(problem.rows * np.log(variance) + count * np.log(problem.rows))

    criterion = information(noise, solution.slope.shape[1])
    if criterion > information(alone, 1) - EVIDENCE:
        raise ThermalError(
            f"nothing can be identified: the frequency ({np.ptp(problem.frequency):.3g} Hz from lowest to highest) "
            "is constant within its noise; record a step, a ramp or a relaxation."
        )
    return criterion


def _estimates(problem: LagProblem, solution: LagSolution, confidence: float) -> dict[str, LagEstimate]:
    quantile = float(scipy.special.stdtrit(problem.rows - problem.count, (1 + confidence) / 2))
    errors = np.sqrt(np.diag(solution.covariance))
    scales = problem.scales(solution.parameters)
    estimates = {}
    for k, name in enumerate(problem.names):
        value, error = solution.parameters[k], errors[k]
        low, high = value - quantile * error, value + quantile * error
        if error > VAGUE * scales[k]:
            estimates[name] = LagEstimate(None, 0.0 if problem.is_logarithmic(k) else -np.inf, np.inf, float(error))
            continue
        if problem.is_logarithmic(k):
            value, low, high = np.exp([value, low, high])
        estimates[name] = LagEstimate(float(value), float(low), float(high), float(error))
    return estimates


def _undetermined(problem: LagProblem, solution: LagSolution) -> tuple[Direction, ...]:
    """Directions, in relative changes of the named constants, along which the record bounds nothing."""
    named = len(problem.names) - 1  # the offset comes last and is no thermal constant
    scales = problem.scales(solution.parameters)[:named]
    spread, axes = np.linalg.eigh(solution.covariance[:named, :named] / np.outer(scales, scales))
    directions = []
    for variance, axis in zip(spread[::-1], axes.T[::-1], strict=True):
        error = float(np.sqrt(max(variance, 0.0)))
        if error > VAGUE:
            parts = {name: float(a) for name, a in zip(problem.names, axis, strict=False) if abs(a) > PART}
            directions.append(Direction(parts, error))
    return tuple(directions)
