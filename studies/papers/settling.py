"""Figure 3 of the HRG paper and the soak error of its Table 1, by the heat path of a card.

The paper gives no heat path. Its text around Figure 3 is read as: 95 % of a chamber step made after 9 000 s, less than
1 % left after 15 000 s. The first statement identifies one constant, the conductance of the mount; the second is then a
prediction. A campaign of points that all start at room temperature leaves, at each, the same share of its step if the
network is linear, which hides in the slope; radiation leaves more on the cold side than on the hot one. Points that
follow each other upwards leave the same share of 10 °C each, which hides in the offset.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shell.constants import zero_Celsius
from shell.law import FrequencyLaw
from studies.law import law_of
from studies.simulation.heat_path import build_network, build_shell_and_stem
from studies.simulation.response import cell_weights
from thermal.network import Network
from thermal.profile import Profile
from thermal.radiative import simulate
from thermal.resonator import shell_weights
from thermal.settling import identify_conductance, step_remaining

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

Array = NDArray[np.float64]
ROOM_degC = 20.0
STEPS_degC = (-10.0, 40.0)
POINTS_degC = np.arange(-20.0, 41.0, 10.0)
FAST, SETTLED = 9000.0, 15000.0
REMAINING = 0.05
END = 18000.0
PROTOCOLS = ("from room", "upwards")
NETWORKS = ("radiative", "linear", "shell and stem alone")


@dataclass(frozen=True)
class StepCurve:
    """One step of the chamber in one network: share of it left (of the resonator's mean) and frequency."""

    network: str
    target_degC: float
    time: Array
    remaining: Array
    frequency: Array

    def left_at(self, time: float) -> float:
        """Share of the step left at a time (s)."""
        return float(np.interp(time, self.time, self.remaining))

    def time_to(self, share: float) -> float:
        """Time (s) at which a share is left."""
        return float(np.interp(-share, -self.remaining, self.time))


@dataclass(frozen=True)
class SoakResult:
    """What a soak of `hours` adds to the points of Table 1 in one network.

    `protocol`: every point "from room" temperature, or one after another "upwards" from a settled first one. `error` (Hz) is the frequency read minus the settled one; `slope` (ppm/°C at 20 °C) and `curvature` (ppm/°C², twice
    the quadratic coefficient of ln f) are what it adds to a quadratic through the seven points.
    """

    protocol: str
    network: str
    hours: float
    error: Array
    slope: float
    curvature: float


@dataclass(frozen=True)
class SettlingStudy:
    """Figure 3 and the soak campaigns of one card, beside the measured and the card's own slope and curvature."""

    curves: tuple[StepCurve, ...]
    soaks: tuple[SoakResult, ...]
    measured_slope: float
    measured_curvature: float
    law_slope: float
    law_curvature: float


def identify_mount(instrument: "Instrument") -> float:
    """Find the mount's conductance (W/K) that leaves 5 % at 9 000 s, the mean of the two steps of Figure 3.

    What is left is that of the temperature which the frequency sees.
    """
    weights = cell_weights(instrument, _law(instrument))

    def remaining(conductance: float) -> float:
        changed = instrument.with_values({"thermal.mount_conductance_W_per_K": conductance})
        network = build_network(changed, radiation=True)
        row = shell_weights(tuple(node.name for node in network.nodes), weights)
        room = ROOM_degC + zero_Celsius
        left = [step_remaining(network, room, T + zero_Celsius, row, [FAST])[0] for T in STEPS_degC]
        return float(np.mean(left))

    return identify_conductance(remaining, REMAINING)


def study_settling(instrument: "Instrument", hours: tuple[float, ...] = (4.0, 4.5, 5.0)) -> SettlingStudy:
    """Compute Figure 3 and the soak errors of Table 1 in the radiative and the linear network."""
    from studies.papers.hrg import printed_table1

    law = _law(instrument)
    weights = cell_weights(instrument, law)
    networks = dict(zip(NETWORKS, _networks(instrument), strict=True))
    curves = [
        _curve(name, network, weights, law, target) for target in STEPS_degC for name, network in networks.items()
    ]
    soaks = [
        _soak(protocol, name, networks[name], weights, law, hour)
        for protocol in PROTOCOLS
        for hour in hours
        for name in NETWORKS[:2]
    ]
    T, f = printed_table1()
    settled = law.frequency(POINTS_degC + zero_Celsius)
    return SettlingStudy(
        tuple(curves), tuple(soaks), *_slope_and_curvature(T, f), *_slope_and_curvature(POINTS_degC, settled)
    )


def _networks(instrument: "Instrument") -> tuple[Network, Network, Network]:
    return (
        build_network(instrument, radiation=True),
        build_network(instrument, radiation=False),
        build_shell_and_stem(instrument),
    )


def _curve(name: str, network: Network, weights: Array, law: FrequencyLaw, target_degC: float) -> StepCurve:
    time = np.linspace(0.0, END, 721)
    room, target = ROOM_degC + zero_Celsius, target_degC + zero_Celsius
    row = shell_weights(tuple(node.name for node in network.nodes), weights)
    left = step_remaining(network, room, target, row, time)
    return StepCurve(name, target_degC, time, left, law.frequency(target + (room - target) * left))


def _soak(protocol: str, name: str, network: Network, weights: Array, law: FrequencyLaw, hours: float) -> SoakResult:
    """Read every point after `hours`."""
    row = shell_weights(tuple(node.name for node in network.nodes), weights)
    reach = _reach_from_room if protocol == PROTOCOLS[0] else _reach_upwards
    settled, read = law.frequency(POINTS_degC + zero_Celsius), law.frequency(reach(network, row, 3600 * hours))
    with_soak, without = _slope_and_curvature(POINTS_degC, read), _slope_and_curvature(POINTS_degC, settled)
    return SoakResult(protocol, name, hours, read - settled, with_soak[0] - without[0], with_soak[1] - without[1])


def _reach_from_room(network: Network, row: Array, soak: float) -> Array:
    """Temperatures (K) that the points reach when each starts from room temperature, as in the paper's Figure 3."""
    room, points = ROOM_degC + zero_Celsius, POINTS_degC + zero_Celsius
    left = [0.0 if T == room else step_remaining(network, room, T, row, [soak])[0] for T in points]
    return np.asarray(points + (room - points) * np.array(left))


def _reach_upwards(network: Network, row: Array, soak: float) -> Array:
    """Temperatures (K) that the points reach when they follow each other, the first one settled."""
    times = soak * np.arange(len(POINTS_degC) + 1)
    corners = Profile(np.repeat(times, 2)[1:-1], np.repeat(POINTS_degC + zero_Celsius, 2))
    transient = simulate(network, {boundary.name: corners for boundary in network.boundaries})
    return transient.observe(times[1:], row[None, :])[:, 0]


def _slope_and_curvature(T: Array, f: Array) -> tuple[float, float]:
    """Slope at 20 °C (ppm/°C) and curvature (ppm/°C²) of a quadratic through ln f."""
    c = np.polynomial.Polynomial.fit(T - 20.0, np.log(f), 2).convert().coef
    return float(1e6 * c[1]), float(2e6 * c[2])


def _law(instrument: "Instrument") -> FrequencyLaw:
    low, high = POINTS_degC[[0, -1]] + zero_Celsius
    return law_of(instrument, low - 5, high + 5)
