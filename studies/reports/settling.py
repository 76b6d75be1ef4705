"""The chapter on Figure 3 of the HRG paper: how the resonator settles, and what incomplete soak does to Table 1."""

from typing import TYPE_CHECKING

import numpy as np

from studies.papers.settling import FAST, NETWORKS, PROTOCOLS, SETTLED, POINTS_degC
from studies.reports import style
from studies.reports.page import Chapter, Picture, Table, Text, draw

if TYPE_CHECKING:
    from studies.papers.settling import SettlingStudy

COLOURS = {
    "radiative": (style.BLUE, "-"),
    "linear": (style.ORANGE, "--"),
    "shell and stem alone": (style.GREEN, ":"),
}


def settling_chapter(study: "SettlingStudy") -> Chapter:
    """Return the chapter: Figure 3, the share of the step that is left, and the soak error of Table 1."""
    return Chapter(
        "Figure 3: how the resonator settles, and what soak does to Table 1",
        [
            Text(
                "The paper gives no heat path. Shell and stem follow from geometry and material; one constant, the"
                " conductance of the base's mount, is identified from the statement that 95 % of a step is made after"
                " 9 000 s. That less than 1 % is left after 15 000 s is then a prediction, and it holds."
            ),
            step_figure(study),
            step_table(study),
            soak_figure(study),
            soak_table(study),
            Text(soak_sentence(study), "note"),
        ],
    )


def step_figure(study: "SettlingStudy") -> Picture:
    """Draw the frequency after the two steps (HRG paper, figure 3) and the share of the step that is left."""
    with style.figure(2, 2, height=5.2, sharex=True) as (made, axes):
        for column, target in enumerate(sorted({curve.target_degC for curve in study.curves})):
            upper, lower = axes[0][column], axes[1][column]
            for curve in (c for c in study.curves if c.target_degC == target):
                colour, line = COLOURS[curve.network]
                upper.plot(curve.time / 1e3, curve.frequency, line, color=colour, label=curve.network)
                left = np.maximum(curve.remaining, 1e-6)
                lower.semilogy(curve.time / 1e3, 100 * left, line, color=colour)
            for time in (FAST, SETTLED):
                for axis in (upper, lower):
                    axis.axvline(time / 1e3, color=style.BLACK, linewidth=0.8, linestyle=":")
            upper.set_title(f"20 → {target:g} °C", fontsize=10)
            upper.ticklabel_format(axis="y", useOffset=False)
            lower.set_ylim(0.05, 120)
            lower.set_xlabel("time (10³ s)")
        axes[0][0].set_ylabel("frequency (Hz)")
        axes[1][0].set_ylabel("step left (%)")
        axes[0][0].legend(fontsize=8)
    return draw(
        made,
        "The virtual gyro in the steps of the paper's figure 3; dotted: 9 000 s and 15 000 s.",
        "Frequency and the share of the step left, over time, for a step to -10 and a step to 40 degrees.",
    )


def step_table(study: "SettlingStudy") -> Table:
    """Return what is left of each step at the paper's two times."""
    rows = [
        [
            f"20 → {curve.target_degC:g} °C",
            curve.network,
            f"{100 * curve.left_at(FAST):.2f}",
            f"{100 * curve.left_at(SETTLED):.2f}",
            f"{curve.time_to(0.05):.0f}",
            f"{curve.time_to(0.01):.0f}",
        ]
        for curve in study.curves
    ]
    columns = ["Step", "Network", "Left at 9 000 s (%)", "Left at 15 000 s (%)", "95 % made (s)", "99 % made (s)"]
    note = "The mount is identified from the mean of the radiative column at 9 000 s; all else is predicted."
    return Table("Settling after a chamber step", columns, rows, note)


def soak_figure(study: "SettlingStudy") -> Picture:
    """Draw the error that incomplete soak leaves in Table 1's frequencies."""
    with style.figure(height=3.0) as (made, axes):
        axes.axhline(0, color=style.BLACK, linewidth=0.8)
        hours = sorted({soak.hours for soak in study.soaks})
        for soak in (s for s in study.soaks if s.protocol == PROTOCOLS[0]):
            colour, line = COLOURS[soak.network]
            strength = 0.35 + 0.65 * (1 - hours.index(soak.hours) / max(len(hours) - 1, 1))
            label = f"{soak.network}, {soak.hours:g} h"
            axes.plot(
                POINTS_degC, 1e3 * soak.error, line + "o", color=colour, alpha=strength, markersize=3, label=label
            )
        axes.set_xlabel("chamber temperature (°C)")
        axes.set_ylabel("read − settled (mHz)")
        axes.legend(fontsize=7, ncols=2)
    return draw(
        made,
        "What a soak of 4 to 5 h from room temperature leaves in the seven points.",
        "Frequency error of the seven points for three soak times in two networks.",
    )


def soak_table(study: "SettlingStudy") -> Table:
    """Return what soak adds to slope and curvature, beside what is to be explained."""
    rows = [
        [f"soak {soak.hours:g} h, {soak.protocol}", soak.network, f"{soak.slope:+.3f}", f"{soak.curvature:+.4f}"]
        for soak in study.soaks
    ]
    slope, curvature = study.measured_slope - study.law_slope, study.measured_curvature - study.law_curvature
    rows.append(["to be explained", "measured minus the card's law", f"{slope:+.3f}", f"{curvature:+.4f}"])
    columns = ["Soak", "Network", "Slope at 20 °C (ppm/°C)", "Curvature (ppm/°C²)"]
    note = "From a quadratic through the logarithms of the seven frequencies."
    return Table("What incomplete soak adds to Table 1", columns, rows, note)


def soak_sentence(study: "SettlingStudy") -> str:
    """Say which sign and size soak can explain, and what it cannot."""
    from_room = [soak for soak in study.soaks if soak.protocol == PROTOCOLS[0]]
    upwards = [soak for soak in study.soaks if soak.protocol == PROTOCOLS[1]]
    radiative = [soak for soak in from_room if soak.network == NETWORKS[0]]
    linear = [soak for soak in from_room if soak.network == NETWORKS[1]]
    largest = max(radiative, key=lambda soak: abs(soak.slope))
    missing = study.measured_curvature - study.law_curvature
    against = "opposite to" if largest.curvature * missing < 0 else "of the same sign as"
    return (
        f"Incomplete soak from room temperature flattens the slope: by {abs(largest.slope):.2f} ppm/°C at most here, of"
        f" the {abs(study.measured_slope - study.law_slope):.1f} by which the measured slope lies below the card's law."
        f" In a linear network it hardly curves it (up to"
        f" {max(abs(soak.curvature) for soak in linear):.4f} ppm/°C², from the law's own curvature); radiation leaves"
        f" {largest.curvature:+.4f} ppm/°C², {against} the {missing:+.3f} that are missing. Points taken one after another"
        f" upwards change the slope by {max((s.slope for s in upwards), key=abs):+.3f} ppm/°C and the curvature by"
        f" {max((s.curvature for s in upwards), key=abs):+.4f} ppm/°C² at most. Soak cannot be the cause of the measured"
        " curvature."
    )
