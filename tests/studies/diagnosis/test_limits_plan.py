"""What a plan must predict in the limits: nothing where there is nothing to see, sets where no record can tell."""

from dataclasses import replace

import numpy as np
import pytest

from studies.diagnosis.planning.chamber import limited, parse_chamber
from studies.diagnosis.planning.plan import Outlook, Plan, imagine, predict, require_reach
from studies.errors import InputError
from studies.reports.plan import headline, plan_parts, plan_table
from studies.results import Result
from studies.results.page import render_result
from thermal.profile import parse_profile

WORDS = "cycle 20 -15 40 0.5 30min 1"


def planned(response):
    return replace(imagine([WORDS], np.random.default_rng(3)), responses=(response,))


@pytest.fixture(scope="module")
def loud():
    return predict(planned("frequency_Hz"), [10.0], 6, np.random.default_rng(4)).close


def test_clock_drift_and_ageing_are_always_a_set(loud):
    for effect, twin in (("clock-drift", "ageing"), ("ageing", "clock-drift")):
        assert loud.confusion[effect][effect] > 0
        assert loud.sets[effect][twin] == pytest.approx(loud.confusion[effect][effect])


def test_a_reference_clock_parts_what_no_run_does(loud):
    clock = next(pairs for sensor, pairs in loud.sensors.items() if "reference clock" in sensor)
    assert "ageing / clock-drift" in clock
    assert len(next(iter(loud.sensors.values()))) == max(map(len, loud.sensors.values()))


def test_a_reference_clock_parts_nothing_in_the_loss():
    """Ageing of 1/Q and a leak were once told apart by a clock."""
    plan = Plan(1.0, 4, {}, {"ageing (inverse_q)": {"leak": 0.5}, "ageing": {"clock-drift": 0.5}}, {}, {}, {}, {}, 1.0)
    assert plan.sensors["a reference clock (reference_frequency_Hz)"] == ["ageing / clock-drift"]


def test_a_plan_beyond_the_chamber_is_refused():
    chamber = parse_chamber("rate 3 range -40 85")
    require_reach(chamber, "ramp 20 -10 3")
    with pytest.raises(InputError, match="reaches -40 to 85"):
        require_reach(chamber, "soak -60 5h")
    with pytest.raises(InputError, match="10 K/min"):
        require_reach(chamber, "ramp 20 60 10")


@pytest.mark.parametrize(
    "words", ["step 20 -10 5h", "soak 20 1h then soak -35 5400s", "step 20 -10 5h then ramp -10 40 9"]
)
def test_words_of_every_form_keep_to_the_chamber(words):
    profile = parse_profile(limited(words, 3.0))
    assert (np.abs(np.diff(profile.value)) <= 3.001 / 60.0 * np.diff(profile.time)).all()
    assert (profile.value[0], profile.value[-1]) == (parse_profile(words).value[0], parse_profile(words).value[-1])


def test_a_planned_step_starts_where_the_gyro_has_settled():
    """The set point jumps at once; the housing has not."""
    housing = imagine(["step 20 -10 5h"], np.random.default_rng(1)).runs[0].states.housing - 273.15
    assert housing[0] == pytest.approx(20.0, abs=0.5)
    assert housing[-1] == pytest.approx(-10.0, abs=0.1)


def test_effects_without_their_drive_cannot_show(loud):
    for effect in ("electrostatic-softening", "amplitude-frequency", "self-heating"):
        assert effect in loud.invisible
        assert effect not in loud.confusion


def test_a_loud_effect_is_not_overlooked(loud):
    for effect in ("curvature", "jump", "periodic (frequency_Hz)", "thermometer-scale", "activity-dip", "radiation"):
        assert loud.outcome(effect)["named"] == pytest.approx(1.0)


def test_an_effect_far_below_the_noise_is_nothing():
    plan = predict(planned("bias_deg_per_h"), [1e-4], 20, np.random.default_rng(5)).close
    for effect in plan.confusion:
        outcome = plan.outcome(effect)
        assert sum(outcome.values()) == pytest.approx(1.0)
        assert outcome["nothing"] >= 0.9


def test_the_baseline_takes_a_part_of_a_cubic_and_is_no_finding_itself(loud):
    assert 0.0 < loud.survives["curvature"] < 1.0
    assert "calibration" not in loud.confusion


def test_white_noise_and_slow_noise_make_up_the_whole(loud):
    for effect, said in loud.confusion.items():
        halves = [loud.by_noise[noise][effect].get(effect.split(" ")[0], 0.0) for noise in ("white", "slow")]
        assert np.mean(halves) == pytest.approx(said.get(effect.split(" ")[0], 0.0))


def made_up(snr, **named):
    confusion = {name: {name: share, "nothing": 1.0 - share} for name, share in named.items()}
    halves = {"white": confusion, "slow": confusion}
    return Plan(
        snr, 10, confusion, {name: {} for name in named}, halves, dict.fromkeys(named, 0.5), {"leak": "no wall"}
    )


def test_the_smallest_effect_is_named_at_every_larger_size_too():
    outlook = Outlook(
        (
            made_up(1.0, jump=1.0, ageing=0.8, curvature=0.95),
            made_up(0.3, jump=0.9, ageing=1.0, curvature=0.5),
            made_up(0.1, jump=0.2, ageing=1.0, curvature=0.0),
        )
    )
    assert [outlook.smallest(name) for name in ("jump", "ageing", "curvature", "leak")] == [0.3, None, 1.0, None]
    words = headline(outlook)
    assert "2 of 3 at SNR 1, 1 of 3 at SNR 0.3, 0 of 3 at SNR 0.1" in words
    assert "Not even at SNR 1: ageing" in words
    assert "Not testable (no wall): leak" in words
    rows = {row[0]: row[1:4] for row in plan_table(outlook).cells()[1]}
    assert rows["jump (frequency)"] == ["100", "90", "20"]
    parts = plan_parts(outlook, ["cycle 20 -15 40 0.5 30min 1"])
    page = render_result(Result({}, "Planned campaign", words, parts))
    assert "cycle 20 -15 40 0.5 30min 1" in page
    assert words.split(".")[0] in page
