"""Evidence: exact limits of what is said of rows that the rest of a campaign cannot foretell."""

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.evidence import Linear, solve
from studies.diagnosis.investigate import investigate
from studies.diagnosis.noise import NoiseModels
from studies.record import Record


def test_a_column_that_no_row_shows_is_as_unknown_as_one_that_hardly_shows():
    rng = np.random.default_rng(5)
    t = np.arange(400) * 60.0
    y, level = 3.0 + 1e-3 * rng.standard_normal(t.size), np.ones((t.size, 1))
    # the white noise that the priors' scale is told in is not what the fit finds: 0.05 for 0.001

    def deviation(size):
        column = size * np.sin(t / 900.0)[:, None]
        prior, owner = np.array([np.inf, 0.2]), np.array([-1, 0])
        model = Linear(y, np.concatenate([level, column], axis=1), prior, owner, NoiseModels.of([t], 1.0, 144.0), 0.05)
        return np.sqrt(solve(model, 0, np.array([0.5])).covariance[1, 1])

    assert deviation(0.0) == pytest.approx(deviation(1e-9), rel=1e-6)
    assert deviation(0.0) == pytest.approx(0.1, rel=1e-6)


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
    found = investigate(load_campaign(records), advise=False)
    result = found.verdict.responses["frequency_Hz"]
    assert [cause.effect for cause in found.verdict.causes] == ["periodic"]
    assert "sine_Hz" not in found.verdict.causes[0].parameters  # a phase in common has no place in this form
    assert result.extended[1] is None
    assert result.gain is None
    assert result.noise == pytest.approx(0.001, rel=0.1)
