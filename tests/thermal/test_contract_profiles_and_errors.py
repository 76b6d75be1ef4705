"""The language of chamber profiles; what cannot be computed is refused with a message that names the place and the mend."""

import numpy as np
import pytest

from thermal.errors import ThermalError
from thermal.lag import lag
from thermal.network import Boundary, Conductor, Node, Radiator, Source, assemble, linearise
from thermal.profile import Profile, constant, parse_profile
from thermal.radiative import integrate
from thermal.steady import find_steady_state
from thermal.transient import propagate

ROOM = (Boundary("chamber"), Node("shell", 2.0))
LINK = Conductor("chamber", "shell", 1e-3)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ([Boundary("chamber"), Node("shell", -2.0), LINK], "heat capacity of node 'shell' must be positive, not -2"),
        ([Boundary("chamber"), Node("shell", float("nan")), LINK], "must be positive, not nan"),
        ([*ROOM, Conductor("chamber", "shell", -1.0)], "conductance 'chamber-shell' must be positive"),
        ([*ROOM, LINK, Radiator("chamber", "shell", 0.0)], "exchange area 'chamber-shell' must be positive"),
        ([*ROOM, Conductor("chambr", "shell", 1.0)], "'chambr', which is not a node; did you mean 'chamber'"),
        ([*ROOM, LINK, Source("shel", 1.0)], "heats 'shel', which is not a node; did you mean 'shell'"),
        ([*ROOM, LINK, Source("shell", float("inf"))], "power put into 'shell' must be a number"),
        ([*ROOM, LINK, Node("stem", 1.0)], "node 'stem' is isolated"),
        ([*ROOM, LINK, Node("a", 1.0), Node("b", 1.0), Conductor("a", "b", 1.0)], "no path leads from 'a', 'b'"),
        ([Node("a", 1.0), Node("b", 1.0), Conductor("a", "b", 1.0)], "has no boundary"),
        ([Boundary("chamber")], "has no node"),
        ([*ROOM, LINK, Node("shell", 1.0)], "'shell' is given to more than one"),
        ([*ROOM, LINK, Conductor("shell", "shell", 1.0)], "joins a node to itself"),
    ],
)
def test_a_network_that_cannot_be_is_refused(parts, words):
    with pytest.raises(ThermalError, match=words):
        assemble(parts)


@pytest.mark.parametrize(
    ("time", "value", "words"),
    [
        ([0.0, 2.0, 1.0], [300.0, 300.0, 300.0], r"runs backwards at row 3 \(2 s, then 1 s\)"),
        ([0.0, 1.0, 1.0, 1.0, 2.0], [1.0] * 5, "three times"),
        ([0.0, 1.0], [300.0, float("nan")], "gap: row 2"),
        ([0.0], [300.0], "two or more"),
        ([0.0, 1.0], [300.0], "two or more"),
        ([0.0, 0.0], [300.0, 310.0], "no duration"),
    ],
)
def test_a_profile_that_cannot_be_is_refused(time, value, words):
    with pytest.raises(ThermalError, match=words):
        Profile(np.array(time), np.array(value))


NETWORK = assemble([*ROOM, LINK])
HOUR = constant(300.0, 3600.0)
IMPOSSIBLE = {
    "the boundary 'chamber' has no temperature": lambda: propagate(NETWORK, {}),
    "no boundary 'room'; it has chamber": lambda: propagate(NETWORK, {"chamber": HOUR, "room": HOUR}),
    "linearise the network or integrate it": lambda: propagate(
        assemble([*ROOM, Radiator("chamber", "shell", 1e-3)]), {"chamber": HOUR}
    ),
    "reaches 0 K": lambda: propagate(NETWORK, {"chamber": constant(-10.0, 3600.0)}),
    "1 temperatures above 0 K": lambda: propagate(NETWORK, {"chamber": HOUR}, initial=[300.0, 300.0]),
    "covers only 0 to 3600 s": lambda: propagate(NETWORK, {"chamber": HOUR}).at([4000.0]),
    "no node 'shel'": lambda: propagate(NETWORK, {"chamber": HOUR}).node("shel", [0.0]),
    "must all cover the same time": lambda: propagate(
        assemble([*ROOM, LINK, Source("shell", constant(1.0, 60.0))]), {"chamber": HOUR}
    ),
    "250000 rows; average it to at most 200000": lambda: propagate(
        NETWORK, {"chamber": Profile(np.arange(250_000.0), np.full(250_000, 300.0))}
    ),
    r"heat capacity of node 'shell' must be positive, not .* K\)": lambda: integrate(
        assemble([Boundary("chamber"), Node("shell", lambda T: T - 270.0), LINK]),
        {"chamber": parse_profile("step 20 -10 5h")},
    ),
    "covers only 0 to 18000 s": lambda: parse_profile("step 20 -80 5h").at([18001.0]),
    r"reaches -80 °C at 0 s, outside fused silica \(-60 to 150 °C\)": lambda: parse_profile(
        "step 20 -80 5h"
    ).require_within(213.15, 423.15, "fused silica"),
    "above 0 K": lambda: find_steady_state(NETWORK, {"chamber": -20.0}),
    "above 0 K, not at -10 K": lambda: linearise(NETWORK, -10.0),
    "must increase from row to row": lambda: lag([0.0, 1.0, 1.0], [300.0, 300.0, 300.0], 10.0),
    "time constant must be positive": lambda: lag([0.0, 1.0], [300.0, 300.0], 0.0),
}


@pytest.mark.parametrize("words", IMPOSSIBLE)
def test_what_cannot_be_computed_is_refused(words):
    with pytest.raises(ThermalError, match=words):
        IMPOSSIBLE[words]()


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
        ("staircase 0 30 1e-8 1h", "at most 10000 steps"),
        ("soak -300 1h", "below absolute zero"),
        ("soak 20 1h then", "empty part"),
        ("soak 20 1h, soak 30 1h", "has 5 values after 'soak', not 2"),
    ],
)
def test_errors_show_the_form(words, message):
    with pytest.raises(ThermalError, match=message):
        parse_profile(words)
