"""Spikes: readings that disagree with their neighbours."""

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.samples import robust_spread

REACH = 3
NEIGHBOURS = 2 * REACH + 1
SPIKE, ALONE = 6.0, 4.0
JUDGED = 16  # third differences beside readings that stay to an end
TURNS, STEPS = 4, 5.0  # of their sign, and of the readings, from which on those are noise
ROUGH, SCATTERED = 2.5, 0.25
"""Second difference in steps that rounding alone does not make (0, 1, 0 makes 2), and the part of them that noise has."""
STUCK = 20  # readings in a row that are alike, where those beside them mostly differ, make a sensor that is stuck


def find_spikes(values: Array, least: float = 0.0) -> NDArray[np.bool_]:
    """Mark readings (m,) that stand out from their neighbours by more than 6 robust standard deviations.

    Neighbours say the median of (y_{i−k} + y_{i+k})/2, k = 1, 2, 3; at the ends that of 2 y_{i+k} − y_{i+2k}, whose
    distance counts half. The distance must exceed 6 · 1.4826 times the series' median, be the largest within two rows,
    and 4 times what is usual beside it. What is left is searched again. `least` is a part of the span that
    a spike exceeds too.
    """
    marked, rows = np.zeros(len(values), dtype=bool), np.flatnonzero(np.isfinite(values))
    if len(rows) < NEIGHBOURS:
        return marked
    known = values[rows]
    marked[rows] = _stand_out(known)
    if least and marked.any():
        around = np.lib.stride_tricks.sliding_window_view(np.pad(known, REACH, "reflect"), NEIGHBOURS)
        smooth = np.partition(around, REACH, axis=1)[:, REACH]  # `scipy.ndimage` has it too, and takes 0.1 s to load
        marked[rows] &= np.abs(known - smooth) > least * np.ptp(smooth)
    return marked


def find_step(readings: Array) -> float:
    """Return the smallest difference of readings (m,): what they were rounded to, if they were; 0 where all are alike."""
    apart = np.diff(np.unique(readings[np.isfinite(readings)]))
    return float(apart.min()) if apart.size else 0.0


def find_stuck(values: Array) -> NDArray[np.bool_]:
    """Mark readings (m,) of a stuck sensor: `STUCK` or more alike, beside which the readings on either side scatter by more than their rounding, or that noise leads to at an end."""
    marked, rows = find_stuck_at_ends(values), np.flatnonzero(np.isfinite(values))
    if len(rows) < 3 * STUCK:
        return marked
    known = values[rows]
    least = ROUGH * find_step(known)
    starts, ends = _alike(known)
    for begin, end in zip(starts.tolist(), ends.tolist(), strict=True):
        bends = (np.diff(known[max(begin - STUCK, 0) : begin], 2), np.diff(known[end : end + STUCK], 2))
        if all(own.size and np.mean(np.abs(own) > least) >= SCATTERED for own in bends):
            marked[rows[begin:end]] = True
    return marked


def find_stuck_at_ends(values: Array) -> NDArray[np.bool_]:
    """Mark readings (m,) alike, `STUCK` or more, from the first on or up to the last, beside which the others have noise: what settles has none, or goes on with it."""
    marked, rows = np.zeros(len(values), dtype=bool), np.flatnonzero(np.isfinite(values))
    if len(rows) < 2 * STUCK:
        return marked
    known = values[rows]
    starts, ends = _alike(known)
    for begin, end in zip(starts.tolist(), ends.tolist(), strict=True):
        others = known[end:] if begin == 0 else known[:begin][::-1]
        if (begin == 0) != (end == len(rows)) and _is_noisy(others[: JUDGED + 3], find_step(known)):
            marked[rows[begin:end]] = True
    return marked


