"""Noise of a virtual record, with the levels of the card's table `[noise]`, and rounding."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise

if TYPE_CHECKING:
    from studies.instrument.tables.noise import NoiseKeys


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


def quantise(values: Array, resolution: float) -> Array:
    """Round to multiples of the resolution; 0 leaves the values as they are."""
    if resolution == 0:
        return values
    return np.asarray(np.round(values / resolution) * resolution)
