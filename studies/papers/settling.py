"""Figure 3 of the HRG paper and the soak error of its Table 1, by the heat path of a card.

The text is read as: 95 % of a step made after 9 000 s, which identifies the mount's conductance, and under 1 % left
after 15 000 s, a prediction. Points that all start at room temperature leave the same share of each step, which hides
in the slope (radiation leaves more when cold); points that follow each other upwards leave an offset.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.law import FrequencyLaw
from studies.instrument.card import Instrument
from studies.papers.hrg import printed_table1
from studies.reports import style
from studies.resonator.law import law_of
from studies.results import Chapter, Column, Drawing, Figure, Sentence, Table
from studies.simulation.heat_path import build_network, build_shell_and_stem
from studies.simulation.response import cell_weights
from thermal.network import Network
from thermal.profile import Profile
from thermal.radiative import simulate, step_remaining
from thermal.resonator import shell_weights

ROOM_degC = 20.0
STEPS_degC = (-10.0, 40.0)
POINTS_degC = np.arange(-20.0, 41.0, 10.0)
FAST, SETTLED = 9000.0, 15000.0
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
    """What a soak of `hours` adds to the points of Table 1 in one network: to a quadratic through the seven points."""

    protocol: str  # every point "from room" temperature, or one after another "upwards" from a settled first one
    network: str
    hours: float
    error: Array  # Hz, read minus settled
    slope: float  # ppm/°C at 20 °C
    curvature: float  # ppm/°C², twice the quadratic coefficient of ln f


@dataclass(frozen=True)
class SettlingStudy:
    """Figure 3 and the soak campaigns of one card, beside the measured and the card's own slope and curvature."""

    curves: tuple[StepCurve, ...]
    soaks: tuple[SoakResult, ...]
    measured_slope: float
    measured_curvature: float
    law_slope: float
    law_curvature: float


def study_settling(instrument: Instrument, hours: tuple[float, ...] = (4.0, 4.5, 5.0)) -> SettlingStudy:
    """Compute Figure 3 and the soak errors of Table 1 in the radiative and the linear network."""
    low, high = POINTS_degC[[0, -1]] + zero_Celsius
    law = law_of(instrument, low - 5, high + 5)
    weights = cell_weights(instrument, law)
    whole = [build_network(instrument, radiation=radiation) for radiation in (True, False)]
    networks = dict(zip(NETWORKS, (*whole, build_shell_and_stem(instrument)), strict=True))
    curves = [_curve(name, one, weights, law, target) for target in STEPS_degC for name, one in networks.items()]
    soaks = [
        _soak(protocol, name, networks[name], weights, law, hour)
        for protocol in PROTOCOLS
        for hour in hours
        for name in NETWORKS[:2]
    ]
    T, f = printed_table1()
    own = _slope_and_curvature(POINTS_degC, law.frequency(POINTS_degC + zero_Celsius))
    return SettlingStudy(tuple(curves), tuple(soaks), *_slope_and_curvature(T, f), *own)


def _curve(name: str, network: Network, weights: Array, law: FrequencyLaw, target_degC: float) -> StepCurve:
    time = np.linspace(0.0, END, 721)
    room, target = ROOM_degC + zero_Celsius, target_degC + zero_Celsius
    row = shell_weights(tuple(node.name for node in network.nodes), weights)
    left = step_remaining(network, room, target, row, time)
    return StepCurve(name, target_degC, time, left, law.frequency(target + (room - target) * left))


def _soak(protocol: str, name: str, network: Network, weights: Array, law: FrequencyLaw, hours: float) -> SoakResult:
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


COLOURS = {"radiative": (style.BLUE, "-"), "linear": (style.ORANGE, "--"), "shell and stem alone": (style.GREEN, ":")}
NO_HEAT_PATH = (
    "The paper gives no heat path. Shell and stem follow from geometry and material. One constant, the conductance between base and"
    " housing, is identified from the statement that a step is 95 % complete after 9 000 s. The model then predicts that less than 1 % remains after 15 000 s, as the paper states."
)
STEPS = (
    Column(lambda curve: f"20 → {curve.target_degC:g} °C", "Step"),
    "network: Heat path",
    Column(lambda curve: curve.left_at(FAST), "Remaining at 9 000 s", "%", ".2f", scale=100.0),
    Column(lambda curve: curve.left_at(SETTLED), "Remaining at 15 000 s", "%", ".2f", scale=100.0),
    Column(lambda curve: curve.time_to(0.05), "95 % complete", "s", ".0f"),
    Column(lambda curve: curve.time_to(0.01), "99 % complete", "s", ".0f"),
)
IDENTIFIED = "The mount conductance is identified from the mean of the two radiative steps at 9 000 s; all other values are predictions."
SOAKS = "Soak | network: Heat path | slope: Slope at 20 °C (ppm/°C) +.3f | curvature: Curvature (ppm/°C²) +.4f"
QUADRATIC = "From a quadratic fitted to the logarithms of the seven frequencies. From room: each point starts at room temperature; upwards: each point starts at the one before."


