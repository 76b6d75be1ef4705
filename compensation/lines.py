"""Lines: one period that stands out of the spectrum of several series."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.noise import white_rms
from compensation.samples import robust_spread
from compensation.spikes import find_step

AROUND = 101
"""Frequencies about each whose median power is the level of the noise there; a series with fewer rows has no spectrum."""
LEVEL = 24.0
"""Degrees of freedom of that median: every other frequency is independent, and a median knows (ln 2)² of what a mean would."""
CYCLES = 8.0  # periods in the longest series that make a line
TALLEST = 4.0  # distance from the mean, in robust standard deviations, beyond which a reading belongs to no line
FAR = 200.0
"""Beyond this and three times its order a gamma law counts by its leading term: it leaves the range of numbers."""
FASTEST = 2.5  # rows to a period: what is faster may be folded, and the law of a power is another one at two rows


@dataclass(frozen=True)
class Line:
    """A line."""

    period: float  # in s
    evidence: float  # minus the log of the probability that noise has one as strong among all that were looked at
    rms: float  # its size in the series where it is the largest


def find_line(
    series: Sequence[tuple[Array, Array]], sampling: float, slowest: float, least: float = 12.0
) -> Line | None:
    """Return the largest line with a period from `FASTEST` rows to `slowest`, s, of series (m,), or None below the evidence `least`.

    In noise of any smooth spectrum a periodogram over its level exceeds x with the probability (1 + x/ν)^−ν; the sum
    over n series of ν log(1 + x/ν) has a gamma law of order n. Rounding to q makes lines of q/π: none of up to twice that counts.
    """
    rows = [(time[known], values[known]) for time, values in series if (known := np.isfinite(values)).sum() > AROUND]
    longest = round(max((time[-1] - time[0] for time, _ in rows), default=0.0) / sampling) + 1
    count = scipy.fft.next_fast_len(2 * longest, real=True)
    frequency = np.arange(count // 2 + 1) / (count * sampling)
    slow = max(1.0 / slowest, CYCLES / (longest * sampling))
    looked_at = (frequency > slow) & (frequency < 1.0 / (FASTEST * sampling))
    ratio, size = np.zeros(frequency.size), np.zeros(frequency.size)
    for time, values in rows:
        fast = _fast(time, values, sampling, slowest)
        window = np.hanning(fast.size)
        amplitude = np.abs(scipy.fft.rfft(fast * window, count)) * 2.0 / window.sum()
        level = scipy.ndimage.median_filter(amplitude**2, AROUND, mode="nearest") / np.log(2.0)
        step = find_step(values)  # noise of a step or more blurs the lines that it makes of a slope
        rounding = step / np.pi if white_rms(values) < step else 0.0
        real = looked_at & (level > 0.0) & (amplitude > 2.0 * rounding)
        ratio[real] += LEVEL * np.log1p(amplitude[real] ** 2 / level[real] / LEVEL)
        size[real] = np.maximum(size[real], amplitude[real] / np.sqrt(2.0))
    evidence = _improbable(ratio, len(rows)) - np.log(max(int(looked_at.sum()) / 2.0, 1.0))
    at = int(np.argmax(np.where(evidence > least, size, 0.0)))
    return Line(1.0 / float(frequency[at]), float(evidence[at]), float(size[at])) if evidence[at] > least else None


def _improbable(ratio: Array, order: int) -> Array:
    """Return minus the log of the probability that a gamma law exceeds a number; far out by its leading term."""
    far = ratio - (order - 1) * np.log(np.maximum(ratio, 1.0)) + scipy.special.gammaln(order)
    near = np.minimum(ratio, FAR + 3.0 * order)
    return np.asarray(np.where(ratio > near, far, -np.log(scipy.special.gammaincc(order, near))))


def _fast(time: Array, values: Array, sampling: float, slowest: float) -> Array:
    """Return what readings do within twice the slowest period, on an even grid; a bend or a hop is clipped."""
    table = np.interp(np.arange(time[0], time[-1] + 0.5 * sampling, sampling), time, values)
    width = max(3, round(slowest / sampling))
    fast = table - scipy.ndimage.uniform_filter1d(
        scipy.ndimage.uniform_filter1d(table, width, mode="nearest"), width, mode="nearest"
    )
    most = TALLEST * robust_spread(fast)
    return np.asarray(np.clip(fast, -most, most))
