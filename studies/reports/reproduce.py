"""The page of `hrg reproduce`: the HRG paper from its own data, first principles beside it, and where they differ."""

from typing import Any

import numpy as np

from compensation.frequency import fit_frequency
from shell.constants import zero_Celsius
from studies.diagnosis.table import TableDiagnosis, diagnose_table
from studies.instrument.card import load_card
from studies.papers import hrg
from studies.papers.bias_twin import study_twin, twin_chapters
from studies.papers.hrg import FrequencyStudy, PhysicsComparison
from studies.papers.settling import NETWORKS, ROOM_degC, SettlingStudy, settling_chapter, study_settling
from studies.papers.theories import theories_chapter
from studies.progress import Told
from studies.reports import gyro_papers, style
from studies.reports.diagnosis import headline
from studies.reports.diagnosis_table import table_parts
from studies.reports.frequency import coefficients_table, error_figure, fit_figure, order_parts, order_sentence
from studies.reports.scenes import mode_blocks
from studies.results import (
    Blocks,
    Chapter,
    Column,
    Drawing,
    Facts,
    Figure,
    Part,
    Result,
    Sentence,
    Table,
    row_of,
    rows_of,
)

GYROS = 12  # virtual ones of each paper
SOURCES = (
    "Wang X. et al., Sensors 2012, 12, 6434–6446, doi:10.3390/s120506434: Table 1, Table 2, equations (8)–(18).",
    "Spinner S., J. Am. Ceram. Soc. 1962, abstract: G(T), E(T) and Poisson's ratio of vitreous silica.",
    "Luo et al., Rev. Sci. Instrum. 2015, 86: shear thermoelasticity of a drawn fused-silica fibre.",
    "gwinc interferometer model (LIGO): E, d ln E/dT, expansion, heat capacity of fused silica.",
)


TABLE1 = "temperature: T (°C) g | frequency: Measured (Hz) .2f | cubic: Cubic (Hz) .3f | residual: Residual (mHz) ×1e3 +.1f"  # fmt: skip
TABLE2 = (
    "frequency: f (Hz) .2f | actual: Actual (°C) g | printed: Paper (°C) g | calculated: Here (°C) .4f",
    Column(lambda row: row["calculated"] - row["printed"], "Here − paper", "K", "+.4f"),
    "printed_error: Error in the paper (K) +g | error: Error here (K) +.4f",
)
NAMES = {"E": "E", "nu": "ν (μ in the paper)", "rho": "ρ", "h": "h", "r": "r"}
SLOPES = (
    "T: T (°C) .0f",
    *(f"{key}: {name} ×1e6 +.2f" for key, name in NAMES.items()),
    "Predicted | measured: Measured .1f",
)
SLOPES_NOTE = (
    "Measured: from neighbouring points of Table 1 (± 0.09 from rounding); at 20 °C, the slope of the cubic. The uncertainty is one"
    " standard deviation of the prior on the law: its published values, and a curvature that no source determines."
)
LAWS = "0: Law | 1: Slope (ppm/°C) .1f | 2: Uncertainty .1f"
LAWS_NOTE = "The laws differ by more than any stated uncertainty: most of the spread comes from the literature, not from the solver."
LEAD = (
    "Tables 1 and 2 and figures 3 to 6 of the HRG paper, recomputed from its measured data and from virtual gyros and compared"
    " with first-principles predictions; then the two CVG papers and the BVG paper."
)


