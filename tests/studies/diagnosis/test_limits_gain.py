"""Limit: a block that alone sees the start of a run cannot make the held-out figure explode."""

import numpy as np

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.investigate import investigate
from studies.record import Record


def test_initial_state_unknown_to_the_rows_that_are_left_stays_zero():
    """A resonator that follows its housing at once: e^(−t/τ) is over before the second block begins."""
    t = np.arange(0.0, 15000.0, 10.0)
    housing = 20 + 10 * np.sin(t / 500)
    frequency = 4432 + 0.35 * (housing - 20) + 1e-3 * np.random.default_rng(8).standard_normal(t.size)
    record = Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": frequency})
    found = investigate(load_campaign([record])).verdict.as_dict()["responses"]["frequency_Hz"]["baseline"]
    assert found["held_out_rms"] is not None
    assert found["held_out_rms"] < 3 * found["residual_rms"]