def settling_chapter(study: SettlingStudy) -> Chapter:
    """Return the chapter: Figure 3, the share of the step that is left, and the soak error of Table 1."""
    steps, soaks = (
        Figure(partial(_draw_steps, study), "The virtual gyro after the temperature steps of figure 3; dotted lines: 9 000 s and 15 000 s.",
            "Frequency and remaining part of the step over time, for a step to −10 and a step to 40 degrees."),
        Figure(partial(_draw_soaks, study), "Frequency error of the seven points after a soak of 4 to 5 h from room temperature.",
            "Frequency error of the seven points for three soak times in two networks."),
    )  # fmt: skip
    table = Table("Settling after a chamber step", study.curves, STEPS, IDENTIFIED)
    title = "Figure 3: settling of the resonator, and effect of the soak time on Table 1"
    told = Sentence(soak_sentence(study), "note")
    return Chapter(title, [NO_HEAT_PATH, steps, table, soaks, _soak_table(study), told])


def _draw_steps(study: SettlingStudy) -> Drawing:
    """Draw the frequency after the two steps (HRG paper, figure 3) and the share of the step that is left."""
    labels = ("frequency (Hz)", "remaining step (%)")
    with style.figure(2, 2, height=5.2, x="time (10³ s)", y=labels, sharex=True) as (made, axes):
        for column, target in enumerate(sorted({curve.target_degC for curve in study.curves})):
            upper, lower = axes[0][column], axes[1][column]
            for curve in (c for c in study.curves if c.target_degC == target):
                colour, line = COLOURS[curve.network]
                label = None if column else curve.network
                upper.plot(curve.time / 1e3, curve.frequency, line, color=colour, label=label)
                left = np.maximum(curve.remaining, 1e-6)
                lower.semilogy(curve.time / 1e3, 100 * left, line, color=colour)
            for time in (FAST, SETTLED):
                for axis in (upper, lower):
                    axis.axvline(time / 1e3, color=style.BLACK, linewidth=0.8, linestyle=":")
            upper.set_title(f"20 → {target:g} °C", fontsize=10)
            upper.ticklabel_format(axis="y", useOffset=False)
            lower.set_ylim(0.05, 120)
        return made


def _draw_soaks(study: SettlingStudy) -> Drawing:
    """Draw the error that incomplete soak leaves in Table 1's frequencies."""
    with style.figure(height=3.0, x="chamber temperature (°C)", y="reading − settled (mHz)") as (made, axes):
        axes.axhline(0, color=style.BLACK, linewidth=0.8)
        hours = sorted({soak.hours for soak in study.soaks})
        for soak in (s for s in study.soaks if s.protocol == PROTOCOLS[0]):
            colour, line = COLOURS[soak.network]
            strength = 0.35 + 0.65 * (1 - hours.index(soak.hours) / max(len(hours) - 1, 1))
            look = {"color": colour, "alpha": strength, "markersize": 3, "label": f"{soak.network}, {soak.hours:g} h"}
            axes.plot(POINTS_degC, 1e3 * soak.error, line + "o", **look)
        axes.legend(fontsize=7, ncols=2)
        return made


def _soak_table(study: SettlingStudy) -> Table:
    """Return what soak adds to slope and curvature, beside what is to be explained."""
    rows = [{**vars(soak), "soak": f"soak {soak.hours:g} h, {soak.protocol}"} for soak in study.soaks]
    slope, curvature = study.measured_slope - study.law_slope, study.measured_curvature - study.law_curvature
    rows.append({"soak": "measured minus predicted", "slope": slope, "curvature": curvature})
    return Table("Effect of an incomplete soak on Table 1", rows, SOAKS, QUADRATIC)


def soak_sentence(study: SettlingStudy) -> str:
    """Say which sign and size soak can explain, and what it cannot."""
    from_room = [soak for soak in study.soaks if soak.protocol == PROTOCOLS[0]]
    upwards = [soak for soak in study.soaks if soak.protocol == PROTOCOLS[1]]
    radiative = [soak for soak in from_room if soak.network == NETWORKS[0]]
    linear = [soak for soak in from_room if soak.network == NETWORKS[1]]
    largest = max(radiative, key=lambda soak: abs(soak.slope))
    missing = study.measured_curvature - study.law_curvature
    against = "opposite to" if largest.curvature * missing < 0 else "of the same sign as"
    return (
        f"An incomplete soak from room temperature reduces the slope by at most {abs(largest.slope):.2f} ppm/°C here, of"
        f" the {abs(study.measured_slope - study.law_slope):.1f} ppm/°C between measurement and prediction at"
        f" 20 °C (both slopes of quadratics through ln f; elsewhere the measured slope is that of the cubic). With a linear heat path it hardly changes the curvature (by up to"
        f" {max(abs(soak.curvature) for soak in linear):.4f} ppm/°C², from the curvature of the law itself). Radiation adds"
        f" {largest.curvature:+.4f} ppm/°C², {against} the difference of {missing:+.3f} ppm/°C² to be explained. With points taken"
        f" in ascending order the slope changes by at most {max((s.slope for s in upwards), key=abs):+.3f} ppm/°C and the curvature by"
        f" at most {max((s.curvature for s in upwards), key=abs):+.4f} ppm/°C². An incomplete soak cannot explain the measured curvature."
    )
