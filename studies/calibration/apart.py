"""Records whose chamber does not explain their housing: the housing, which is measured, drives the resonator alone."""

from collections.abc import Callable
from dataclasses import replace

from studies.calibration.fit import CardFit, fit
from studies.calibration.observed import HOUSING
from studies.calibration.problem import CardProblem

APART = (
    "The chamber's temperatures do not explain the housing's by the heat path of this card (a set point that the air follows late, say):"
    " the chamber is left out, and the measured housing drives the gyro."
)


def fit_explained(problem: CardProblem, progress: Callable[[str], None]) -> tuple[CardFit, tuple[str, ...]]:
    """Find the most probable point; where there is none with the housing explained, that of the other responses, and say so."""
    found = fit(problem, progress=progress)
    others = [name for name in problem.responses if name != HOUSING]
    if found.converged or len(others) == len(problem.responses):
        return found, ()
    alone = fit(replace(problem, runs=tuple(run.explaining(others) for run in problem.runs)), progress=progress)
    return (alone, (APART,)) if alone.converged else (found, ())
