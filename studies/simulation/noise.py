"""Noise of a virtual record, from a seeded generator, with the levels of the card's table `[noise]`."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len

if TYPE_CHECKING:
    from studies.instrument.tables.noise import NoiseKeys

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseLevels:
    """White, flicker and random-walk levels in the unit of a signal: Allan deviations at 1 s, flat, and change in 1 s.

    `offset` is the standard deviation of what a run has from its first row to its last.
    """

    white: float = 0.0
    flicker: float = 0.0
    walk: float = 0.0
    offset: float = 0.0

    def draw(self, count: int, rate: float, generator: np.random.Generator) -> Array:
        """Draw `count` samples at `rate` (Hz)."""
        noise = white_noise(count, rate, self.white, generator)
        noise += flicker_noise(count, self.flicker, generator)
        noise += random_walk(count, rate, self.walk, generator)
        if self.offset:
            noise += self.offset * generator.standard_normal()
        return noise


def frequency_noise(noise: "NoiseKeys") -> NoiseLevels:
    """Noise of the frequency, Hz."""
    return NoiseLevels(noise.frequency_white_Hz, noise.frequency_flicker_Hz, noise.frequency_walk_Hz)


def bias_noise(noise: "NoiseKeys") -> NoiseLevels:
    """Noise of the zero-rate output, deg/h; one hour has 3600 s."""
    return NoiseLevels(
        60.0 * noise.bias_white_deg_per_rt_h,
        noise.bias_flicker_deg_per_h,
        noise.bias_walk_deg_per_h_per_rt_h / 60.0,
        noise.bias_turn_on_deg_per_h,
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
