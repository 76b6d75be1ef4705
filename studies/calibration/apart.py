"""Records whose chamber does not explain their housing: the housing, which is measured, drives the resonator alone."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from studies.calibration.fit import CardFit, fit
from studies.calibration.observed import HOUSING
from studies.calibration.problem import CardProblem
from studies.diagnosis.verdict import FAR
from studies.simulation.variations import LAG

APART = (
    "The chamber's temperatures do not explain the housing's by the heat path of this card (a set point that the air follows late, or a probe far from the gyro, would not):"
    " the chamber is left out, and the measured housing drives the gyro."
)


def fit_explained(problem: CardProblem, progress: Callable[[str], None]) -> tuple[CardFit, tuple[str, ...]]:
    """Find the most probable point; where there is none with the housing explained, or only with a sensor so late that the gyro denies it, that of the other responses, and say so."""
    found = fit(problem, progress=progress)
    others = [name for name in problem.responses if name != HOUSING]
    if len(others) == len(problem.responses) or _is_sound(found):
        return found, ()
    alone = fit(replace(problem, runs=tuple(run.explaining(others) for run in problem.runs)), progress=progress)
    return (alone, (APART,)) if _is_sound(alone) else (found, ())


def _is_sound(found: CardFit) -> bool:
    """Whether it has converged with a sensor as late as the card says."""
    late = found.away[[name == LAG for name in found.problem.priors.names]]
    return found.converged and bool(np.all(np.abs(late) < FAR))
