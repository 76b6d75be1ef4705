"""What a plan must predict in the limits: nothing where there is nothing to see, sets where no record can tell."""

from dataclasses import replace

import numpy as np
import pytest

from studies.diagnosis.plan import imagine, predict

WORDS = "cycle 20 -15 40 0.5 30min 1"


def planned(response):
    return replace(imagine([WORDS], np.random.default_rng(3)), responses=(response,))


@pytest.fixture(scope="module")
def loud():
    return predict(planned("frequency_Hz"), 10.0, 6, np.random.default_rng(4))


def test_clock_drift_and_ageing_are_always_a_set(loud):
    for effect, twin in (("clock-drift", "ageing"), ("ageing", "clock-drift")):
        assert loud.confusion[effect][effect] > 0
        assert loud.sets[effect][twin] == pytest.approx(loud.confusion[effect][effect])


def test_effects_without_their_drive_cannot_show(loud):
    for effect in ("electrostatic-softening", "amplitude-frequency", "self-heating"):
        assert effect in loud.invisible
        assert effect not in loud.confusion


def test_a_loud_effect_is_not_overlooked(loud):
    for effect in ("curvature", "jump", "periodic (frequency_Hz)", "thermometer-scale", "activity-dip"):
        assert loud.outcome(effect)["named"] == pytest.approx(1.0)


def test_an_effect_far_below_the_noise_is_nothing():
    plan = predict(planned("bias_deg_per_h"), 1e-4, 20, np.random.default_rng(5))
    for effect in plan.confusion:
        outcome = plan.outcome(effect)
        assert sum(outcome.values()) == pytest.approx(1.0)
        assert outcome["nothing"] >= 0.9


def test_the_baseline_takes_a_part_of_a_cubic_and_is_no_finding_itself(loud):
    assert 0.0 < loud.survives["curvature"] < 1.0
    assert "calibration" not in loud.confusion
