"""Spikes: readings that their neighbours contradict."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

Array = NDArray[np.float64]
REACH = 3
NEIGHBOURS = 2 * REACH + 1
SPIKE = 8.0


def find_spikes(values: Array, least: float = 0.0) -> NDArray[np.bool_]:
    """Mark readings (m,) that stand out from their neighbours by more than 8 robust standard deviations.

    What the neighbours say is the median of (y_{i−k} + y_{i+k})/2, k = 1, 2, 3, which follows any straight trend; at the
    ends of the series that of 2 y_{i+k} − y_{i+2k}, looking inwards. The distance from it must exceed 8 times 1.4826 times
    the median distance of the whole series, and 8 times the distance that is usual next to the sample, so that bends, gaps
    and jumps are no spikes. Missing readings, NaN, are not marked, nor is anything in fewer than seven.

    Parameters
    ----------
    least : float
        Part of the series' span, spikes left out of it, by which a spike must stand out too: a smooth column has no noise
        to measure a spike by.
    """
    marked, rows = np.zeros(len(values), dtype=bool), np.flatnonzero(np.isfinite(values))
    if len(rows) < NEIGHBOURS:
        return marked
    known = values[rows]
    marked[rows] = _stand_out(known)
    if least:
        smooth = median_filter(known, NEIGHBOURS, mode="mirror")
        marked[rows] &= np.abs(known - smooth) > least * np.ptp(smooth)
    return marked


def _stand_out(values: Array) -> NDArray[np.bool_]:
    distance = np.abs(values - _expect(values))
    # A straight ramp is left with the rounding of its own arithmetic, which is no spread.
    distance[distance < 64 * np.finfo(float).eps * np.max(np.abs(values))] = 0.0
    padded = np.pad(distance, REACH, mode="reflect")
    nearby = _middle(*(np.maximum(padded[REACH - k : -REACH - k], _shifted(padded, k)) for k in (1, 2, 3)))
    positive = distance[distance > 0]
    # Rounded readings may have no spread at all: then the smallest distance takes its place.
    spread = max(1.4826 * float(np.median(distance)), float(positive.min()) if positive.size else 1.0)
    return np.asarray(distance > SPIKE * np.maximum(spread, nearby))


def _expect(values: Array) -> Array:
    """Return what the neighbours of every sample say that it should be."""
    padded = np.pad(values, REACH, mode="reflect", reflect_type="odd")
    expected = _middle(*((padded[REACH - k : -REACH - k] + _shifted(padded, k)) / 2 for k in (1, 2, 3)))
    if values.size > 3 * REACH:
        for series, ends in ((values, expected), (values[::-1], expected[::-1])):  # views: written through
            inward = (2 * series[k : REACH + k] - series[2 * k : REACH + 2 * k] for k in (1, 2, 3))
            ends[:REACH] = _middle(*inward)
    return expected


def _shifted(padded: Array, k: int) -> Array:
    return padded[REACH + k : padded.size - REACH + k]


def _middle(low: Array, middle: Array, high: Array) -> Array:
    """Return the median of three arrays, entry by entry."""
    return np.asarray(np.maximum(np.minimum(low, middle), np.minimum(np.maximum(low, middle), high)))
