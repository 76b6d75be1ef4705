"""Limit: of a line whose phase is each run's own, no run foretells another's."""

import numpy as np
import pytest

from studies.record import Record
from studies.workbench import diagnose_records


@pytest.mark.slow
def test_no_run_is_held_out_of_a_line_with_a_phase_of_its_own():
    rng, records = np.random.default_rng(3), []
    t = np.arange(0.0, 6 * 3600.0, 30.0)
    for k, phase in enumerate((0.3, 2.9, 4.4)):
        housing = 20.0 + (15.0 + 2.0 * k) * np.sin(2 * np.pi * t / 9000.0 + k)
        gyro, keep = housing.copy(), np.exp(-30.0 / 600.0)
        for n in range(1, t.size):
            gyro[n] = keep * gyro[n - 1] + (1 - keep) * 0.5 * (housing[n] + housing[n - 1])
        line = 0.02 * np.sin(2 * np.pi * t / 400.0 + phase)
        f = 5000.0 + 0.4 * gyro + line + 0.001 * rng.standard_normal(t.size)
        records.append(
            Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": f}, path=f"run{k}.csv")
        )
    verdict = diagnose_records(records).verdict
    result = verdict.responses["frequency_Hz"]
    assert [cause.effect for cause in verdict.causes] == ["periodic"]
    assert "sine_Hz" not in verdict.causes[0].parameters  # a phase in common has no place in this form
    assert result.extended[1] is None
    assert result.gain is None
    assert result.noise == pytest.approx(0.001, rel=0.1)
