"""Limits: what a static curve of the frequency leaves to the bias, and what a record that is too short confirms."""

import numpy as np
import pytest

from studies.record import Record
from studies.workbench import diagnose_records
from thermal.lag import lag


@pytest.mark.slow
def test_a_curve_of_the_frequency_is_no_curve_of_the_bias():
    """Planted: a tanh in the law, in the bias a cubic of the physical change: what the law's bend takes of the tanh is not known.

    Where that was not said, its fourth power in the bias was named cross-damping, of evidence 37.
    """
    rng, time = np.random.default_rng(8), np.arange(0.0, 9 * 3600.0, 20.0)
    housing = lag(time, np.repeat((20.0, -5.0, 45.0, 20.0, -30.0), time.size // 5), 400.0)
    x = lag(time, housing, 1100.0) - 20.0
    change = 0.36 * x - 2.5e-4 * x**2
    bias = 0.6 * change + 0.05 * change**2 + 0.004 * change**3 + 0.01 * rng.standard_normal(x.size)
    frequency = 4432.0 + change + 0.2 * np.tanh((x + 10.0) / 12.0) + 2e-3 * rng.standard_normal(x.size)
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency, "bias_deg_per_h": bias}
    verdict = diagnose_records([Record(columns)]).verdict
    assert verdict.responses["bias_deg_per_h"].verdict == "adequate", verdict.causes
    assert "curvature" in {name for cause in verdict.causes for name in cause.names}
    assert {cause.response for cause in verdict.causes} == {"frequency_Hz"}


def test_a_record_shorter_than_the_lag_that_it_may_have_confirms_nothing():
    """Six minutes after a step of the chamber once were adequate in every response."""
    time = np.arange(0.0, 370.0, 10.0)
    rng = np.random.default_rng(5)
    columns = {
        "time_s": time,
        "housing_temperature_degC": 25.0 - 17.0 * (1.0 - np.exp(-time / 250.0)),
        "frequency_Hz": 4434.0 - 3e-8 * time**2 + rng.normal(0.0, 7e-4, time.size),
        "bias_deg_per_h": 2.3 + rng.normal(0.0, 0.3, time.size),
    }
    verdict = diagnose_records([Record(columns)]).verdict
    assert verdict.verdict == "not-identifiable"
    assert all("too short to judge" in one.remark for one in verdict.responses.values())
