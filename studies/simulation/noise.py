"""Noise of a virtual record, with the levels of the card's table `[noise]`, and rounding."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len

from compensation.noise import Noise

if TYPE_CHECKING:
    from studies.instrument.tables.noise import NoiseKeys

Array = NDArray[np.float64]


def frequency_noise(noise: "NoiseKeys") -> Noise:
    """Noise of the frequency, Hz."""
    return Noise(noise.frequency_white_Hz, noise.frequency_flicker_Hz, noise.frequency_walk_Hz)


def bias_noise(noise: "NoiseKeys") -> Noise:
    """Noise of the zero-rate output, deg/h; one hour has 3600 s."""
    return Noise(
        60.0 * noise.bias_white_deg_per_rt_h,
        noise.bias_flicker_deg_per_h,
        noise.bias_walk_deg_per_h_per_rt_h / 60.0,
        noise.bias_turn_on_deg_per_h,
    )


def draw_noise(noise: Noise, count: int, rate: float, generator: np.random.Generator) -> Array:
    """Draw `count` samples at `rate` (Hz); the flicker has no level of its own from run to run, as `Noise.draw` gives it."""
    total = replace(noise, flicker=0.0, walk=0.0, offset=0.0).draw(count, rate, generator)
    if noise.flicker and count > 1:
        total += noise.flicker * _flicker(count, generator)
    if noise.walk and count:
        steps = generator.standard_normal(count)
        steps[:1] = 0.0
        total += noise.walk / np.sqrt(rate) * np.cumsum(steps)
    if noise.offset:
        total += noise.offset * generator.standard_normal()
    return total


def _flicker(count: int, generator: np.random.Generator) -> Array:
    """Noise of spectrum S(f) = h/f whose Allan deviation is flat at 1 = √(2 ln 2 · h).

    Gaussian Fourier amplitudes of that spectrum (Timmer & König 1995, Astron. Astrophys. 300, 707) over twice the
    length, of which half is kept, so that the end does not join the beginning. It does not depend on the rate.
    """
    length = next_fast_len(2 * count, real=True)
    k = np.arange(length // 2 + 1)
    amplitude = np.zeros(len(k))
    amplitude[1:] = np.sqrt(1.0 / (2 * np.log(2)) / (2 * k[1:])) * length
    spectrum = amplitude * (generator.standard_normal(len(k)) + 1j * generator.standard_normal(len(k))) / np.sqrt(2)
    return np.ascontiguousarray(irfft(spectrum, length)[:count])


def quantise(values: Array, resolution: float) -> Array:
    """Round to multiples of the resolution; 0 leaves the values as they are."""
    if resolution == 0:
        return values
    return np.asarray(np.round(values / resolution) * resolution)
