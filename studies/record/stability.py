"""Stability of a column of a record: an unbroken series of it, its Allan deviation, and the noise that this shows."""

import itertools
from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from compensation.decimation import average_blocks
from compensation.spikes import find_spikes
from compensation.stability import AllanDeviation, NoiseCoefficients, allan_deviation, fit_noise


@dataclass(frozen=True)
class Stability:
    """Allan deviation of an output with the noise coefficients read off it."""

    allan: AllanDeviation
    noise: NoiseCoefficients


def read_stability(series: Array, step: float, confidence: float) -> Stability:
    """Return the Allan deviation of an even series, and N, B, K read where noise of the angle (as 1/τ, no random walk) no longer rules."""
    allan = allan_deviation(series, step, confidence=confidence)
    angle = sum(1 for _ in itertools.takewhile(lambda kind: kind == "phase", allan.noise))
    if not angle:
        return Stability(allan, fit_noise(allan))
    factor = round(allan.tau[min(angle, len(allan.tau) - 1)] / step)
    later = series[: len(series) // factor * factor].reshape(-1, factor).mean(axis=1)
    return Stability(allan, fit_noise(allan_deviation(later, step * factor, confidence=confidence)))


def unbroken(time: Array, columns: dict[str, Array], spikes_left_out: bool = False) -> tuple[float, dict[str, Array]]:
    """Return an equally spaced series for Allan deviations and its step (s): the samples, or means of ten over the longest stretch."""
    steps = np.diff(time)
    step = float(np.median(steps))
    regular = bool(np.all(np.abs(steps - step) < 0.01 * step))
    whole = regular and all(np.all(np.isfinite(y)) for y in columns.values())
    if whole and (spikes_left_out or not any(np.any(find_spikes(y)) for y in columns.values())):
        return step, columns
    blocks = average_blocks(time, columns, 10 * step)
    breaks = np.flatnonzero(np.abs(np.diff(blocks.time) - blocks.width) > 0.5 * blocks.width) + 1
    ends = np.concatenate([[0], breaks, [blocks.time.size]])
    longest = int(np.argmax(np.diff(ends)))
    stretch = slice(int(ends[longest]), int(ends[longest + 1]))
    return blocks.width, {name: y[stretch] for name, y in blocks.columns.items()}
