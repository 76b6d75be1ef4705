"""What is sharp in time and in no smooth form: brief events, oscillations that come and go, lines faster than the blocks."""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.lines import Line, find_line

RESOLVED = 2.5
"""Blocks to a period of a line that they resolve."""
MOST_RESOLVED = 700
"""Blocks of a run up to which they may be finer for such a line: their noise costs their third power."""
LEAST_LINE = 0.1
"""Size of a line over the noise from which on it counts: without it the noise is less by 0.5 %."""


def longest_resolved(period: float) -> float:
    """Return the length of a record, s, whose blocks resolve a line."""
    return MOST_RESOLVED * period / RESOLVED


def fast_line(series: Sequence[tuple[Array, Array]], sampling: float, step: float, noise: float) -> Line | None:
    """Return the largest line that is too fast for steps of a grid, of readings or of what a model leaves of them."""
    line = find_line(series, sampling, RESOLVED * step)
    return line if line is not None and line.rms > LEAST_LINE * noise else None


def intermittent(runs: Sequence[Array]) -> float:
    """Return the log evidence of oscillations that come, go or wander: a mixture of powers against one exponential law of noise."""
    best = 0.0
    for length in CELLS:
        cells = []
        for rows in runs:
            blocks = rows[: rows.size // length * length].reshape(-1, length)
            power = np.abs(np.fft.rfft(blocks, axis=1)[:, 1:-1]) ** 2
            cells.append(power / max(float(power.mean()), 1e-300) if power.size else power)
        table = np.concatenate(cells)
        if table.shape[0] < FEWEST_CELLS:
            continue
        power = table / np.clip(table.mean(axis=0), 1.0 / UNEVEN, UNEVEN)
        for part in (0.01, 0.03, 0.1):
            for strong in (3.0, 6.0, 12.0):
                weak = max((1.0 - part * strong) / (1.0 - part), 0.3)
                mixed = (1 - part) / weak * np.exp(-power / weak) + part / strong * np.exp(-power / strong)
                best = max(best, float(np.sum(np.log(mixed + 1e-300) + power)))
    return best - 3.0


def loudness(rows: Array) -> Array:
    """Return the variance of noise about each row over that of all, from differences of `NEAR` neighbours: noise may be louder for a while."""
    change = np.pad(np.diff(rows) ** 2, (NEAR // 2, NEAR - NEAR // 2), "edge")
    return np.asarray(
        np.convolve(change, np.ones(NEAR), "valid")[: len(rows)] / NEAR / max(float(np.mean(change)), 1e-300)
    )


NEAR = 25
"""Differences beside a row that say how loud noise is there."""
CELLS = (8, 16, 32, 64, 128)
"""Rows to a short periodogram."""
FEWEST_CELLS = 6
"""Of each length at least so many: of fewer the mean is no measure."""
UNEVEN = 2.5
"""Factor by which the spectrum of noise may differ from that of the kinds of wander."""


def switching(runs: Sequence[Array]) -> tuple[Array, float] | None:
    """Return rows that switch between two levels, ±½, and ln p of their switches (random telegraph noise); None where there are no two levels.

    The likeliest path (Viterbi) for levels, an offset of each run, white noise and a chance to switch that are those of the path itself.
    """
    runs = [own - own.mean() for own in runs]
    rows = np.concatenate(runs)
    levels: Array = np.percentile(rows, (20.0, 80.0))
    chance, variance = 0.05, float(np.var(rows)) / 4.0
    for _ in range(SWITCHINGS):
        paths = [_likeliest(own, levels, variance, chance) for own in runs]
        path = np.concatenate(paths)
        if not 0 < path.sum() < path.size:
            return None
        runs = [own - np.mean(own - levels[on.astype(int)]) for own, on in zip(runs, paths, strict=True)]
        rows = np.concatenate(runs)
        levels = np.array([rows[~path].mean(), rows[path].mean()])
        variance = float(np.mean((rows - levels[path.astype(int)]) ** 2))
        switches = sum(int(np.sum(own[1:] != own[:-1])) for own in paths)
        chance = (switches + 1.0) / (rows.size + 2.0)
    if levels[1] - levels[0] < APART * variance**0.5:
        return None
    stays = rows.size - len(runs) - switches
    return np.asarray(path - 0.5), float(
        switches * np.log(chance) + stays * np.log1p(-chance) - len(runs) * np.log(2.0)
    )


def _likeliest(rows: Array, levels: Array, variance: float, chance: float) -> NDArray[np.bool_]:
    """Which of the rows of a run are on the second level."""
    cost = (rows[:, None] - levels) ** 2 / (2.0 * variance)
    dear, cheap = -float(np.log(chance)), -float(np.log1p(-chance))
    from_other = np.zeros(cost.shape, dtype=bool)
    a, b = cost[0].tolist()
    for k, (first, second) in enumerate(cost[1:].tolist(), 1):
        from_other[k] = b + dear < a + cheap, a + dear < b + cheap
        a, b = min(a + cheap, b + dear) + first, min(b + cheap, a + dear) + second
    path = np.empty(len(rows), dtype=bool)
    path[-1] = b < a
    for k in range(len(rows) - 1, 0, -1):
        path[k - 1] = path[k] ^ from_other[k, int(path[k])]
    return path


SWITCHINGS, APART = 12, 1.5
"""Rounds in which the levels are found; least distance of the levels, over what is left about them."""


def brief_events(rows: Array, heaviest: float) -> float:
    """Return the log evidence of brief events: two normal laws about 0 against Student's t of tails no heavier than given, by the BIC."""
    square = rows**2 / max(float(np.mean(rows**2)), 1e-300)
    best = -np.inf
    for part in (0.02, 0.1, 0.3):
        narrow, wide = 0.5, 4.0
        for _ in range(40):
            laws = [(1.0 - part) * _normal(square, narrow), part * _normal(square, wide)]
            total = laws[0] + laws[1] + 1e-300
            belongs = laws[1] / total
            part = float(np.clip(belongs.mean(), 0.5 / rows.size, 0.5))
            narrow = max(float((1.0 - belongs) @ square / max(np.sum(1.0 - belongs), 1e-9)), 1e-3)
            wide = max(float(belongs @ square / max(belongs.sum(), 1e-9)), narrow)
        best = max(best, float(np.sum(np.log(total))))
    best -= max(student_log(square, freedom) for freedom in (heaviest, 2.0 * heaviest, 1e3))
    return best - float(np.log(rows.size))


def recurring(runs: Sequence[Array]) -> float:
    """Return the log evidence that rows that stand out (±1 by their sign, others 0) are events that recur: of one sign, side by side, several times.

    Of n among N rows the next one stands out too with a chance of n/N where each fails for itself, else with any chance.
    """
    best, count = -np.inf, sum(run.size for run in runs)
    for sign in (1.0, -1.0):
        rows = [np.concatenate([[False], run == sign, [False]]) for run in runs]
        out = sum(int(own.sum()) for own in rows)
        beside = sum(int(np.sum(own[1:] & own[:-1])) for own in rows)
        groups = sum(int(np.sum(own[2:] & own[1:-1] & ~own[:-2])) for own in rows)  # where two or more begin
        if groups >= FEWEST_EVENTS:
            alone, chance = out - beside, out / count
            even = beside * np.log(chance) + alone * np.log1p(-chance)
            best = max(best, float(scipy.special.betaln(beside + 1, alone + 1) - even))
    return best


FEWEST_EVENTS = 4
"""Groups of outliers of one sign: fewer are bursts of bad readings."""


def _normal(square: Array, variance: float) -> Array:
    return np.asarray(np.exp(-0.5 * square / variance) / np.sqrt(2.0 * np.pi * variance))


def student_log(square: Array, freedom: float) -> float:
    """Return the log likelihood of Student's law at its likeliest scale, from squares."""
    scale = max(float(np.mean(square)), 1e-300)
    for _ in range(30):
        scale = float(np.mean((freedom + 1.0) * square / (freedom + square / scale)))
    norm = (
        scipy.special.gammaln((freedom + 1.0) / 2.0)
        - scipy.special.gammaln(freedom / 2.0)
        - 0.5 * np.log(np.pi * freedom * scale)
    )
    return float(square.size * norm - (freedom + 1.0) / 2.0 * np.log1p(square / (freedom * scale)).sum())


def tails_of(values: Array) -> float:
    """Return the likeliest degrees of freedom of Student's law for a sample about 0."""
    square = values[values != 0.0] ** 2
    return max(TAILS, key=lambda freedom: student_log(square, freedom)) if square.size else TAILS[-1]


TAILS = (3.0, 4.0, 6.0, 9.0, 15.0, 30.0, 1e3)
