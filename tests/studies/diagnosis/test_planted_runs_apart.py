"""Runs that each fit and lie apart are never adequate, and what start times would decide is said."""

import datetime

import numpy as np
import pytest

from studies.record import Record
from studies.workbench import diagnose_records
from thermal.lag import lag

NOISE = 1e-3  # Hz
TIME = np.arange(0.0, 7200.0, 20.0)
HOUSING = 25.0 + 8.0 * np.sin(2 * np.pi * TIME / 7200.0)


def runs(offsets, gap=None):
    """Runs of one gyro whose frequency is that of a lagging resonator, but for an offset of each (Hz)."""
    rng, records = np.random.default_rng(3), []
    resonator = lag(TIME, HOUSING, 300.0)
    for k, offset in enumerate(offsets):
        f = 4432.0 + 0.35 * (resonator - 20.0) + offset + NOISE * rng.standard_normal(TIME.size)
        columns = {"time_s": TIME, "housing_temperature_degC": HOUSING, "frequency_Hz": f}
        start = None if gap is None else datetime.datetime(2026, 1, 1) + datetime.timedelta(seconds=k * gap)
        records.append(Record(columns, start=start, path=f"run{k}.csv", sha256=str(k)))
    return records


def judge(records):
    return diagnose_records(records).verdict


@pytest.mark.slow
def test_runs_that_lie_apart_are_not_adequate_and_start_times_would_show_why():
    verdict = judge(runs([0.0, 0.05, -0.03, 0.04]))
    result = verdict.responses["frequency_Hz"]
    assert verdict.verdict == "not-identifiable"
    assert "(rms) apart" in result.remark
    assert "start times" in result.remark
    assert np.ptp(result.run_shifts) == pytest.approx(0.08, rel=0.1)
    assert result.white == pytest.approx(NOISE, rel=0.2)
    timed = judge(runs([0.0, 0.05, -0.03, 0.04], gap=86400.0)).responses["frequency_Hz"]
    assert timed.verdict != "adequate"
    assert "start times" not in timed.remark


@pytest.mark.slow
def test_a_bias_that_differs_from_run_to_run_is_adequate_as_turn_on_and_what_else_it_may_be_is_said():
    rng, records = np.random.default_rng(5), []
    for k, offset in enumerate((0.0, 4.0)):
        bias = 0.2 * (HOUSING - 20.0) + offset + 0.05 * rng.standard_normal(TIME.size)
        columns = {"time_s": TIME, "housing_temperature_degC": HOUSING, "bias_deg_per_h": bias}
        records.append(Record(columns, path=f"run{k}.csv", sha256=str(k)))
    result = judge(records).responses["bias_deg_per_h"]
    assert result.verdict == "adequate"
    assert "lie 2 °/h (rms) apart" in result.remark
    assert "turn-on" in result.remark
