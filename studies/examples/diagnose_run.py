"""A diagnosis: two runs of a gyro whose bias also follows the *rate* of its temperature, which its model leaves out.

The runs are made here from plain formulas, so that what is wrong is known: the resonator follows the housing with a lag
of 30 min, the frequency its temperature, the bias the frequency and, as the missing physics, dT/dt.
"""

from typing import Any

import numpy as np

import hrg

STEP, ROW, HOURS, LAG = 1.0, 20, 8, 1800.0  # s, steps between rows, length of a run, s
RATE_BIAS = 900.0  # deg/h per K/s


def make_run(chamber: tuple[float, ...], generator: np.random.Generator) -> hrg.Record:
    """Return a run in which the housing goes from one chamber temperature (°C) to the next at 0.5 K/min."""
    t = np.arange(0.0, HOURS * 3600, STEP)
    stops = np.linspace(0, t[-1], len(chamber), endpoint=False)
    held = np.array(chamber)[np.searchsorted(stops, t, side="right") - 1]
    housing = np.empty_like(t)
    housing[0] = held[0]
    for k in range(1, len(t)):
        housing[k] = housing[k - 1] + np.clip(held[k] - housing[k - 1], -0.5 * STEP / 60, 0.5 * STEP / 60)
    keep = float(np.exp(-STEP / LAG))
    resonator = housing.copy()
    for k in range(1, len(t)):
        resonator[k] = keep * resonator[k - 1] + (1 - keep) * housing[k]
    frequency = 4425 + 0.37 * resonator - 1e-3 * resonator**2
    bias = 2.0 * (frequency - 4432) + RATE_BIAS * np.gradient(resonator, t)
    t, housing, frequency, bias = (values[::ROW] for values in (t, housing, frequency, bias))
    return hrg.Record(
        {
            "time_s": t,
            "housing_temperature_degC": housing,
            "frequency_Hz": frequency + 2e-3 * generator.standard_normal(len(t)),
            "bias_deg_per_h": bias + 0.05 * generator.standard_normal(len(t)),
        }
    )


def diagnose_runs() -> Any:
    """Ask what the model of the device lacks."""
    generator = np.random.default_rng(3)
    records = [make_run(chamber, generator) for chamber in ((20, -10, 30), (20, 40, 0, 20))]
    return hrg.diagnose(*records).verdict


if __name__ == "__main__":
    found = diagnose_runs()
    print(found.verdict)
    for cause in found.causes:
        print(f"  {cause.effect} in {cause.response}, probability {cause.probability:.2f}: {dict(cause.parameters)}")
    for name, result in found.responses.items():
        print(f"  {name}: {result.verdict}, noise {result.noise:.3g}")
