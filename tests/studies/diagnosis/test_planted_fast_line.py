"""A line faster than the steps of the grid: resolved where a finer grid does, else said to be there; never taken for noise."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from compensation.noise import Noise
from studies.inference.diagnosis import blocks_of
from studies.inference.hypothesis import Hypothesis
from studies.record import Record
from studies.workbench import diagnose_records

pytestmark = pytest.mark.slow

ROWS, SAMPLING, LAG, NOISE = 2880, 5.0, 900.0, 4e-4  # rows a run, s, s, Hz


def a_campaign(period, size=3.0, runs=2, rows=ROWS):
    """Runs of 4 h, of a frequency that follows a chamber with one lag; a line beside it, 3 times the noise of a row."""
    rng = np.random.default_rng(11)
    records = []
    time = SAMPLING * np.arange(ROWS)
    for run, (low, high) in enumerate([(0.0, 40.0), (45.0, -5.0)]):
        chamber = np.interp(time, [0.0, 1800.0, 5400.0, 9000.0, 12600.0], [20.0, 20.0, low, high, 20.0])
        gyro = np.empty(ROWS)
        gyro[0] = warm = chamber[0]
        for k in range(1, ROWS):
            warm += (0.5 * (chamber[k] + chamber[k - 1]) - warm) * (1.0 - np.exp(-SAMPLING / LAG))
            gyro[k] = warm
        frequency = 5000.0 * (1.0 + 8e-5 * (gyro - 20.0) + 3e-8 * (gyro - 20.0) ** 2)
        frequency += NOISE * (rng.standard_normal(ROWS) + size * np.sin(2.0 * np.pi * time / period + 2.0 * run))
        columns = {"time_s": time, "housing_temperature_degC": chamber, "frequency_Hz": frequency}
        columns = {name: column[:rows] for name, column in columns.items()}
        records.append(Record(columns, path=f"run{run}.csv", sha256=str(run)))
    return records[:runs]


def amplitude(cause):
    """Of the first harmonic, whose phase in each run is its own."""
    return np.hypot(cause.parameters["sine_Hz"].value, cause.parameters["cosine_Hz"].value)


def test_without_a_line_the_blocks_are_the_usual_ones_and_what_is_left_decides():
    campaign = a_campaign(60.0, size=0.0)
    assert blocks_of(campaign) == blocks_of(a_campaign(17.0)) == 200
    found = diagnose_records(campaign)
    assert found.verdict.verdict == "adequate"
    left = found.left["frequency_Hz"]
    doubt = 4.0 + np.log(left.forms)  # the best of so many Bayes factors is above it in one of fifty
    states = [
        replace(found, left={"frequency_Hz": replace(left, evidence=evidence)}).verdict.verdict
        for evidence in (doubt - 0.1, doubt + 0.1, 11.9, 12.1)
    ]  # nothing is said to be adequate beside more than noise leaves
    assert states == ["adequate", "not-identifiable", "not-identifiable", "unexplained"]


def test_a_line_of_less_than_two_steps_is_named_on_a_finer_grid():
    campaign = a_campaign(60.0)
    assert ROWS * SAMPLING / blocks_of(campaign) <= 60.0 / 2.5
    verdict = diagnose_records(campaign).verdict
    (cause,) = verdict.causes
    assert (verdict.verdict, cause.effect) == ("explained", "periodic")
    assert cause.parameters["period_s"].value == pytest.approx(60.0, abs=0.02)
    assert verdict.responses["frequency_Hz"].noise == pytest.approx(NOISE, rel=0.05)


def test_a_line_that_no_grid_resolves_is_said_to_be_there():
    """Means over a block show nothing of it: fitted, the record is as good as noise, and its noise is 2.3 times too large."""
    verdict = diagnose_records(a_campaign(17.0)).verdict
    result = verdict.responses["frequency_Hz"]
    assert verdict.verdict == "unexplained"
    assert result.left_over == "structure"
    assert "a line of 17 s" in result.left_over_input
    assert "a part of at most 1.3 h" in verdict.next_experiment


def test_a_shorter_stretch_resolves_it():
    """A row is then a step, a reading at a moment: the amplitude is that of the line, not that of its means."""
    verdict = diagnose_records(a_campaign(17.0, runs=1, rows=900)).verdict
    (cause,) = verdict.causes
    assert (verdict.verdict, cause.effect) == ("explained", "periodic")
    assert cause.parameters["period_s"].value == pytest.approx(17.0, abs=1e-3)
    assert amplitude(cause) == pytest.approx(3.0 * NOISE, rel=0.03)


def test_a_line_between_the_scanned_periods_stands_out_of_noise_that_has_taken_it_in(fine):
    """Of a grid too long to be weighed every fifth period is; between two of them a line of a dozen turns was correlated noise."""
    search, name = diagnose_records(a_campaign(60.0, size=0.0)).search, "frequency_Hz"
    rows, noise = search.linear.rows[name], Noise(NOISE * SAMPLING**0.5, markov=2.0 * NOISE, markov_time=600.0)
    time, length = np.concatenate(rows.times), ROWS * SAMPLING
    for turns in (9.0, 10.3, 11.2, 12.4, 13.1):
        line = 3.0 * NOISE * np.sin(2.0 * np.pi * turns * time / length)
        there = copy(search)
        there.linear = replace(search.linear, target={name: search.linear.target[name] + line})
        first = there.scan(Hypothesis((), {name: noise}, 0.0), less=())[0]
        assert first.term.effect.name == "periodic"
        assert length / first.term.shape[0] == pytest.approx(turns, abs=0.25)
