"""What the chamber says of a card: the housing it drives, its starts integrated out by the triangle of [J_start J_values r; 1 0 0]."""

from dataclasses import replace

import numpy as np

from studies.calibration.fit import CardFit
from studies.calibration.observed import HOUSING, RESPONSES
from studies.calibration.problem import State
from studies.inference.background import Background
from studies.inference.linear import Linear


def set_housing_apart(found: CardFit) -> CardFit:
    """Return the calibration of the other responses with what the housing's rows tell of its coordinates."""
    whole = found.problem
    problem = replace(whole, runs=tuple(run.explaining(RESPONSES) for run in whole.runs))
    if HOUSING not in whole.responses:
        return replace(found, problem=problem)
    count = len(whole.priors.values)
    at = {
        (whole.parts[k].run, name): count + i
        for i, (k, name, _) in enumerate(whole.starts)
        if whole.parts[k].name == "inner"
    }
    places = [*range(count), *(at[problem.parts[k].run, name] for k, name, _ in problem.starts)]
    others = np.setdiff1d(np.arange(whole.count), places)
    state = found.state
    J, r = state.slope[HOUSING], state.residual[HOUSING] + state.slope[HOUSING] @ state.point
    white = found.rows[HOUSING].whiten(np.column_stack([J[:, others], J[:, :count], r]), found.noise[HOUSING])
    triangle = np.linalg.qr(np.vstack([np.eye(len(others), white.shape[1]), white])).R
    own = triangle[len(others) : len(others) + count, len(others) :]
    told = np.column_stack([own[:, :count], np.zeros((len(own), len(places) - count)), own[:, -1]])
    names = problem.responses
    inner = State(
        state.point[places], {n: state.residual[n] for n in names}, {n: state.slope[n][:, places] for n in names}
    )
    return replace(
        found,
        problem=problem,
        state=inner,
        noise={n: found.noise[n] for n in names},
        rows={n: found.rows[n] for n in names},
        covariance=found.covariance[np.ix_(places, places)],
        told=told,
    )


def evidence_of(found: CardFit) -> float:
    """Log evidence of a calibrated card, its outliers being what stands out of it."""
    return Background(Linear.of(found), (), found.noise).fair
