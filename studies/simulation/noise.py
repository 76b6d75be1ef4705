"""Noise of a virtual record, with the levels of the card's table `[noise]`, and rounding."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from compensation.noise import Noise

if TYPE_CHECKING:
    from collections.abc import Mapping

    from studies.instrument.tables.noise import NoiseKeys


def frequency_noise(noise: "NoiseKeys") -> Noise:
    """Noise of the frequency, Hz."""
    return Noise(
        noise.frequency_white_Hz,
        noise.frequency_flicker_Hz,
        noise.frequency_walk_Hz,
        markov=noise.frequency_markov_Hz,
        markov_time=noise.frequency_markov_s,
    )


def bias_noise(noise: "NoiseKeys") -> Noise:
    """Noise of the zero-rate output, deg/h; one hour has 3600 s."""
    return Noise(
        60.0 * noise.bias_white_deg_per_rt_h,
        noise.bias_flicker_deg_per_h,
        noise.bias_walk_deg_per_h_per_rt_h / 60.0,
        noise.bias_turn_on_deg_per_h,
        noise.bias_markov_deg_per_h,
        noise.bias_markov_s,
    )


def noise_keys(noise: "Mapping[str, Noise]", loss: float) -> dict[str, float]:
    """Entries of `[noise]` that state the levels of responses; those of 1/Q are relative to a `loss`."""
    keys: dict[str, float] = {}
    if own := noise.get("frequency_Hz"):
        keys |= {"frequency_white_Hz": own.white, "frequency_flicker_Hz": own.flicker, "frequency_walk_Hz": own.walk}
        keys |= {"frequency_markov_Hz": own.markov} | ({"frequency_markov_s": own.markov_time} if own.markov else {})
    if own := noise.get("bias_deg_per_h"):
        keys |= {
            "bias_white_deg_per_rt_h": own.white / 60.0,
            "bias_flicker_deg_per_h": own.flicker,
            "bias_walk_deg_per_h_per_rt_h": own.walk * 60.0,
            "bias_markov_deg_per_h": own.markov,
        } | ({"bias_markov_s": own.markov_time} if own.markov else {})
    if own := noise.get("inverse_q"):
        keys["inverse_q_white"] = own.white / loss
    return keys


def quantise(values: Array, resolution: float) -> Array:
    """Round to multiples of the resolution; 0 leaves the values as they are."""
    if resolution == 0:
        return values
    return np.asarray(np.round(values / resolution) * resolution)
