"""The ladder of residuals: what the card leaves as shipped, what it leaves calibrated, and what is noise."""

from dataclasses import dataclass, replace

import numpy as np

from compensation.noise import Noise
from studies.calibration.fit import CardFit
from studies.calibration.observed import SETTLED
from studies.calibration.problem import CardProblem, State


@dataclass(frozen=True)
class Rung:
    """Residuals of one response, rms of block averages: as shipped, calibrated, noise; `offset` is the rms of the means of runs."""

    as_shipped: float
    calibrated: float
    noise: float
    offset: float


def build_ladder(found: CardFit) -> dict[str, Rung]:
    """Return the residuals of every response."""
    problem = found.problem
    shipped = problem.evaluate(np.zeros(problem.count), slopes=False)
    return {
        name: Rung(
            spread_of(problem, shipped, name),
            spread_of(problem, found.state, name),
            noise_rms(found, name),
            float(np.sqrt(np.mean([found.state.residual[name][s].mean() ** 2 for s in problem.rows[name].slices]))),
        )
        for name in problem.responses
    }


def spread_of(problem: CardProblem, state: State, name: str) -> float:
    """Rms of what is left of a response, of runs about the mean of each."""
    if name == SETTLED:
        return float(np.sqrt(np.mean(state.residual[name] ** 2)))
    parts = [state.residual[name][s] - state.residual[name][s].mean() for s in problem.rows[name].slices]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def noise_rms(found: CardFit, name: str, noise: Noise | None = None) -> float:
    """Rms of the noise, of runs about the mean of each, as the fitted levels have it, or others."""
    rows, total, count = found.problem.rows[name], 0.0, 0
    levels = found.noise[name] if noise is None else noise
    for run, t in enumerate(rows.times):
        S = rows.covariance(run, levels)
        total += float(np.trace(S) - (S.mean() * len(t) if name != SETTLED else 0.0))
        count += len(t)
    return float(np.sqrt(total / count))


def usual_mean(found: CardFit, name: str) -> float:
    """Standard deviation of a run's mean by the noise without offsets."""
    rows = found.problem.rows[name]
    quiet = replace(found.noise[name], offset=0.0)
    return float(np.sqrt(np.mean([rows.covariance(run, quiet).mean() for run in range(len(rows.times))])))
