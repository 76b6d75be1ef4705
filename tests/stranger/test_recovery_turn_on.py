"""Offsets of turn-ons in runs of this file's own making: at one temperature, nothing simulated."""

import numpy as np
import pytest

from studies.calibration.calibrate import calibrate
from studies.instrument.card import load_card
from studies.record import Record


def _run(offset, random):
    return Record(
        {
            "time_s": np.arange(0.0, 2400.0, 60.0),
            "housing_temperature_degC": 20.0 + 5e-3 * random.standard_normal(40),
            "bias_deg_per_h": 3.0 + offset + 0.05 * random.standard_normal(40),
        }
    )


@pytest.mark.slow
def test_what_a_card_states_of_its_turn_ons_is_no_contradiction():
    """Runs that scatter as stated are of one device; one that lies sixteen times as far is asked about, card or no card."""
    random, offsets = np.random.default_rng(5), (-0.4, 0.2, 0.6)
    exact = {"bias.damping_anisotropy": {"value": 0.01, "sd": 0.0}, "noise.bias_turn_on_deg_per_h": 0.5}
    card = load_card("hrg-30mm").with_values(exact)
    runs = [_run(offset, random) for offset in offsets]
    found = calibrate(card, runs, profile=False)
    assert not [warning for warning in found.warnings if "contradict" in warning]
    assert found.instrument.noise.bias_turn_on_deg_per_h == pytest.approx(np.std(offsets, ddof=1), rel=0.3)
    far = calibrate(card, [runs[0], _run(8.0, random)], profile=False)
    assert [warning for warning in far.warnings if "the card states 0.5 from run to run" in warning]
