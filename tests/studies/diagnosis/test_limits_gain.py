"""Limit: a block that alone sees the start of a run cannot make the held-out figure explode."""

import numpy as np
import pytest

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.held_out import _trained
from studies.diagnosis.investigate import investigate
from studies.record import Record


@pytest.mark.slow
def test_initial_state_that_one_block_alone_sees_is_refitted_there():
    """A resonator that follows its housing at once: e^(−t/τ) is over before the second block begins."""
    t = np.arange(0.0, 15000.0, 10.0)
    housing = 20 + 10 * np.sin(t / 500)
    frequency = 4432 + 0.35 * (housing - 20) + 1e-3 * np.random.default_rng(8).standard_normal(t.size)
    record = Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": frequency})
    found = investigate(load_campaign([record]), advise=False).verdict.as_dict()["responses"]["frequency_Hz"][
        "baseline"
    ]
    assert found["held_out_rms"] is not None
    assert found["held_out_rms"] < 1.1 * found["residual_rms"]


@pytest.mark.slow
def test_a_start_far_from_equilibrium_does_not_spoil_a_single_run():
    """30 K from equilibrium, which is 10⁴ times the noise; two hours later nothing of it is left."""
    t = np.arange(0.0, 36000.0, 10.0)
    housing = 20 + 10 * np.sin(t / 2000)
    resonator = np.empty_like(t)
    resonator[0] = -10.0
    for k in range(1, t.size):
        resonator[k] = resonator[k - 1] + 10.0 / 800.0 * (0.5 * (housing[k] + housing[k - 1]) - resonator[k - 1])
    frequency = 4432 + 0.35 * (resonator - 20) + 1e-3 * np.random.default_rng(9).standard_normal(t.size)
    record = Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": frequency})
    found = investigate(load_campaign([record]), advise=False).verdict.as_dict()["responses"]["frequency_Hz"][
        "baseline"
    ]
    assert found["held_out_rms"] < 1.1 * found["residual_rms"]
    assert found["residual_rms"] < 1.1e-3


def test_a_block_that_leaves_no_row_for_the_fit_is_not_held_out():
    """Gaps on both sides of a block may take in all rows that have a value."""
    t = np.arange(0.0, 7200.0, 10.0)
    housing = 20 + 10 * np.sin(t / 900)
    frequency = 4432 + 0.35 * (housing - 20) + 1e-3 * np.random.default_rng(10).standard_normal(t.size)
    campaign = load_campaign([Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": frequency})])
    found = investigate(campaign, advise=False, score_held_out=False).inquiries["frequency_Hz"].plain
    assert _trained(found, campaign, [np.zeros(run.time.shape, dtype=bool) for run in campaign.runs]) is None
