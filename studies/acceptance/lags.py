"""The resonator's temperature behind a thermometer: two lags in series, those with which the frequency follows it best."""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from studies.record.one_law import Course, parabola

LAGS = np.append(0.0, np.geomspace(30.0, 1e4, 16))
"""Lags (s) among which a pair is looked for first; 0: none."""
SHORTEST = 1.0
"""Lag (s) below which there is none."""
PARTS = 8
"""Parts of the rows that are left out one after another, to see how far the slope can be told."""
MOST = 2000
"""Averages of all runs, of which the lags are found."""


def find_lags(
    runs: Sequence[Course], keep: Array | None = None, near: Sequence[float] | None = None
) -> tuple[float, float]:
    """Return the two lags (s) behind which a parabola of the temperature leaves least of the frequency, from the rows kept."""
    f = np.concatenate([run.output for run in runs])
    keep = np.ones(f.size, dtype=bool) if keep is None else keep

    def left(lags: Sequence[float]) -> float:
        design = parabola(runs, lags)[keep]
        found = f[keep] - design @ np.linalg.lstsq(design, f[keep], rcond=None)[0]
        return float(found @ found)

    best = near or min(((one, other) for k, one in enumerate(LAGS) for other in LAGS[: k + 1]), key=left)
    start = np.log(np.maximum(best, 2 * SHORTEST))

    def left_of(own: Array) -> float:
        return left([float(one) for one in np.exp(own)])

    found = scipy.optimize.minimize(left_of, start, method="Nelder-Mead", options={"maxiter": 200, "xatol": 1e-3})
    one, other = np.exp(found.x) if found.fun < left(best) else best
    return float(one), float(other)


def slope_behind(runs: Sequence[Course]) -> tuple[tuple[float, float], list[tuple[float, float]], float, float]:
    """Return the lags (s), those without each of the parts of the runs, the slope of the frequency at the mean of the resonator's temperature, and its standard error.

    The error is the jackknife's over the parts, the lags found anew without each of them: what the lags leave is no noise.
    """
    f = np.concatenate([run.output for run in runs])

    def slope(lags: Sequence[float], keep: Array) -> float:
        design = parabola(runs, lags)
        return float(np.linalg.lstsq(design[keep], f[keep], rcond=None)[0][1])

    lags = find_lags(runs)
    part = np.arange(f.size) * PARTS // f.size
    kept = [part != one for one in range(PARTS)]
    without = [find_lags(runs, keep, lags) for keep in kept]
    error = jackknife([slope(own, keep) for own, keep in zip(without, kept, strict=True)])
    return lags, without, slope(lags, np.ones(f.size, dtype=bool)), float(error)


def jackknife(values: Sequence[ArrayLike]) -> Array:
    """Return the standard error of what was found without each of the parts, along the first axis."""
    return np.asarray(np.sqrt((len(values) - 1.0) * np.var(np.asarray(values), axis=0)))
