"""A compensation: a staircase calibrates f(T), and a slow ramp that was not fitted shows what is left: the thermal lag."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import hrg

STEP = 6 * 3600.0  # s on each step of the staircase


class Outcome(NamedTuple):
    """Change of the frequency (Hz) over the ramp before and after compensation, and the model as C for firmware."""

    before: float
    after: float
    firmware: str


def calibrate_and_apply() -> Outcome:
    """Fit the cubic to the settled end of every step and apply it to the ramp."""
    record = hrg.simulate("hrg-30mm", "staircase -20 40 10 6h", row=100, noise=False)
    ramp = hrg.simulate("hrg-30mm", "ramp -20 40 0.05", row=100, noise=False)
    settled = np.searchsorted(record["time_s"], STEP * np.arange(1, 8)) - 1
    T, f = record["housing_temperature_degC"][settled], record["frequency_Hz"][settled]
    model = hrg.save_frequency(hrg.fit_frequency(T, f), (hrg.ModelSource("staircase", "", len(T)),), "example")
    result = hrg.compensate(model, ramp, extrapolate=True)
    return Outcome(_spread(ramp["frequency_Hz"]), _spread(result["compensated_frequency_Hz"]), hrg.emit_c(model))


def _spread(values: NDArray[np.float64]) -> float:
    return float(np.ptp(values))


if __name__ == "__main__":
    outcome = calibrate_and_apply()
    print(f"over the ramp the frequency changes by {outcome.before:.2f} Hz, compensated by {outcome.after:.3f} Hz")
    print(f"{len(outcome.firmware.splitlines())} lines of C for firmware")
