"""Limits: when held-out rows decide between two models, and what a static curve of the frequency leaves to the bias."""

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.held_out import compare
from studies.diagnosis.investigate import investigate
from studies.effects import find_effect
from studies.effects.states import States
from studies.record import Record
from thermal.lag import lag


def parts(*levels):
    """Rests of constant size, one a part, all of them known."""
    return [(np.full(50, float(level)), np.ones(50, dtype=bool)) for level in levels]


def test_a_difference_is_sure_where_the_parts_agree():
    found = compare(parts(2.0, 2.0, 2.0), parts(1.8, 1.9, 1.7))
    assert found.sure
    assert found.pays
    worse = compare(parts(1.8, 1.9, 1.7), parts(2.0, 2.0, 2.0))
    assert worse.sure
    assert not worse.pays


def test_a_difference_that_changes_sign_from_part_to_part_decides_nothing():
    """One part gains 0.40, another loses 0.44 in square: the sum is a tenth of its scatter."""
    found = compare(parts(2.0, 2.0), parts(1.9, 2.107))
    assert abs(found.after - found.before) > 0.001
    assert not found.sure


def test_a_jump_relaxes_as_the_mean_over_each_step_of_the_grid():
    """Against a sum over a hundred times finer steps; what relaxes is gone in later runs, what stays is not."""
    effect, step, moment = find_effect("jump"), 240.0, 1000.0

    def states(run, spacing):
        time = spacing * (np.arange(round(4800.0 / spacing)) + 0.5)
        return States(run, time, time, time, time, 600.0, 293.0)

    coarse = effect.columns(states(0, step), (0.0, moment, 1.0), "frequency_Hz")
    fine = effect.columns(states(0, step / 100.0), (0.0, moment, 1.0), "frequency_Hz")
    np.testing.assert_allclose(coarse, fine.reshape(20, 100, -1).mean(axis=1), atol=1e-12)
    later = effect.columns(states(1, step), (0.0, moment, 1.0), "frequency_Hz")
    assert np.all(later[:, 0] == 1.0)
    assert not later[:, 1:].any()


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
    verdict = investigate(load_campaign([Record(columns)]), score_held_out=False, advise=False).verdict
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
    verdict = investigate(load_campaign([Record(columns)]), advise=False).verdict
    assert verdict.verdict == "not-identifiable"
    assert all("too short to judge" in one.remark for one in verdict.responses.values())
