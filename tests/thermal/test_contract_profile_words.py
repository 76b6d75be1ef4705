"""The language of chamber profiles."""

import numpy as np
import pytest

from thermal.errors import ThermalError
from thermal.profile import parse_profile


def degrees(words):
    profile = parse_profile(words)
    return profile.time.tolist(), (profile.value - 273.15).round(9).tolist()


@pytest.mark.parametrize(
    ("words", "time", "temperature"),
    [
        ("soak 20 2h", [0, 7200], [20, 20]),
        ("step 20 -10 5h", [0, 0, 18000], [20, -10, -10]),
        ("ramp 20 -20 0.5", [0, 4800], [20, -20]),
        ("staircase -20 0 10 30min", [0, 1800, 1800, 3600, 3600, 5400], [-20, -20, -10, -10, 0, 0]),
        ("staircase 10 0 10 90s", [0, 90, 90, 180], [10, 10, 0, 0]),
        ("cycle 20 0 40 2 600 1", [0, 600, 1200, 2400, 3000, 3600], [20, 0, 0, 40, 40, 20]),
        ("cycle 0 0 30 1 10min 2", [0, 600, 2400, 3000, 4800, 5400, 7200, 7800, 9600], [0, 0, 30, 30, 0, 0, 30, 30, 0]),
        ("soak 20 1h then soak 30 1h", [0, 3600, 3600, 7200], [20, 20, 30, 30]),
        ("soak 20 1h then ramp 20 30 1", [0, 3600, 4200], [20, 20, 30]),
        ("soak 20 1h then step 25 30 1h", [0, 3600, 3600, 7200], [20, 20, 30, 30]),
        ("step 20 0 10  then  step 0 20 10", [0, 0, 10, 10, 20], [20, 0, 0, 20, 20]),
    ],
)
def test_words_become_corners(words, time, temperature):
    assert degrees(words) == (time, temperature)


def test_the_value_at_a_jump_is_the_one_after_it():
    profile = parse_profile("step 20 -10 1h then soak 30 1h")
    assert profile.at([0.0, 3599.0, 3600.0, 7200.0]) - 273.15 == pytest.approx([-10, -10, 30, 30])
    assert profile.value[0] - 273.15 == pytest.approx(20.0)
    assert profile.jumps.tolist() == [0.0, 3600.0]
    value, slope = parse_profile("ramp 0 60 1").segments([0.0, 1800.0, 3600.0])
    assert value - 273.15 == pytest.approx([0.0, 30.0, 60.0])
    assert slope == pytest.approx(np.full(3, 1 / 60))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "A profile is one of: soak T DURATION"),
        ("jump 20 30", "'jump' is not a kind of profile"),
        ("step 20 -10", "has 2 values after 'step', not 3; write 'step FROM TO DURATION'"),
        ("step 20 cold 5h", "TO must be a number, not 'cold'"),
        ("soak 20 5d", "a duration such as 5h, 30min or 90s"),
        ("soak 20 -5h", r"DURATION .* must be positive, not -5h"),
        ("soak 20 nan", "DURATION must be a duration such as 5h, 30min or 90s, not 'nan'"),
        ("ramp 20 20 1", "changes nothing"),
        ("ramp 20 40 0", r"RATE \(K/min\) must be positive"),
        ("staircase -20 40 7 1h", "steps of 7 K do not lead from -20 to 40"),
        ("cycle 20 0 40 1 1h 1.5", "whole number of times"),
        ("cycle 20 0 40 1 1h 1e12", "at most 10000 cycles"),
        ("staircase 0 40 0.001 1h", "at most 10000 steps"),
        ("soak -300 1h", "below absolute zero"),
        ("soak 20 1h then", "empty part"),
        ("soak 20 1h, soak 30 1h", "has 5 values after 'soak', not 2"),
    ],
)
def test_errors_show_the_form(words, message):
    with pytest.raises(ThermalError, match=message):
        parse_profile(words)