def reproduce_papers() -> tuple[FrequencyStudy, Result]:
    """Recompute the papers; return the study of Table 1, and the numbers with the whole page."""
    told = Told("reproduction")
    told("modes over temperature and a first diagnosis of Table 1", 0.0)
    instrument = load_card(hrg.CARD)
    study = hrg.study_table(*hrg.printed_table1(), resolution=hrg.RESOLUTION)
    physics = hrg.compare_physics(study, instrument)
    diagnosis = diagnose_table(str(hrg.TABLE1))
    told("settling after a temperature step (figure 3)", 0.1)
    settling = study_settling(instrument)
    told(f"{GYROS} virtual gyros: bias compensation (figure 6)", 0.2)
    twins = [study_twin(seed) for seed in range(GYROS)]
    told("the CVG and BVG papers", 0.5)
    gyro_chapters, gyro_numbers = gyro_papers.reproduce_gyro_papers(GYROS)
    told("writing the page", 0.9)
    first = [part for chapter in table_parts(diagnosis) for part in chapter.parts if not isinstance(part, Facts)]
    verdict = Sentence(headline(diagnosis.verdict), "warning")
    chapters = [
        Chapter("Summary", [_facts(study, physics, diagnosis), *_short(study, physics, diagnosis)]),
        Chapter("Differences between measurement and physics: a first diagnosis", [verdict, *first]),
        Chapter("Table 1 and figure 4: frequency over temperature", _table1(study)),
        Chapter("Table 2 and figure 5(a): temperature from frequency", [_table2(study), error_figure(study)]),
        Chapter("Order of the polynomial", [order_sentence(study), *order_parts(study)]),
        Chapter("First-principles prediction", _physics(physics, study)),
        Chapter("Mode shape", [Blocks(lambda: mode_blocks(instrument))]),
        theories_chapter(),
        settling_chapter(settling),
        Chapter("Figure 5(b): temperature from frequency during a step", [_step_inverse(settling)]),
        *twin_chapters(twins),
        *gyro_chapters,
    ]
    numbers, sources = _summarise(study, physics, diagnosis) | gyro_numbers, (*SOURCES, *gyro_papers.SOURCES)
    return study, Result(numbers, "Four gyro papers, reproduced", LEAD, chapters, sources=sources)


def _summarise(study: FrequencyStudy, physics: PhysicsComparison, diagnosis: TableDiagnosis) -> dict[str, Any]:
    """Return the numbers of the HRG paper, schema `hrg.reproduce/1`."""
    fit, better = study.fit, study.next_fit
    assert better is not None
    fitted = {"sum_of_squares_Hz2": "regression.sum_of_squares", "leave_one_out_Hz": "regression.leave_one_out_rms"}
    names = ("curvature_measured", "curvature_law", "curvature_uncertainty")
    curvatures = {f"{name}_ppm_per_degC2": name for name in names}
    return {
        "schema": "hrg.reproduce/1",
        "cubic": {
            **row_of(
                fit, "reference_temperature_degC", "coefficients", "standard_errors",
                "largest_residual_of_span", **fitted,
            ),
            "largest_residual_Hz": float(np.abs(fit.regression.residuals).max()),
        },
        "quartic": {
            **row_of(better, "chi_squared", degrees_of_freedom="regression.degrees_of_freedom", **fitted),
            "F_against_cubic": study.orders.against_next[fit.order - 1].statistic,
        },
        "table2": row_of(study, "calculated_degC", "error_degC"),
        "sensitivity_ppm_per_degC": {
            "measured": float(fit.slope_ppm(20.0)),
            "simulated": float(physics.slope_ppm[-1]),
            "uncertainty": float(physics.uncertainty_ppm[-1]),
            **row_of(study, "local_degC", local_measured="local_slope_ppm"),
            "local_simulated": physics.slope_ppm[:-1].tolist(),
            "laws": {name: {"value": value, "uncertainty": u} for name, value, u in physics.laws},
        },
        "law_imposed": {"residual_rms_Hz": diagnosis.law_rms, **row_of(physics, **curvatures)},
        "diagnosis_of_table1": diagnosis.as_dict(),
        "card": physics.instrument.name,
    }  # fmt: skip


