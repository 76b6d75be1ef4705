"""A run in the chamber before the device exists: after a step, how long until the frequency has settled?"""

import numpy as np

import hrg

CHAMBER = "step 20 -10 5h"


def run_chamber() -> hrg.Record:
    """Simulate the record of the step, without noise, one row in ten seconds; `write_record` saves it."""
    return hrg.simulate("hrg-30mm", CHAMBER, row=10, noise=False)


def settling_time(record: hrg.Record, share: float) -> float:
    """Return the time (s) from which the frequency stays within a share of its whole change."""
    f = record["frequency_Hz"]
    outside = abs(f - f[-1]) > share * abs(f[0] - f[-1])
    return float(record["time_s"][np.flatnonzero(outside)[-1] + 1])


if __name__ == "__main__":
    run = run_chamber()
    print(f"{CHAMBER}: from {run['frequency_Hz'][0]:.3f} to {run['frequency_Hz'][-1]:.3f} Hz")
    for left in (0.05, 0.01):
        print(f"  within {100 * left:.0f} % of the change after {settling_time(run, left) / 60:.0f} min")
