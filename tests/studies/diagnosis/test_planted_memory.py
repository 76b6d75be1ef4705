"""What came before a run: a slow mass that is still warm from the last one needs no further cause."""

import numpy as np
import pytest

from studies.record import Record
from studies.workbench import diagnose_records
from thermal.lag import lag

STEP, RUN, PAUSE = 20.0, 9000.0, 2400.0  # s
SLOW, SHARE, NOISE = 15000.0, 0.08, 1e-3  # s, –, Hz
LEVELS = ((55.0, -5.0), (60.0, 35.0), (-15.0, 50.0), (5.0, -20.0))


def a_day_in_the_chamber():
    """Four runs of two levels each, 40 min apart at 20 °C: one solution of the resonator's two paths from the first to the last."""
    time = np.arange(0.0, len(LEVELS) * (RUN + PAUSE), STEP)
    place = time % (RUN + PAUSE)
    housing = np.full(time.size, 20.0)
    for k, (first, second) in enumerate(LEVELS):
        own = time // (RUN + PAUSE) == k
        corners = [0.0, 600.0, 2400.0, 4000.0, 6000.0, 8200.0, RUN]
        housing[own] = np.interp(place[own], corners, [20.0, 20.0, first, first, second, second, 20.0])
    resonator = (1.0 - SHARE) * lag(time, housing, 500.0) + SHARE * lag(time, housing, SLOW)
    x = resonator - 20.0
    frequency = 4432.0 + 0.35 * x + 4e-5 * x**2 + NOISE * np.random.default_rng(11).standard_normal(time.size)
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
    records = []
    for k in range(len(LEVELS)):
        own = (time // (RUN + PAUSE) == k) & (place < RUN)
        run = {name: values[own] - (values[own][0] if name == "time_s" else 0.0) for name, values in columns.items()}
        records.append(Record(run, path=f"run{k}.csv", sha256=str(k)))
    return records


@pytest.mark.slow
def test_a_slow_mass_that_the_runs_before_have_warmed_is_one_cause():
    """The second path starts every run with what it has kept; it was once called mounting stress, ageing and a jump."""
    verdict = diagnose_records(a_day_in_the_chamber()).verdict
    (cause,) = verdict.causes
    assert cause.effect == "second-lag"
    result = verdict.responses["frequency_Hz"]
    assert result.left_over == "none"
    assert result.extended[0] == pytest.approx(NOISE, rel=0.05)
    found = cause.parameters["second_time_constant_s"]
    assert found.low < SLOW < found.high
