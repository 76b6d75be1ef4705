"""The chapter on Figure 3 of the HRG paper: how the resonator settles, and what incomplete soak does to Table 1."""

from functools import partial

import numpy as np

from studies.papers.settling import FAST, NETWORKS, PROTOCOLS, SETTLED, POINTS_degC, SettlingStudy
from studies.reports import style
from studies.results import Chapter, Column, Drawing, Figure, Sentence, Table

COLOURS = {
    "radiative": (style.BLUE, "-"),
    "linear": (style.ORANGE, "--"),
    "shell and stem alone": (style.GREEN, ":"),
}
NO_HEAT_PATH = (
    "The paper gives no heat path. Shell and stem follow from geometry and material. One constant, the conductance between base and"
    " housing, is identified from the statement that a step is 95 % complete after 9 000 s. The model then predicts that less than"
    " 1 % remains after 15 000 s, as the paper states."
)
STEPS = (
    Column(lambda curve: f"20 → {curve.target_degC:g} °C", "Step"),
    Column("network", "Heat path"),
    Column(lambda curve: curve.left_at(FAST), "Remaining at 9 000 s", "%", ".2f", scale=100.0),
    Column(lambda curve: curve.left_at(SETTLED), "Remaining at 15 000 s", "%", ".2f", scale=100.0),
    Column(lambda curve: curve.time_to(0.05), "95 % complete", "s", ".0f"),
    Column(lambda curve: curve.time_to(0.01), "99 % complete", "s", ".0f"),
)
IDENTIFIED = "The mount conductance is identified from the mean of the two radiative steps at 9 000 s; all other values are predictions."
SOAKS = (
    "Soak",
    Column("network", "Heat path"),
    Column("slope", "Slope at 20 °C", "ppm/°C", "+.3f"),
    Column("curvature", "Curvature", "ppm/°C²", "+.4f"),
)
QUADRATIC = (
    "From a quadratic fitted to the logarithms of the seven frequencies. From room: each point starts at room temperature; upwards:"
    " each point starts at the one before."
)


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
        " 20 °C (both slopes of quadratics through ln f; elsewhere the measured slope is that of the cubic)."
        f" With a linear heat path it hardly changes the curvature (by up to"
        f" {max(abs(soak.curvature) for soak in linear):.4f} ppm/°C², from the curvature of the law itself). Radiation adds"
        f" {largest.curvature:+.4f} ppm/°C², {against} the difference of {missing:+.3f} ppm/°C² to be explained. With points taken"
        f" in ascending order the slope changes by at most {max((s.slope for s in upwards), key=abs):+.3f} ppm/°C and the curvature by"
        f" at most {max((s.curvature for s in upwards), key=abs):+.4f} ppm/°C². An incomplete soak cannot explain the measured"
        " curvature."
    )
