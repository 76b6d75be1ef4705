"""Where a series moves at once: lines on either side of a step, against a bend."""

from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.samples import robust_spread
from studies.record.rest import LEAST_SPIKE

SIDE = 25  # means on either side of a step, through which straight lines go
SCALES = (1, 8, 64)  # rows whose means are looked at for steps
STANDS_OUT = 8.0  # robust standard deviations of what two such lines differ by elsewhere
EVIDENCE = 35.0  # twice the logarithm of the likelihood by which a step exceeds a bend
AT_ONCE = 0.6  # of a step, within two rows of it
CANDIDATES = 2000  # places where a step is looked for, the likeliest first


@dataclass(frozen=True)
class Step:
    """A column that moves at once: when (s), and by how much."""

    time: float
    size: float


def find_steps(time: Array, values: Array) -> tuple[Step, ...]:
    """Return where a series moves at once, in rows and means of 8 and 64: lines of 25 means on either side, by 8 robust sd."""
    spacing = float(np.median(np.diff(time)))
    count = round(float(time[-1] - time[0]) / spacing) + 1
    if len(time) < count <= 2 * len(time):  # a line across rows that are missing, where a slope is no step
        even = time[0] + spacing * np.arange(count)
        time, values = even, np.interp(even, time, values)
    found: list[Step] = []
    for rows in SCALES:
        y = values[: len(values) // rows * rows].reshape(-1, rows).mean(axis=1)
        for place, size in _candidates(y):
            at = (place + SIDE) * rows
            if abs(size) < LEAST_SPIKE * np.ptp(values) or (edge := _find_edge(values, at, rows)) is None:
                continue
            when, reach = float(time[edge - 1 : edge + 1].mean()), abs(time[at] - time[at - SIDE * rows])
            if all(abs(when - old.time) > reach for old in found):
                found.append(Step(when, size))
    return tuple(sorted(found, key=lambda step: step.time))


def _candidates(values: Array) -> list[tuple[int, float]]:
    """Return places (rows before the last one of the left line) and sizes D where a series may step, the likeliest first."""
    n = SIDE
    if len(values) < 4 * n:
        return []
    place = np.arange(n) - 0.5 * (n - 1)
    # weights of n rows for the value half a row before the first
    ahead = 1 / n - place * 0.5 * n / float(place @ place)
    D = np.correlate(values, ahead, mode="valid")[n:] - np.correlate(values, ahead[::-1], mode="valid")[:-n]
    near = np.correlate(values, np.r_[-np.ones(3), np.ones(3)] / 3, mode="valid")[n - 3 : n - 3 + len(D)]
    spread = max(robust_spread(D), 1e-9 * float(np.ptp(values)))
    found: list[int] = []
    for k in map(int, np.argsort(-np.abs(D))[:CANDIDATES]):
        if abs(D[k]) <= STANDS_OUT * spread:
            break
        if near[k] / D[k] > AT_ONCE and all(abs(k - other) > n for other in found):
            found.append(k)
    return [(k, float(D[k])) for k in found]


def _find_edge(values: Array, at: int, rows: int) -> int | None:
    """Return the first row after a step near a row; None where a bend explains the rows as well."""
    begin, end = max(at - SIDE * rows, 0), min(at + SIDE * rows, len(values))
    y, x = values[begin:end], np.linspace(-1, 1, end - begin)
    Q = np.linalg.qr(np.stack([np.ones_like(x), x, x**2], axis=1))[0]
    rest = y - Q @ (Q.T @ y)

    def explained(columns: Array) -> Array:
        columns = columns - Q @ (Q.T @ columns)
        return np.asarray((rest @ columns) ** 2 / np.maximum(np.sum(columns**2, axis=0), 1e-12))

    edges = np.arange(max(at - 2 * rows, begin + 3), min(at + 2 * rows + 1, end - 3))
    of_steps = explained(np.asarray(np.arange(begin, end)[:, None] >= edges, dtype=float))
    low, high, bend = -1.0, 1.0, 0.0
    for _ in range(3):
        places = np.linspace(low, high, 60)
        of_bends = explained(np.maximum(x[:, None] - places, 0))
        best, width = float(places[np.argmax(of_bends)]), (high - low) / 59
        low, high, bend = best - width, best + width, max(bend, float(of_bends.max()))
    least = len(y) * (1e-9 * float(np.ptp(values))) ** 2
    left = [max(float(rest @ rest) - one, least) for one in (bend, float(of_steps.max()))]
    return int(edges[np.argmax(of_steps)]) if len(y) * np.log(left[0] / left[1]) > EVIDENCE else None
