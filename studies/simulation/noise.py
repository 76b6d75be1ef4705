"""Noise of a virtual record, from a seeded generator, with levels as they are read off an Allan deviation.

[noise]                              # every key may be left out; a level of 0 switches that noise off
frequency_white_Hz = 2e-3            # Allan deviation at 1 s
frequency_flicker_Hz = 2e-4          # flat part of the Allan deviation
frequency_walk_Hz = 1e-5             # random walk: standard deviation of the change in 1 s
bias_white_deg_per_rt_h = 0.02       # angle random walk
bias_flicker_deg_per_h = 0.1         # flat part of the Allan deviation (0.664 of the bias instability)
bias_walk_deg_per_h_per_rt_h = 0.01  # rate random walk: standard deviation of the change in 1 h
inverse_q_white = 0.01               # relative, Allan deviation at 1 s
housing_white_K = 5e-3               # of the housing sensor, Allan deviation at 1 s
housing_lag_s = 10.0                 # of the housing sensor
frequency_resolution_Hz = 0.0        # rounding of what is recorded; 0 keeps every digit
bias_resolution_deg_per_h = 0.0
housing_resolution_degC = 0.0
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len

from studies.files.toml import Section

Array = NDArray[np.float64]
DEFAULTS = {
    "frequency_white_Hz": 2e-3,
    "frequency_flicker_Hz": 2e-4,
    "frequency_walk_Hz": 1e-5,
    "bias_white_deg_per_rt_h": 0.02,
    "bias_flicker_deg_per_h": 0.1,
    "bias_walk_deg_per_h_per_rt_h": 0.01,
    "inverse_q_white": 0.01,
    "housing_white_K": 5e-3,
    "housing_lag_s": 10.0,
    "frequency_resolution_Hz": 0.0,
    "bias_resolution_deg_per_h": 0.0,
    "housing_resolution_degC": 0.0,
}
SILENT = dict.fromkeys(DEFAULTS, 0.0)


@dataclass(frozen=True)
class NoiseLevels:
    """White, flicker and random-walk levels in the unit of a signal: Allan deviations at 1 s, flat, and change in 1 s."""

    white: float = 0.0
    flicker: float = 0.0
    walk: float = 0.0

    def draw(self, count: int, rate: float, generator: np.random.Generator) -> Array:
        """Draw `count` samples at `rate` (Hz)."""
        noise = white_noise(count, rate, self.white, generator)
        noise += flicker_noise(count, self.flicker, generator)
        noise += random_walk(count, rate, self.walk, generator)
        return noise


def read_noise(table: Mapping[str, Any], where: str) -> dict[str, float]:
    """Read a `[noise]` table; what it leaves out has its default."""
    section = Section(table, where, tuple(DEFAULTS))
    return {key: section.number(key, value, least=0.0) for key, value in DEFAULTS.items()}


def frequency_noise(levels: Mapping[str, float]) -> NoiseLevels:
    """Noise of the frequency, Hz."""
    return NoiseLevels(levels["frequency_white_Hz"], levels["frequency_flicker_Hz"], levels["frequency_walk_Hz"])


def bias_noise(levels: Mapping[str, float]) -> NoiseLevels:
    """Noise of the zero-rate output, deg/h; one hour has 3600 s."""
    return NoiseLevels(
        60.0 * levels["bias_white_deg_per_rt_h"],
        levels["bias_flicker_deg_per_h"],
        levels["bias_walk_deg_per_h_per_rt_h"] / 60.0,
    )


def white_noise(count: int, rate: float, level: float, generator: np.random.Generator) -> Array:
    """Independent samples whose Allan deviation is level/√τ, τ in s."""
    if level == 0:
        return np.zeros(count)
    noise: Array = level * np.sqrt(rate) * generator.standard_normal(count)
    return noise


def random_walk(count: int, rate: float, level: float, generator: np.random.Generator) -> Array:
    """A walk from 0 whose change over τ (s) has the standard deviation level √τ; Allan deviation level √(τ/3)."""
    if level == 0:
        return np.zeros(count)
    steps = generator.standard_normal(count)
    steps[:1] = 0.0
    return np.asarray(level / np.sqrt(rate) * np.cumsum(steps))


def flicker_noise(count: int, level: float, generator: np.random.Generator) -> Array:
    """Noise of spectrum S(f) = h/f whose Allan deviation is flat at `level` = √(2 ln 2 · h).

    Gaussian Fourier amplitudes of that spectrum (Timmer & König 1995, Astron. Astrophys. 300, 707) over twice the
    length, of which half is kept, so that the end does not join the beginning. It does not depend on the rate.
    """
    if level == 0 or count < 2:
        return np.zeros(count)
    length = next_fast_len(2 * count, real=True)
    h = level**2 / (2 * np.log(2))
    k = np.arange(length // 2 + 1)
    amplitude = np.zeros(len(k))
    # One-sided S(f_k) = h/f_k with f_k = k/(length Δt): E|X_k|² = S length/(2 Δt) = h length²/(2 k).
    amplitude[1:] = np.sqrt(h / (2 * k[1:])) * length
    spectrum = amplitude * (generator.standard_normal(len(k)) + 1j * generator.standard_normal(len(k))) / np.sqrt(2)
    return np.ascontiguousarray(irfft(spectrum, length)[:count])


def quantise(values: Array, resolution: float) -> Array:
    """Round to multiples of the resolution; 0 leaves the values as they are."""
    if resolution == 0:
        return values
    return np.asarray(np.round(values / resolution) * resolution)
