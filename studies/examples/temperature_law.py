"""Frequency over temperature of a card, with the uncertainty that its material leaves."""

import numpy as np
from numpy.typing import NDArray

import hrg

ZERO = 273.15  # K


def frequency_over_temperature() -> dict[str, NDArray[np.float64]]:
    """Return temperature (°C), frequency (Hz), slope of ln f (ppm/K) and its standard deviation."""
    celsius = np.array([-40.0, 0.0, 20.0, 60.0])
    law = hrg.law_of(hrg.load_card("hrg-30mm"), *(celsius[[0, -1]] + ZERO))
    return {
        "T": celsius,
        "f": law.frequency(celsius + ZERO),
        "slope": 1e6 * law.slope(celsius + ZERO),
        "sd": 1e6 * law.slope_uncertainty(celsius + ZERO),
    }


if __name__ == "__main__":
    found = frequency_over_temperature()
    for T, f, slope, sd in zip(*found.values(), strict=True):
        print(f"{T:+.0f} °C: {f:.2f} Hz, {slope:.1f} ± {sd:.1f} ppm/K")