def _facts(study: FrequencyStudy, physics: PhysicsComparison, diagnosis: TableDiagnosis) -> Facts:
    measured, predicted, sd = float(study.fit.slope_ppm(20.0)), physics.slope_ppm[-1], physics.uncertainty_ppm[-1]
    within, misfit = np.abs(study.error_degC).max(), 1e3 * diagnosis.law_rms
    return Facts([
        ("Measured slope at 20 °C", f"{measured:.1f} ppm/°C", "cubic fitted to Table 1; the paper says about 80"),
        ("Predicted slope at 20 °C", f"{predicted:.0f} ± {sd:.0f} ppm/°C", "solid solver, default silica law"),
        ("Temperature from frequency", f"within {within:.3f} K", "largest error in Table 2, as in the paper"),
        ("Misfit with the silica law's curvature fixed", f"{misfit:.0f} mHz rms", "readings are rounded to 10 mHz"),
    ])  # fmt: skip


def _short(study: FrequencyStudy, physics: PhysicsComparison, diagnosis: TableDiagnosis) -> list[Part]:
    better = study.next_fit
    assert better is not None
    farthest = float(np.max(np.abs(study.calculated_degC - hrg.printed_table2()[0])))
    away = (physics.slope_ppm[-1] - float(study.fit.slope_ppm(20.0))) / physics.uncertainty_ppm[-1]
    away_curvature = abs(physics.curvature_measured - physics.curvature_law) / physics.curvature_uncertainty
    slopes = [value for _, value, _ in physics.laws]
    return [
        (
            "The two published coefficients of the cubic are reproduced to the last digit, and the temperatures of Table 2 to within"
            f" {farthest:.4f} K. At −10 °C the columns of the paper disagree: it gives −10.058 °C but an error of 0.0578 K"
            f" (here {study.error_degC[1]:.4f} K). The paper concludes that higher orders have little effect; this is not reproduced."
            f" The residual sum of squares is {better.regression.sum_of_squares:.1e} Hz² for a quartic and {study.fit.regression.sum_of_squares:.2e} Hz² for the cubic, and the quartic predicts omitted points"
            f" {study.fit.regression.leave_one_out_rms / better.regression.leave_one_out_rms:.1f} times better."
        ),
        Sentence(
            f"Physics predicts the magnitude of the slope: at 20 °C the prediction is {abs(away):.1f} standard deviations"
            f" {'above' if away > 0 else 'below'} the measurement, and the published laws of fused silica range from"
            f" {min(slopes):.0f} to {max(slopes):.0f} ppm/°C. Physics does not determine the curvature. The measured curvature is"
            f" {diagnosis.curvature_ratio:.2f} times that of the default law, a parabola based on published statements about the"
            " maximum near 1100 °C. The slope for silica also vanishes near −200 °C, so even the sign of the second derivative between"
            f" these temperatures is uncertain: the sources allow {physics.curvature_law:.2f} ± {physics.curvature_uncertainty:.2f}"
            f" ppm/°C², and the measured {physics.curvature_measured:.2f} ppm/°C² is {away_curvature:.1f} standard deviations away."
            " No constant curvature describes a slope that falls up to 25 °C and then rises."
            " Seven points, each measured once, cannot show whether the cause is the glass, the thermometer, the mounting or"
            " the soak; a staircase up and down with a second thermometer could.",
            "note",
        ),
    ]


def _table1(study: FrequencyStudy) -> list[Part]:
    fit, largest = study.fit, 1e3 * np.abs(study.fit.regression.residuals).max()
    share = 100 * fit.largest_residual_of_span
    note = f"Largest residual {largest:.1f} mHz = {share:.2f} % of the span; the paper gives 0.12 %."
    found = row_of(study, "frequency", temperature="temperature_degC", residual="fit.regression.residuals")
    rows = rows_of({**found, "cubic": study.frequency - fit.regression.residuals})
    return [Table("Table 1 and the fitted cubic", rows, TABLE1, note), coefficients_table(study), fit_figure(study)]


def _table2(study: FrequencyStudy) -> Table:
    printed = dict(zip(("printed", "printed_error"), hrg.printed_table2(), strict=True))
    found = row_of(study, "frequency", actual="temperature_degC", calculated="calculated_degC", error="error_degC")
    note = "Error: actual minus calculated temperature."
    return Table("Table 2, published and recomputed", rows_of(found | printed), TABLE2, note)


