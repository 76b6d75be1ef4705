"""Whiteness of the residual of a decay: how much wider the bound must be, a start that is not free decay, and lines."""

from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array, Complex
from compensation.samples import block_means

BLOCKS = 64
RARE = 1e-3  # probability below which noise is not held for the reason


@dataclass(frozen=True)
class Leftover:
    """Structure of a residual (channels, rows) besides white noise."""

    # √ of the largest ratio between the variance of block means and what white noise leaves of it, at least 1
    widening: float
    early: bool  # whether the first rows miss by more than the rest: a transient, or a drive that still acts


def examine(residual: Complex) -> Leftover:
    """Return what a residual shows: a ratio of variances over block lengths, and its first blocks."""
    channels, rows = residual.shape
    variance = np.mean(np.abs(residual) ** 2, axis=1)
    scaled = residual / np.sqrt(variance)[:, None]
    widest = 1.0
    size = 2
    while rows // size >= 8:
        count = rows // size
        ratio = size * float(np.mean(np.abs(block_means(scaled, size)) ** 2))
        if ratio > scipy.stats.chi2.isf(RARE, 2 * channels * count) / (2 * channels * count):
            widest = max(widest, ratio)
        size *= 2
    count = min(BLOCKS, rows // 4)
    size = rows // count
    energy = np.mean(np.abs(block_means(scaled, size)[:, :count]) ** 2, axis=0)
    early = False
    for first in (1, 2, 4, 8):
        if first <= count // 4:
            rest = float(np.mean(energy[first:]))
            bound = scipy.stats.f.isf(RARE / 4, 2 * channels * first, 2 * channels * (count - first))
            early |= float(np.mean(energy[:first])) > max(bound, 1.0) * max(rest, 1e-300)
    return Leftover(float(np.sqrt(widest)), bool(early))


def find_line(time: Array, residual: Complex) -> float | None:
    """Return the frequency (Hz, from the carrier) of the largest line where its power passes what the noise beside it has once in a thousand records."""
    scaled = residual / np.sqrt(np.mean(np.abs(residual) ** 2, axis=1))[:, None]
    step = float(np.median(np.diff(time)))
    grid = np.rint((time - time[0]) / step).astype(int)
    if grid[-1] > 8 * time.size:
        return None
    even = np.zeros((scaled.shape[0], int(grid[-1]) + 1), dtype=complex)
    even[:, grid] = scaled
    power = np.sum(np.abs(np.fft.fft(even * np.hanning(even.shape[1]), axis=1)) ** 2, axis=0)
    at = int(np.argmax(power))
    near = np.take(power, np.arange(at - 40, at + 41), mode="wrap")
    level = float(np.median(near)) / scipy.stats.chi2.median(2 * scaled.shape[0]) * 2
    if power[at] < level * scipy.stats.chi2.isf(RARE / power.size, 2 * scaled.shape[0]) / 2:
        return None
    return float(np.fft.fftfreq(power.size, step)[at])
