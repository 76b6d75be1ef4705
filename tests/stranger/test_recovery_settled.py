"""Settled parts of records that this file makes: its own lags, cubic and noise; nothing is taken from the workbench."""

import numpy as np
import pytest

from studies.record import Record
from studies.record.settled import advise_hold, find_soaks

LEVELS = (20.0, -30.0, -10.0, 10.0, 30.0, 50.0)


def _frequency(T):
    return 4424.7 + 0.352 * T - 6.1e-4 * T**2 + 8.0e-6 * T**3


def _follow(time, drive, tau):
    """Lag of first order, exact for a drive that is linear between the rows."""
    found = drive.copy()
    for k in range(1, len(time)):
        step, slope = time[k] - time[k - 1], (drive[k] - drive[k - 1]) / (time[k] - time[k - 1])
        found[k] = (found[k - 1] - drive[k - 1] + slope * tau) * np.exp(-step / tau) + drive[k] - slope * tau
    return found


def _stairs(hours, lags, seed=7, frequency_noise=5e-4, sensor_noise=5e-3, row=30.0):
    """A record with ramps of 2 K/min between holds, and the resonator's true temperature and level in every row."""
    times, chamber = [0.0], [LEVELS[0]]
    for level in LEVELS:
        times += [times[-1] + 30.0 * abs(level - chamber[-1])] if level != chamber[-1] else []
        chamber += [level] if level != chamber[-1] else []
        times.append(times[-1] + 3600.0 * hours)
        chamber.append(level)
    time = np.arange(0.0, times[-1], row)
    drive = np.interp(time, times, chamber)
    housing = _follow(time, drive, 500.0)
    resonator = sum(weight * _follow(time, housing, tau) for tau, weight in lags.items())
    random = np.random.default_rng(seed)
    columns = {
        "time_s": time,
        "housing_temperature_degC": housing + sensor_noise * random.standard_normal(len(time)),
        "chamber_temperature_degC": drive,
        "frequency_Hz": _frequency(resonator) + frequency_noise * random.standard_normal(len(time)),
    }
    return Record(columns), resonator - drive


@pytest.mark.parametrize(
    ("hours", "lags"), [(16.4, {9000.0: 1.0}), (10.0, {900.0: 0.6, 4000.0: 0.4}), (6.0, {1500.0: 1.0})]
)
def test_no_more_is_left_than_is_said(hours, lags):
    """A gyro three times slower than the usual time constant is judged by its own."""
    record, away = _stairs(hours, lags)
    soaks = find_soaks([record])
    assert len(soaks) >= 5
    for soak in soaks:
        inside = (record["time_s"] >= soak.start) & (record["time_s"] <= soak.end)
        if not soak.extrapolated_K:  # an extrapolated state is where the hold leads, not where its rows are
            assert np.abs(away[inside]).max() < 1.1 * 0.05
        exact = _frequency(round(soak.temperature_degC))
        assert abs(soak.frequency_Hz - exact) < 1.2 * soak.error_Hz + 5e-4
    assert soaks[0].time_constant == pytest.approx(max(3000.0, *lags), rel=0.06)


def test_noise_neither_hides_nor_cuts_a_soak():
    """Each hold once, and within its own stated error, in noise of 20 mHz and 50 mK a row."""
    record, _ = _stairs(6.0, {1500.0: 1.0}, frequency_noise=0.02, sensor_noise=0.05)
    soaks = find_soaks([record])
    assert [round(soak.temperature_degC) for soak in soaks] == list(LEVELS)
    assert all(abs(s.frequency_Hz - _frequency(level)) < s.error_Hz for s, level in zip(soaks, LEVELS, strict=True))


@pytest.mark.parametrize("lags", [{9000.0: 1.0}, {900.0: 0.6, 4000.0: 0.4}])
def test_the_advised_hold_suffices_for_a_slow_gyro(lags):
    short, _ = _stairs(6.0 if 9000.0 in lags else 3.0, lags)
    advice = advise_hold([short], 3000.0, 0.05)
    hours = float(advice.rsplit("hold each temperature ", 1)[1].split()[0])
    soaks = find_soaks([_stairs(hours, lags, seed=8)[0]])
    assert {round(soak.temperature_degC) for soak in soaks} >= set(LEVELS) - {-30.0}  # the first step is the largest