def _physics(physics: PhysicsComparison, study: FrequencyStudy) -> list[Part]:
    predicted = zip(physics.slope_ppm, physics.uncertainty_ppm, strict=True)
    columns = {
        "T": physics.temperature - zero_Celsius,
        **{key: getattr(physics.parts, key) for key in NAMES},
        "predicted": [f"{total:.2f} ± {sd:.1f}" for total, sd in predicted],
        "measured": [*study.local_slope_ppm, float(study.fit.slope_ppm(20.0))],
    }
    name, note = physics.instrument.name, physics.instrument.note
    unknown = f"The paper does not give the geometry of its resonator. The card '{name}' represents it. {note}"
    title = "Slope of ln f and its contributions (ppm/°C), equation (15)"
    caption = "The predicted slope has the right size. The measured slope falls faster and rises again above 25 °C."
    return [
        unknown,
        Table(title, rows_of(columns), SLOPES, SLOPES_NOTE),
        Figure(lambda: _draw_slopes(physics, study), caption, "Predicted and measured slopes over temperature."),
        Table("Slope at 20 °C by published law of fused silica", physics.laws, LAWS, LAWS_NOTE),
    ]


def _draw_slopes(physics: PhysicsComparison, study: FrequencyStudy) -> Drawing:
    T, total, spread = study.local_degC, physics.slope_ppm[:-1], physics.uncertainty_ppm[:-1]
    with style.figure(height=3.2, x="temperature (°C)", y="slope of ln f (ppm/°C)") as (made, axes):
        axes.fill_between(T, total - spread, total + spread, color=style.SKY, alpha=0.3, label="± 1 standard deviation")
        axes.plot(T, total, color=style.BLUE, label="predicted, default law")
        axes.plot(T, study.local_slope_ppm, "o", color=style.BLACK, label="measured, neighbouring points")
        return made


def _step_inverse(settling: SettlingStudy) -> Figure:
    """Return the temperature that a cubic calculates from the frequency of the virtual step to -10 °C (figure 5b)."""
    caption = (
        "A virtual step from 20 to −10 °C (the paper does not publish its record): the temperature calculated from the frequency"
        " with a cubic fitted to nine points, and its error relative to the effective temperature of the mode."
    )
    alt = "Temperature and frequency fall together; the error stays far below a millikelvin."
    return Figure(lambda: _draw_step(settling), caption, alt)


def _draw_step(settling: SettlingStudy) -> Drawing:
    curve = next(c for c in settling.curves if c.target_degC < ROOM_degC and c.network == NETWORKS[0])
    true = curve.target_degC + curve.remaining * (ROOM_degC - curve.target_degC)
    points = np.linspace(0, len(true) - 1, 9).astype(int)
    inside = slice(points[0], points[-1] + 1)
    fit = fit_frequency(true[points], curve.frequency[points])
    calculated = fit.temperature(curve.frequency[inside])
    hours = curve.time[inside] / 3600
    labels, heights = ("temperature (°C)", "error (mK)"), (3, 1.2)
    with style.figure(2, 1, 4.2, "time (h)", labels, sharex=True, height_ratios=heights) as (made, (upper, lower)):
        upper.plot(hours, calculated, color=style.BLUE, label="calculated from the frequency")
        upper.plot([], [], "--", color=style.VERMILION, label="frequency")
        other = upper.twinx()
        other.plot(hours, curve.frequency[inside], "--", color=style.VERMILION)
        other.set_ylabel("frequency (Hz)")
        other.ticklabel_format(axis="y", useOffset=False)
        other.grid(visible=False)
        lower.axhline(0, color=style.BLACK, linewidth=0.8)
        lower.plot(hours, 1e3 * (calculated - true[inside]), color=style.BLUE)
        return made
