"""What cannot be computed is refused with a message that names the place and the mend."""

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


def test_capacity_that_becomes_negative_on_the_way_is_refused():
    network = assemble([Boundary("chamber"), Node("shell", lambda T: T - 270.0), LINK])
    with pytest.raises(ThermalError, match=r"heat capacity of node 'shell' must be positive, not .* K\)"):
        integrate(network, {"chamber": parse_profile("step 20 -10 5h")})


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


def test_a_profile_is_not_read_outside_its_time_or_used_outside_the_materials_range():
    profile = parse_profile("step 20 -80 5h")
    with pytest.raises(ThermalError, match="covers only 0 to 18000 s"):
        profile.at([18001.0])
    with pytest.raises(ThermalError, match=r"reaches -80 °C at 0 s, outside fused silica \(-60 to 150 °C\)"):
        profile.require_within(213.15, 423.15, "fused silica")


def test_transients_refuse_what_they_lack():
    network = assemble([*ROOM, LINK])
    radiative = assemble([*ROOM, Radiator("chamber", "shell", 1e-3)])
    hour = constant(300.0, 3600.0)
    with pytest.raises(ThermalError, match="the boundary 'chamber' has no temperature"):
        propagate(network, {})
    with pytest.raises(ThermalError, match="no boundary 'room'; it has chamber"):
        propagate(network, {"chamber": hour, "room": hour})
    with pytest.raises(ThermalError, match="linearise the network or integrate it"):
        propagate(radiative, {"chamber": hour})
    with pytest.raises(ThermalError, match="reaches 0 K"):
        propagate(network, {"chamber": constant(-10.0, 3600.0)})
    with pytest.raises(ThermalError, match="1 temperatures above 0 K"):
        propagate(network, {"chamber": hour}, initial=[300.0, 300.0])
    with pytest.raises(ThermalError, match="covers only 0 to 3600 s"):
        propagate(network, {"chamber": hour}).at([4000.0])
    with pytest.raises(ThermalError, match="no node 'shel'"):
        propagate(network, {"chamber": hour}).node("shel", [0.0])
    with pytest.raises(ThermalError, match="must all cover the same time"):
        propagate(assemble([*ROOM, LINK, Source("shell", constant(1.0, 60.0))]), {"chamber": hour})


def test_a_profile_of_millions_of_rows_is_refused():
    network = assemble([*ROOM, LINK])
    t = np.arange(250_000.0)
    with pytest.raises(ThermalError, match="250000 rows; average it to at most 200000"):
        propagate(network, {"chamber": Profile(t, np.full(t.size, 300.0))})


def test_other_impossible_numbers_are_refused():
    with pytest.raises(ThermalError, match="above 0 K"):
        find_steady_state(assemble([*ROOM, LINK]), {"chamber": -20.0})
    with pytest.raises(ThermalError, match="above 0 K, not at -10 K"):
        linearise(assemble([*ROOM, LINK]), -10.0)
    with pytest.raises(ThermalError, match="must increase from row to row"):
        lag([0.0, 1.0, 1.0], [300.0, 300.0, 300.0], 10.0)
    with pytest.raises(ThermalError, match="time constant must be positive"):
        lag([0.0, 1.0], [300.0, 300.0], 0.0)
