"""How far the level of a further run may lie from what the card says: runs of one device differ from turn-on to turn-on.

A few runs tell the spread s of their levels poorly, and not at all where it is below the noise σ of such a level. With the weights that
their likelihood and ds/√(s² + σ²) give it, unless the card states it, the level of a further run is a mixture of normal laws; stated is the
standard deviation of one normal law that holds as much of it in 1.96 of them, as Student's t is that of a few equal runs. That every decade
is as likely beforehand, also below σ, once denied levels of σ to 3 σ whenever a few runs agree by chance: of stated 95 %, 77 to 88 came.
"""

from dataclasses import replace

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import Noise
from compensation.noise_estimate import LEAST, MOST, STATED_SPREAD
from compensation.noise_rows import NoiseRows
from studies.calibration.ahead import BIAS
from studies.calibration.fit import CardFit, covariance_at, fit
from studies.calibration.ladder import usual_mean
from studies.calibration.noise_levels import beside_others, has_levels, stated_noise

STEPS = 31  # of ln s
NINETY_FIVE = 1.959963984540054
LEVELS = {"frequency_Hz": "frequency_level_Hz", "bias_deg_per_h": "bias_level_deg_per_h"}
"""The key of `[posterior]` for the level of a further run."""


def without_idle_levels(found: CardFit) -> CardFit:
    """Return a fit whose runs have levels of their own of the frequency only where these stand out of what else the noise makes of a mean."""
    own = found.noise.get("frequency_Hz", Noise())
    if not own.offset or own.offset > usual_mean(found, "frequency_Hz"):
        return found
    return replace(fit(replace(found.problem, levels=False), found.point), problem=found.problem)


def with_level_spread(found: CardFit) -> CardFit:
    """Return a fit whose levels of runs have that spread, with what is then known of the values."""
    noise = {name: replace(own, offset=_level_spread(found, name)) for name, own in found.noise.items()}
    return replace(found, noise=noise, covariance=covariance_at(found.problem, found.state, noise, found.rows))


def _level_spread(found: CardFit, name: str) -> float:
    """Return the standard deviation that a prediction of a response should have for the level of its run; 0 where one run shows none."""
    rows = found.rows[name]
    if len(rows.times) < 2 or not has_levels(found.problem, name):
        return 0.0
    noise, problem = found.noise, found.problem
    target = {one: found.state.residual[one] + found.state.slope[one] @ found.point for one in problem.responses}
    left, columns = beside_others(problem, found.rows, target, found.state.slope, noise, name)
    stated = stated_noise(problem.instrument.noise, name)
    means = rows.means(left), rows.means(columns)
    return level_of_further_run(rows.coarse, *means, noise[name], 0.0 if stated is None else stated.offset)


def level_of_further_run(rows: NoiseRows, target: Array, columns: Array, noise: Noise, stated: float = 0.0) -> float:
    """Return the standard deviation to state of a further run's level, from residuals (M,) of runs beside columns (M, p) of unit prior."""
    levels = noise.white / rows.span**0.5 * np.exp(np.linspace(LEAST, MOST, STEPS))
    seen = np.linalg.norm(rows.whiten(np.ones(rows.count), replace(noise, offset=0.0)))  # √(runs)/σ
    logs = -0.5 * np.log1p(len(rows.times) / (seen * levels) ** 2)
    if stated:
        logs = -0.5 * (np.log(levels / stated) / STATED_SPREAD) ** 2
    for k, level in enumerate(levels):
        own = replace(noise, offset=float(level))
        logs[k] -= 0.5 * rows.likelihood(target, columns, np.ones(columns.shape[1]), own)
    weights = np.exp(logs - scipy.special.logsumexp(logs))

    def beyond(sd: float) -> float:
        return float(weights @ scipy.special.erf(NINETY_FIVE * sd / levels / 2**0.5)) - 0.95

    return float(scipy.optimize.brentq(beyond, levels[0] / 2, levels[-1]))


def turn_on(found: CardFit) -> dict[str, float]:
    """What the runs show of the bias from turn-on to turn-on, where that is more than the noise within them makes of a mean."""
    if BIAS not in found.noise or len(found.problem.rows[BIAS].times) < 2:
        return {}
    offset = found.noise[BIAS].offset
    stated = found.problem.instrument.noise.bias_turn_on_deg_per_h > 0
    return {"noise.bias_turn_on_deg_per_h": offset} if stated or offset > usual_mean(found, BIAS) else {}