def _alike(known: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where `STUCK` or more readings in a row that are alike begin, and where they end."""
    starts = np.flatnonzero(np.diff(known, prepend=np.nan) != 0)
    ends = np.append(starts[1:], len(known))
    long = ends - starts >= STUCK
    return starts[long], ends[long]


def _is_noisy(beside: Array, step: float) -> bool:
    """Whether third differences are far above the rounding and turn their sign, as those of a bend do not."""
    third = np.diff(beside, 3)
    turns = np.count_nonzero(third[1:] * third[:-1] < 0)
    return bool(third.size == JUDGED and turns >= TURNS and np.median(np.abs(third)) >= STEPS * step)


def find_dropouts(values: Array) -> NDArray[np.bool_]:
    """Mark readings (m,) of exactly 0 that lie farther from the range of the others than half that range."""
    others = values[np.isfinite(values) & (values != 0)]
    if not others.size or others.size == np.count_nonzero(np.isfinite(values)):
        return np.zeros(len(values), dtype=bool)
    low, high = np.percentile(others, [1, 99])
    room = 0.5 * (high - low)
    return np.asarray((values == 0) & bool(low - room > 0 or high + room < 0))


def _stand_out(values: Array) -> NDArray[np.bool_]:
    left = values.copy()
    distance = _distance(left)
    positive = distance[distance > 0]
    # Rounded readings may have no spread at all: then the smallest distance takes its place.
    spread = max(robust_spread(distance), float(positive.min()) if positive.size else 1.0)
    while True:
        around = np.pad(distance, REACH)
        peak = distance >= np.fmax.reduce([_shifted(around, k) for k in (-2, -1, 1, 2)])
        candidates = np.flatnonzero(peak & (distance > SPIKE * spread))
        if not candidates.size:
            return np.isnan(left)
        without = left.copy()
        without[candidates] = np.nan
        around = np.pad(_distance(without), REACH, mode="reflect")
        nearby = _median([np.fmax(_shifted(around, -k), _shifted(around, k)) for k in (1, 2, 3)])[candidates]
        found = candidates[distance[candidates] > ALONE * nearby]
        if not found.size:
            return np.isnan(left)
        left[found] = np.nan
        distance = _distance(left)


def _distance(values: Array) -> Array:
    """Return how far every sample is from what its neighbours say; NaN where it or they are missing."""
    padded = np.pad(values, REACH, mode="reflect", reflect_type="odd")
    expected = _median([(_shifted(padded, -k) + _shifted(padded, k)) / 2 for k in (1, 2, 3)])
    distance = np.abs(values - expected)
    if values.size > 3 * REACH:
        near = min(4 * REACH, values.size - 2 * REACH)  # rows that the bend of an end may reach
        for series, end in ((values, distance), (values[::-1], distance[::-1])):  # views: written through
            inwards = _median([2 * series[k : near + k] - series[2 * k : near + 2 * k] for k in (1, 2, 3)])
            own, beside = series[:near], series[1 : near + 1]
            off = np.abs(own - np.clip(own, np.fmin(inwards, beside), np.fmax(inwards, beside)))
            # y_i − 2 y_{i+k} + y_{i+2k} has twice the bend and the noise of y_i − (y_{i−k} + y_{i+k})/2
            half = np.fmin(np.abs(own - inwards) / 2, off)
            end[:REACH] = half[:REACH]
            end[REACH:near] = np.fmin(end[REACH:near], half[REACH:])
    # A straight ramp is left with the rounding of its own arithmetic, which is no spread.
    distance[distance < 64 * np.finfo(float).eps * np.nanmax(np.abs(values))] = 0.0
    return distance


def _shifted(padded: Array, k: int) -> Array:
    return padded[REACH + k : padded.size - REACH + k]


def _median(of: list[Array]) -> Array:
    """Return the median of three arrays, entry by entry, missing ones left out."""
    a, b, c = of
    median = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))  # NaN where one is missing
    some = np.isnan(median)
    low, middle, _ = np.sort([own[some] for own in of], axis=0)  # NaN last
    median[some] = np.where(np.isnan(middle), low, (low + middle) / 2)
    return np.asarray(median)
