"""Exact limit: a record that is the contract's baseline and white noise leaves that noise, however steep its temperature."""

import numpy as np
import pytest
from scipy.signal import lfilter

from studies.record import Record
from studies.workbench import diagnose_records

NOISE, TAU, FINE = 3e-4, 800.0, 1.0


def baseline_record(run, step, hours, before, rng):
    """±30 K at two to four hours, sampled every `step` s from `before` s after the resonator was in equilibrium."""
    time = np.arange(0.0, before + 3600.0 * hours, FINE)
    housing = 10.0 + 30.0 * np.sin(2.0 * np.pi * time / 7200.0 / (1.0 + 0.3 * run) + run)
    # the first-order lag of a drive that is linear between its samples, exactly
    decay = np.exp(-FINE / TAU)
    ramp = TAU / FINE * (1.0 - decay)
    resonator, _ = lfilter([1.0 - ramp, ramp - decay], [1.0, -decay], housing, zi=[ramp * housing[0]])
    rows = slice(int(before / FINE), None, int(step / FINE))
    x = resonator[rows] - 20.0
    frequency = 5000.0 + 0.4 * x - 1e-3 * x**2
    return Record(
        {
            "time_s": time[rows] - before,
            "housing_temperature_degC": housing[rows],
            "frequency_Hz": frequency + NOISE * rng.standard_normal(x.size),
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize(("step", "hours", "before"), [(5.0, 5.0, 0.0), (20.0, 6.0, 3600.0)])
def test_the_residual_is_the_noise(step, hours, before):
    """Also on long records, which are binned, and on records that start in full slew, 10 K from equilibrium."""
    rng = np.random.default_rng(3)
    records = [baseline_record(run, step, hours, before, rng) for run in range(3)]
    verdict = diagnose_records(records).verdict
    result = verdict.responses["frequency_Hz"]
    assert verdict.verdict == "adequate", verdict.causes
    assert result.noise == pytest.approx(NOISE, rel=0.05)
    assert result.baseline[1] == pytest.approx(NOISE, rel=0.05)
