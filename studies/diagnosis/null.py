"""How large a gain chance alone gives: the null levels of every effect, from a parametric bootstrap.

The best of many signatures gains something on pure noise. For each effect, draws of the fitted null (baseline and
coloured noise of this campaign) give the distribution of its best gain. In the tail P(gain > z) = N exp(−z/2), N the
number of independent looks; the level is 2 ln N, and a gain net of it reads as if there had been one look.
"""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.baseline import Problem
from studies.diagnosis.likelihood import KERNELS, fit_linear
from studies.diagnosis.scan import Bank, scan_bank
from studies.diagnosis.states import FloatArray

TAIL = 0.12

SHIPPED: dict[str, float] = {
    "activity-dip": 8.0,
    "ageing": 5.0,
    "amplitude-frequency": 2.0,
    "axis-rotation": 5.0,
    "clock-drift": 2.0,
    "cross-damping": 2.5,
    "curvature": 2.5,
    "electrostatic-softening": 2.0,
    "hysteresis": 6.0,
    "jump": 15.0,
    "leak": 2.0,
    "loss-peak": 5.0,
    "mounting-stress": 4.0,
    "periodic": 15.0,
    "quadrature-leakage": 2.5,
    "radiation": 2.0,
    "rate-bias": 2.5,
    "second-lag": 3.5,
    "self-heating": 2.0,
    "thermometer-scale": 2.5,
}


def draw_null(problem: Problem, model: FloatArray, draws: int, rng: np.random.Generator) -> FloatArray:
    """Draw rotated data of the fitted null: the model contributes nothing that the scan does not project away."""
    fit = fit_linear(problem.basis, problem.rotated, model)
    spread = np.sqrt(fit.variance * (1.0 + fit.share * problem.basis.walk))
    return np.asarray(spread[:, None] * rng.standard_normal((problem.values.size, draws)))


def bootstrap_levels(
    problem: Problem, bank: Bank, models: Sequence[FloatArray], draws: int, rng: np.random.Generator
) -> dict[str, float]:
    """Return 2 ln N of every effect from draws of this campaign's null.

    Parameters
    ----------
    problem : Problem
        With the kind of noise that suits the null best.
    bank, models
        As for `scan_bank`.
    draws : int
        Number of draws.
    rng : numpy Generator
        Seeded by the caller.
    """
    drawn = problem.basis.unrotate(draw_null(problem, models[KERNELS.index(problem.kernel)], draws, rng))
    gains, _, _, _ = scan_bank(bank, models, [other.basis.rotate(drawn) for other in bank.problems])
    return dict(zip(bank.dictionaries[0].effects, levels_of(gains), strict=True))


def levels_of(gains: FloatArray) -> FloatArray:
    """Return the level of each row of gains: the tail quantile less that of one look, −2 ln p."""
    return np.asarray(np.quantile(gains, 1.0 - TAIL, axis=1) + 2.0 * np.log(TAIL))


def shipped_levels(effects: Sequence[str]) -> dict[str, float]:
    """Return conservative levels measured on campaigns of one to eight runs; see tests/benchmarks."""
    return {name: SHIPPED.get(name, 8.0) for name in effects}
