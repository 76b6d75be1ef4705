"""The law of a bell's raw output over rate, temperature and its course, from the means of every hold."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from compensation.arrays import Array
from compensation.bell import Warming
from compensation.bell_calibration import BellRun
from compensation.linearity import same_rate
from compensation.rate_law import RateLaw, fit_rate_law

SWEPT = 5.0  # span of temperature (K) from which a run counts as one over temperature
BLOCKS = 5
TURN = 0.05  # K by which a temperature at least goes back before it turns
SPANS = 40  # means of a hold that show how far its temperature went


def warming_of(law: RateLaw | None, runs: Sequence[BellRun]) -> Warming | None:
    """Return what the law says of warming and cooling; noise of the thermometers does not turn it."""
    if law is None or "warming" not in law.chosen.over:
        return None
    v = law.chosen.values
    noise = max(float(np.std(np.diff(run.temperature, 2))) / 6**0.5 for run in runs)
    return Warming(v["a"], v["a_warming"], v["k_warming"] / v["k"], max(TURN, 8 * noise))


def without_warming(warming: Warming, run: BellRun) -> BellRun:
    """A run that sweeps the temperature without it; at one temperature there is no course."""
    swept = float(np.ptp(run.temperature)) > SWEPT
    return replace(run, output=warming.undo(run.output, run.temperature)) if swept else run


def read_law(runs: Sequence[BellRun]) -> RateLaw | None:
    """Return the law of the raw output over rate (°/s) and temperature, from the mean of every hold within a kelvin.

    It warms or cools as the temperature moves in it, or last moved before it: settled ones, too, are reached from below or above.
    """
    rate, output, temperature, scatter, warming = ([np.zeros(0)] for _ in range(5))
    for run in runs:
        sweeps = float(np.ptp(run.temperature)) > SWEPT
        holds = []
        for hold in np.split(np.arange(run.time.size), np.flatnonzero(np.diff(same_rate(run.rate))) + 1):
            course = [run.temperature[part].mean() for part in np.array_split(hold, min(len(hold), SPANS))]
            holds += np.array_split(hold, 1 + int(np.ptp(course)) if sweeps else 1)
        fifths = [rows[: len(rows) // BLOCKS * BLOCKS].reshape(BLOCKS, -1) for rows in holds if len(rows) >= 4 * BLOCKS]
        if not fifths:
            continue
        y, T = (np.array([x[rows].mean(axis=1) for rows in fifths]) for x in (run.output, run.temperature))
        rate.append(np.array([run.rate[rows].mean() for rows in fifths]))
        output.append(y.mean(axis=1))
        temperature.append(T.mean(axis=1))
        scatter.append(_off_line(y))
        warming.append(_directions(T) * sweeps)
    level, middle, squares = (np.concatenate(one) for one in (rate, output, scatter))
    if not level.size:
        return None
    error = np.sqrt(np.mean(squares) / BLOCKS) * np.ones(level.size)  # one error of all, of many fifths
    return fit_rate_law(level, middle, error, np.concatenate(temperature), np.concatenate(warming))


def _off_line(values: Array, degree: int = 1) -> Array:
    """Variance of the means of each row (holds, blocks) about the line, or parabola, through them."""
    x, P = np.arange(BLOCKS), np.polynomial.polynomial
    rest = values - P.polyval(x, P.polyfit(x, values.T, degree))
    return np.asarray(np.sum(rest**2, axis=1) / (BLOCKS - 1 - degree))


def _directions(T: Array) -> Array:
    """Course of the temperature in holds (holds, blocks): 1 where it rises or last rose, −1, between them where it turns.

    It moves, and turns, by six times the scatter of the means of blocks.
    """
    least, last, way = 6 * float(np.sqrt(np.mean(_off_line(T, 2)))), float(T[0].mean()), 0.0
    found: list[float] = []
    for one in T:
        low, high = sorted(one[[0, -1]])
        moved = next((by for by in (one[-1] - one[0], one.mean() - last) if abs(by) > least), 0.0)
        way, last = (float(np.sign(moved)), float(one.mean())) if moved else (way, last)
        turns = max(one.max() - high, low - one.min()) > least
        found.append(float(np.mean(np.sign(np.diff(one)))) if turns else way)
    begin = next((one for one in found if one), 0.0)  # before the first move as after it
    return np.where(np.cumsum(np.abs(found)) == 0, begin, found)
