"""Limits: a step of the grid stands for its mean only, and rows that a bend or an uneven clock hid are left out."""

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.held_out import residuals
from studies.diagnosis.inquiry import begin
from studies.diagnosis.steps import Steps
from studies.effects.states import average
from studies.record import Record

TIME = np.arange(0.0, 4800.0, 10.0)
GRID = np.arange(115.0, 4800.0, 240.0)
PLACE = (TIME // 240.0).astype(int)


def curve(time):
    """A parabola: its mean over a step is known, and its slope is not that of its parts."""
    return 1e-4 * (time - 2000.0) ** 2


def mean(grid):
    """Its mean over the rows of whole steps."""
    return curve(grid) + 1e-4 * (240.0**2 - 10.0**2) / 12.0


def test_a_step_without_its_rows_is_no_mean():
    """Of a bend only the first half of a step is known: its own slope leads astray, so that the step is missing."""
    steps = Steps.of(TIME, PLACE, GRID, False, ())
    whole = steps.means(curve(TIME))
    assert np.allclose(whole, mean(GRID), rtol=0.0, atol=0.05)
    values = np.where((TIME >= 2000.0) & (TIME < 2160.0), np.nan, curve(TIME))
    found = steps.means(values)
    assert np.isnan(found[8])
    assert np.array_equal(np.delete(found, 8), np.delete(whole, 8))


def test_a_step_that_lacks_rows_while_a_command_changes_is_no_mean():
    """The loop loses its hold in the seconds in which the voltage steps: what is left is no mean over before and after."""
    volts = np.where(TIME < 1000.0, 40.0, 60.0)
    values = np.where(np.abs(TIME - 1000.0) <= 10.0, np.nan, 0.1 * volts)
    steps = Steps.of(TIME, PLACE, GRID, False, (volts,))
    assert steps.switched.tolist() == [4]
    assert np.flatnonzero(np.isnan(steps.means(values))).tolist() == [4]
    assert not np.isnan(steps.means(0.1 * volts)).any()  # with all its rows it is one


def test_outlying_rows_hide_neither_behind_a_bend_nor_behind_an_uneven_clock():
    """Rows a minute apart of a fast cycle, in uneven moments: only beside a model do 20 σ stand out."""
    rng = np.random.default_rng(11)
    time = np.arange(0.0, 30000.0, 60.0)
    time[1:] += rng.uniform(-12.0, 12.0, time.size - 1)
    housing = 20.0 + 30.0 * np.sin(2 * np.pi * time / 7000.0)
    sigma = 5e-3
    frequency = 4432.0 + 0.36 * (housing - 20.0) + sigma * rng.standard_normal(time.size)
    places = [100, 233, 371]
    frequency[places] += 20.0 * sigma * np.array([1.0, -1.0, 1.0])
    columns = {"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency}
    campaign = load_campaign([Record(columns)])
    assert np.isfinite(campaign.runs[0].row_responses["frequency_Hz"][places]).any()
    cleaned = campaign.without_spikes("frequency_Hz", residuals(begin(campaign, "frequency_Hz", None), campaign))
    left_out = np.flatnonzero(np.isnan(cleaned.runs[0].row_responses["frequency_Hz"]))
    assert left_out.tolist() == places
    assert cleaned.outliers == len(places)
    assert cleaned.said[0].startswith("3 outlying")


@pytest.mark.slow
def test_outlying_rows_beside_each_other_are_left_out():
    """Three rows within four stand out together and are counted; five rows are an event, not outliers."""
    rng = np.random.default_rng(12)
    time = np.arange(0.0, 30000.0, 30.0)
    housing = 20.0 + 30.0 * np.sin(2 * np.pi * time / 20000.0)
    sigma = 5e-3
    frequency = 4432.0 + 0.36 * (housing - 20.0) + sigma * rng.standard_normal(time.size)
    group, event = [400, 401, 403], [700, 701, 702, 703, 704]
    frequency[[*group, *event]] += 15.0 * sigma
    campaign = load_campaign([Record({"time_s": time, "housing_temperature_degC": housing, "frequency_Hz": frequency})])
    plain = begin(campaign, "frequency_Hz", None)
    cleaned = campaign.without_spikes("frequency_Hz", residuals(plain, campaign))
    assert np.flatnonzero(np.isnan(cleaned.runs[0].row_responses["frequency_Hz"])).tolist() == group
    assert cleaned.said[0].startswith("3 outlying")


def test_a_step_of_many_rows_is_the_mean_of_the_lag_at_a_bend():
    """A ramp that has passed two lags, against its solution: a grid coarser than the rows must not bend it (by 0.9 mK once)."""
    first, second, rate = 300.0, 1700.0, 40.0 / 180.0

    def ramped(time):
        """Response of 1/((1 + 300 s·p)(1 + 1700 s·p)) to a ramp, and of the first lag alone, K."""
        t = np.clip(time, 0.0, None)
        slow, fast = np.exp(-t / second), np.exp(-t / first)
        both = t - first - second + (second**2 * slow - first**2 * fast) / (second - first)
        return rate * both, rate * (t - first * (1.0 - fast))

    records = []
    for begun in (6001.0, 7003.0, 9007.0, 11009.0, 13013.0, 15017.0, 17003.0, 8001.0):
        time = np.arange(0.0, 25000.0, 5.0)
        there, before = (a - b for a, b in zip(ramped(time - begun), ramped(time - begun - 180.0), strict=True))
        records.append(
            Record({"time_s": time, "housing_temperature_degC": 10.0 + before, "frequency_Hz": 4400.0 + there})
        )
    campaign = load_campaign(records)
    assert campaign.step / 5.0 >= 40.0
    for run in campaign.runs:
        model = average(run.states.with_lag(second).resonator, campaign.group)
        error = run.responses["frequency_Hz"] - 4400.0 - (model - 283.15)
        assert np.nanmax(np.abs(error)) < 1e-4
