"""Limit: a block that alone sees the start of a run cannot make the held-out figure explode."""

import numpy as np
import pytest

from studies.record import Record
from studies.workbench import diagnose_records


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hours", "period", "tau", "start"),
    [(4.2, 500.0, 0.0, 20.0), (10.0, 2000.0, 800.0, -10.0)],
    ids=["over before the second block", "30 K from equilibrium, 10⁴ times the noise"],
)
def test_an_initial_state_that_one_block_alone_sees_spoils_nothing(hours, period, tau, start):
    t = np.arange(0.0, 3600.0 * hours, 20.0)
    housing = 20 + 10 * np.sin(t / period)
    resonator = np.full_like(t, start) if tau else housing
    for k in range(1, t.size if tau else 0):
        resonator[k] = resonator[k - 1] + 20.0 / tau * (0.5 * (housing[k] + housing[k - 1]) - resonator[k - 1])
    frequency = 4432 + 0.35 * (resonator - 20) + 1e-3 * np.random.default_rng(8).standard_normal(t.size)
    record = Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": frequency})
    found = diagnose_records([record]).verdict.as_dict()["responses"]["frequency_Hz"]["baseline"]
    assert found["held_out_rms"] < 1.1 * found["residual_rms"]
    assert found["residual_rms"] < 1.1e-3
