"""The resonator's temperature behind a thermometer: two lags in series, those with which the frequency, or without it the bias, follows it best."""

from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from studies.record.one_law import Course, parabola

Pair = tuple[float, float]
Design = Callable[[Sequence[Course], Sequence[float]], Array]
LAGS = np.append(0.0, np.geomspace(30.0, 1e4, 16))
"""Lags (s) among which a pair is looked for first; 0: none."""
SHORTEST = 1.0
"""Lag (s) below which there is none."""
PARTS = 8
"""Parts of the rows that are left out one after another, to see how far the slope can be told."""
MOST = 2000
"""Averages of all runs, of which the lags are found."""


def find_lags(
    runs: Sequence[Course], design: Design = parabola, keep: Array | None = None, near: Sequence[float] | None = None
) -> Pair:
    """Return the two lags (s) behind which a design of the temperature leaves least of the output, from the rows kept."""

    def left(lags: Sequence[float]) -> float:
        return left_by(runs, design, lags, keep)

    best = near or min(((one, other) for k, one in enumerate(LAGS) for other in LAGS[: k + 1]), key=left)
    start = np.log(np.maximum(best, 2 * SHORTEST))

    def left_of(own: Array) -> float:
        return left([float(one) for one in np.exp(own)])

    found = scipy.optimize.minimize(left_of, start, method="Nelder-Mead", options={"maxiter": 200, "xatol": 1e-3})
    one, other = np.exp(found.x) if found.fun < left(best) else best
    return float(one), float(other)


def left_by(runs: Sequence[Course], design: Design, lags: Sequence[float], keep: Array | None = None) -> float:
    """Return the sum of squares that a design leaves of the output, of the rows kept."""
    kept = slice(None) if keep is None else keep
    X, y = design(runs, lags)[kept], np.concatenate([run.output for run in runs])[kept]
    found = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    return float(found @ found)


def lags_and_without(runs: Sequence[Course], design: Design = parabola) -> tuple[Pair, list[tuple[Array, Pair]]]:
    """Return the lags (s), and for each of the parts of the rows which are kept without it, and the lags that these tell."""
    lags, size = find_lags(runs, design), sum(run.output.size for run in runs)
    part = np.arange(size) * PARTS // size
    return lags, [(keep, find_lags(runs, design, keep, lags)) for keep in (part != one for one in range(PARTS))]


def slope_behind(runs: Sequence[Course]) -> tuple[Pair, list[Pair], float, float]:
    """Return the lags (s), those without each of the parts of the runs, the slope of the frequency at the mean of the resonator's temperature, and its standard error.

    The error is the jackknife's over the parts, the lags found anew without each of them: what the lags leave is no noise.
    """
    f = np.concatenate([run.output for run in runs])

    def slope(lags: Pair, keep: Array) -> float:
        design = parabola(runs, lags)
        return float(np.linalg.lstsq(design[keep], f[keep], rcond=None)[0][1])

    lags, without = lags_and_without(runs)
    error = jackknife([slope(own, keep) for keep, own in without])
    return lags, [own for _, own in without], slope(lags, np.ones(f.size, dtype=bool)), float(error)


def jackknife(values: Sequence[ArrayLike]) -> Array:
    """Return the standard error of what was found without each of the parts, along the first axis."""
    return np.asarray(np.sqrt((len(values) - 1.0) * np.var(np.asarray(values), axis=0)))
