"""The next run without a card: words that simulate where a run helps, a measurement where none does."""

import numpy as np
import pytest

from studies.planning.chamber import Chamber
from studies.record import Record
from studies.workbench import diagnose_records
from tests.studies.diagnosis.bench import STAIRS, Bench
from thermal.lag import lag
from thermal.profile import parse_profile


@pytest.mark.slow
def test_inseparable_pair_gets_a_measurement_and_no_run():
    rng = np.random.default_rng(11)
    records = []
    for k in range(2):
        time = np.arange(0.0, 6 * 3600.0, 5.0)
        housing = lag(time, 20.0 + 25.0 * np.sign(np.sin(2 * np.pi * time / 9000.0 + k)), 600.0)
        x = lag(time, housing, 2000.0) - 20.0
        drift = 0.05 * (time + 6 * 3600.0 * k) / 3600.0
        frequency = 5000.0 + 0.4 * x - 4e-4 * x**2 + drift + 0.01 * rng.standard_normal(time.size)
        columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
        records.append(Record({name: values[::4] for name, values in columns.items()}))
    verdict = diagnose_records(records, chamber=Chamber()).verdict
    assert {verdict.causes[0].effect, *verdict.causes[0].equivalent} >= {"ageing", "clock-drift"}
    assert verdict.verdict == "not-identifiable"
    assert verdict.as_dict()["next_run"] is None
    assert "reference clock" in verdict.next_experiment


@pytest.mark.slow
def test_suggested_run_is_part_of_the_answer():
    bench = Bench(STAIRS, sampling=20.0, seed=2)
    verdict = diagnose_records([bench.record(frequency_Hz=bench.frequency(0.01))], chamber=Chamber()).verdict
    run = verdict.as_dict()["next_run"]
    assert set(run) == {"profile", "drives", "expected_evidence", "repeat_evidence", "separates", "narrows", "hours"}
    assert run["expected_evidence"] > 10.0
    assert run["profile"].startswith("repeat") or parse_profile(run["profile"]).end > 3 * 3600.0
    assert run["profile"] in verdict.next_experiment
