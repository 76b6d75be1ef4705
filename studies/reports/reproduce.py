"""The page of `hrg reproduce`: the HRG paper from its own data, first principles beside it, and where they differ."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from compensation.frequency import fit_frequency
from shell.constants import zero_Celsius
from studies.diagnosis.table import TableDiagnosis
from studies.papers import hrg
from studies.papers.bias_twin import TwinFit
from studies.papers.hrg import FrequencyStudy, PhysicsComparison
from studies.papers.settling import NETWORKS, ROOM_degC, SettlingStudy
from studies.reports import gyro_papers, style
from studies.reports.bias_twin import twin_chapters
from studies.reports.diagnosis import headline
from studies.reports.diagnosis_table import table_parts
from studies.reports.frequency import coefficients_table, error_figure, fit_figure, order_parts, order_sentence
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.reports.settling import settling_chapter
from studies.reports.theories import theories_chapter
from studies.results.page import make_blocks


@dataclass(frozen=True)
class Reproduction:
    """Everything that the page shows: the table, physics, its diagnosis, settling, bias twins, the other papers."""

    study: FrequencyStudy
    physics: PhysicsComparison
    diagnosis: TableDiagnosis
    settling: SettlingStudy
    twins: Sequence[tuple[TwinFit, ...]]
    gyro_chapters: Sequence[Chapter]
    gyro_summary: dict[str, Any]


SOURCES = (
    "Wang X. et al., Sensors 2012, 12, 6434–6446, doi:10.3390/s120506434: Table 1, Table 2, equations (8)–(18).",
    "Spinner S., J. Am. Ceram. Soc. 1962, abstract: G(T), E(T) and Poisson's ratio of vitreous silica.",
    "Luo et al., Rev. Sci. Instrum. 2015, 86: shear thermoelasticity of a drawn fused-silica fibre.",
    "gwinc interferometer model (LIGO): E, d ln E/dT, expansion, heat capacity of fused silica.",
)


def reproduce_page(parts: Reproduction, mode: Sequence[Block]) -> str:
    """Return the whole page; `mode` shows the mode shape."""
    study, physics = parts.study, parts.physics
    lead = (
        "Tables 1 and 2 and figures 3 to 6 of the HRG paper, recomputed from its measured data and from virtual gyros and compared"
        " with first-principles predictions; then the two CVG papers and the BVG paper."
    )
    figure_4 = "Table 1 and figure 4: frequency over temperature"
    chapters = [
        Chapter("In short", [_facts(parts), *_short(parts)]),
        _first_diagnosis(parts),
        Chapter(figure_4, [_table1(study), *make_blocks(coefficients_table(study), fit_figure(study))]),
        Chapter(
            "Table 2 and figure 5(a): temperature from frequency", [_table2(study), *make_blocks(error_figure(study))]
        ),
        Chapter("Order of the polynomial", [Text(order_sentence(study)), *make_blocks(*order_parts(study))]),
        Chapter("First-principles prediction", _physics(physics, study)),
        Chapter("Mode shape", list(mode)),
        theories_chapter(),
        settling_chapter(parts.settling),
        Chapter("Figure 5(b): temperature from frequency during a step", [_step_inverse(parts.settling)]),
        *twin_chapters(parts.twins),
        *parts.gyro_chapters,
    ]
    return render_page("Four gyro papers, reproduced", lead, chapters, (*SOURCES, *gyro_papers.SOURCES))


def summarise(parts: Reproduction) -> dict[str, Any]:
    """Return the numbers of the page, schema `hrg.reproduce/1`."""
    study, physics = parts.study, parts.physics
    fit, better = study.fit, study.next_fit
    assert better is not None
    return {
        "schema": "hrg.reproduce/1",
        "cubic": {
            "reference_temperature_degC": fit.reference_temperature_degC,
            "coefficients": fit.coefficients,
            "standard_errors": fit.standard_errors,
            "sum_of_squares_Hz2": fit.sum_of_squares,
            "leave_one_out_Hz": fit.leave_one_out_rms,
            "largest_residual_Hz": float(np.abs(fit.residuals).max()),
            "largest_residual_of_span": fit.largest_residual_of_span,
        },
        "quartic": {
            "sum_of_squares_Hz2": better.sum_of_squares,
            "leave_one_out_Hz": better.leave_one_out_rms,
            "chi_squared": better.chi_squared,
            "degrees_of_freedom": better.degrees_of_freedom,
            "F_against_cubic": study.orders.against_next[fit.order - 1].statistic,
        },
        "table2": {"calculated_degC": study.calculated_degC, "error_degC": study.error_degC},
        "sensitivity_ppm_per_degC": {
            "measured": float(fit.slope_ppm(20.0)),
            "simulated": float(physics.slope_ppm[-1]),
            "uncertainty": float(physics.uncertainty_ppm[-1]),
            "local_degC": study.local_degC,
            "local_measured": study.local_slope_ppm,
            "local_simulated": physics.slope_ppm[:-1].tolist(),
            "laws": {name: {"value": value, "uncertainty": u} for name, value, u in physics.laws},
        },
        "law_imposed": {
            "residual_rms_Hz": parts.diagnosis.law_rms,
            "curvature_measured_ppm_per_degC2": physics.curvature_measured,
            "curvature_law_ppm_per_degC2": physics.curvature_law,
            "curvature_uncertainty_ppm_per_degC2": physics.curvature_uncertainty,
        },
        "diagnosis_of_table1": parts.diagnosis.as_dict(),
        "card": physics.instrument.name,
        **parts.gyro_summary,
    }


def _facts(parts: Reproduction) -> Facts:
    study, physics = parts.study, parts.physics
    return Facts(
        [
            (
                "Measured slope at 20 °C",
                f"{float(study.fit.slope_ppm(20.0)):.1f} ppm/°C",
                "cubic fitted to Table 1; the paper says about 80",
            ),
            (
                "Predicted slope at 20 °C",
                f"{physics.slope_ppm[-1]:.0f} ± {physics.uncertainty_ppm[-1]:.0f} ppm/°C",
                "solid solver, default silica law",
            ),
            (
                "Temperature from frequency",
                f"within {np.abs(study.error_degC).max():.3f} K",
                "largest error in Table 2, as in the paper",
            ),
            (
                "Misfit with the silica law's curvature fixed",
                f"{1e3 * parts.diagnosis.law_rms:.0f} mHz rms",
                "readings are rounded to 10 mHz",
            ),
        ]
    )


def _short(parts: Reproduction) -> list[Text]:
    study, physics = parts.study, parts.physics
    better = study.next_fit
    assert better is not None
    away = (physics.slope_ppm[-1] - float(study.fit.slope_ppm(20.0))) / physics.uncertainty_ppm[-1]
    away_curvature = abs(physics.curvature_measured - physics.curvature_law) / physics.curvature_uncertainty
    slopes = [value for _, value, _ in physics.laws]
    return [
        Text(
            "The two published coefficients of the cubic are reproduced to the last digit, and the temperatures of Table 2 to within"
            f" {_farthest(study):.4f} K. At −10 °C the columns of the paper disagree: it gives −10.058 °C but an error of 0.0578 K"
            f" (here {study.error_degC[1]:.4f} K). The paper concludes that higher orders have little effect; this is not reproduced."
            f" The residual sum of squares is {better.sum_of_squares:.1e} Hz² for a quartic and"
            f" {study.fit.sum_of_squares:.2e} Hz² for the cubic, and the quartic predicts omitted points"
            f" {study.fit.leave_one_out_rms / better.leave_one_out_rms:.1f} times better."
        ),
        Text(
            f"Physics predicts the magnitude of the slope: at 20 °C the prediction is {abs(away):.1f} standard deviations"
            f" {'above' if away > 0 else 'below'} the measurement, and the published laws of fused silica range from"
            f" {min(slopes):.0f} to {max(slopes):.0f} ppm/°C. Physics does not determine the curvature. The measured curvature is"
            f" {parts.diagnosis.curvature_ratio:.2f} times that of the default law, a parabola based on published statements about the"
            " maximum near 1100 °C. The slope for silica also vanishes near −200 °C, so even the sign of the second derivative between"
            f" these temperatures is uncertain: the sources allow {physics.curvature_law:.2f} ± {physics.curvature_uncertainty:.2f}"
            f" ppm/°C², and the measured {physics.curvature_measured:.2f} ppm/°C² is {away_curvature:.1f} standard deviations away."
            " No constant curvature describes a slope that falls up to 25 °C and then rises."
            " Seven points, each approached once, cannot show whether the cause is the glass, the thermometer, the mounting or"
            " the soak; a staircase up and down with a second thermometer could.",
            "note",
        ),
    ]


def _farthest(study: FrequencyStudy) -> float:
    """Return the largest distance of a calculated temperature of Table 2 from the printed one (K)."""
    return float(np.max(np.abs(study.calculated_degC - hrg.printed_table2()[0])))


def _table1(study: FrequencyStudy) -> Table:
    rows = [
        [f"{T:g}", f"{f:.2f}", f"{f - r:.3f}", f"{1e3 * r:+.1f}"]
        for T, f, r in zip(study.temperature_degC, study.frequency, study.fit.residuals, strict=True)
    ]
    note = (
        f"Largest residual {1e3 * np.abs(study.fit.residuals).max():.1f} mHz = {100 * study.fit.largest_residual_of_span:.2f} % of the"
        " span; the paper gives 0.12 %."
    )
    return Table(
        "Table 1 and the fitted cubic", ["T (°C)", "Measured (Hz)", "Cubic (Hz)", "Residual (mHz)"], rows, note
    )


def _table2(study: FrequencyStudy) -> Table:
    printed, printed_error = hrg.printed_table2()
    rows = [
        [f"{f:.2f}", f"{T:g}", f"{p:g}", f"{c:.4f}", f"{c - p:+.4f}", f"{pe:+g}", f"{e:+.4f}"]
        for f, T, p, c, pe, e in zip(
            study.frequency,
            study.temperature_degC,
            printed,
            study.calculated_degC,
            printed_error,
            study.error_degC,
            strict=True,
        )
    ]
    columns = [
        "f (Hz)",
        "Actual (°C)",
        "Paper (°C)",
        "Here (°C)",
        "Here − paper (K)",
        "Error in the paper (K)",
        "Error here (K)",
    ]
    return Table("Table 2, published and recomputed", columns, rows, "Error: actual minus calculated temperature.")


def _physics(physics: PhysicsComparison, study: FrequencyStudy) -> list[Block]:
    slope = physics.parts
    numbers = 1e6 * np.stack([slope.E, slope.nu, slope.rho, slope.h, slope.r], axis=1)
    rows = [
        [f"{T - zero_Celsius:.0f}", *(f"{part:+.2f}" for part in parts), f"{total:.2f} ± {sd:.1f}", measured]
        for T, parts, total, sd, measured in zip(
            physics.temperature, numbers, physics.slope_ppm, physics.uncertainty_ppm, _measured(study), strict=True
        )
    ]
    columns = ["T (°C)", "E", "ν (μ in the paper)", "ρ", "h", "r", "Predicted", "Measured"]
    parts = Table(
        "Slope of ln f and its contributions (ppm/°C), equation (15)",
        columns,
        rows,
        "Measured: from neighbouring points of Table 1 (± 0.09 from rounding); at 20 °C, the slope of the cubic. The uncertainty is one"
        " standard deviation of the prior on the law: its published values, and a curvature that no source determines.",
    )
    laws = Table(
        "Slope at 20 °C by published law of fused silica",
        ["Law", "Slope (ppm/°C)", "Uncertainty"],
        [[name, f"{value:.1f}", f"{u:.1f}"] for name, value, u in physics.laws],
        "The laws differ by more than any stated uncertainty: most of the spread comes from the literature, not from the solver.",
    )
    return [
        Text(
            f"The paper does not give the geometry of its resonator. The card '{physics.instrument.name}' represents it."
            f" {physics.instrument.note}"
        ),
        parts,
        _slope_figure(physics, study),
        laws,
    ]


def _measured(study: FrequencyStudy) -> list[str]:
    return [f"{s:.1f}" for s in study.local_slope_ppm] + [f"{float(study.fit.slope_ppm(20.0)):.1f}"]


def _slope_figure(physics: PhysicsComparison, study: FrequencyStudy) -> Picture:
    total, spread = physics.slope_ppm[:-1], physics.uncertainty_ppm[:-1]
    with style.figure(height=3.2, x="temperature (°C)", y="slope of ln f (ppm/°C)") as (made, axes):
        axes.fill_between(
            study.local_degC, total - spread, total + spread, color=style.SKY, alpha=0.3, label="± 1 standard deviation"
        )
        axes.plot(study.local_degC, total, color=style.BLUE, label="predicted, default law")
        axes.plot(
            study.local_degC, study.local_slope_ppm, "o", color=style.BLACK, label="measured, neighbouring points"
        )
    caption = (
        "The predicted slope has the right magnitude. The measured slope falls faster and rises again above 25 °C."
    )
    return draw(made, caption, "Predicted and measured slopes over temperature.")


def _first_diagnosis(parts: Reproduction) -> Chapter:
    """Return what `hrg diagnose` says of Table 1."""
    verdict = Text(headline(parts.diagnosis.verdict), "warning")
    blocks = make_blocks(*(part for chapter in table_parts(parts.diagnosis) for part in chapter.parts))
    shown = [block for block in blocks if not isinstance(block, Facts)]
    return Chapter("Differences between measurement and physics: a first diagnosis", [verdict, *shown])


def _step_inverse(settling: SettlingStudy) -> Picture:
    """Draw the temperature that a cubic calculates from the frequency of the virtual step to -10 °C (figure 5b)."""
    curve = next(c for c in settling.curves if c.target_degC < ROOM_degC and c.network == NETWORKS[0])
    true = curve.target_degC + curve.remaining * (ROOM_degC - curve.target_degC)
    points = np.linspace(0, len(true) - 1, 9).astype(int)
    inside = slice(points[0], points[-1] + 1)
    fit = fit_frequency(true[points], curve.frequency[points])
    calculated = fit.temperature(curve.frequency[inside])
    hours = curve.time[inside] / 3600
    with style.figure(2, height=4.2, sharex=True, height_ratios=(3, 1.2), x="time (h)") as (made, (upper, lower)):
        upper.plot(hours, calculated, color=style.BLUE, label="calculated from the frequency")
        upper.set_ylabel("temperature (°C)")
        other = upper.twinx()
        other.plot(hours, curve.frequency[inside], "--", color=style.VERMILION, label="frequency")
        other.set_ylabel("frequency (Hz)")
        other.ticklabel_format(axis="y", useOffset=False)
        other.grid(visible=False)
        handles = [*upper.get_lines(), *other.get_lines()]
        upper.legend(handles, [line.get_label() for line in handles])
        lower.axhline(0, color=style.BLACK, linewidth=0.8)
        lower.plot(hours, 1e3 * (calculated - true[inside]), color=style.BLUE)
        lower.set_ylabel("error (mK)")
    caption = (
        "A virtual step from 20 to −10 °C (the paper does not publish its record): the temperature calculated from the frequency"
        " with a cubic fitted to nine points, and its error relative to the effective temperature of the mode."
    )
    return draw(made, caption, "Temperature and frequency fall together; the error stays far below a millikelvin.")
