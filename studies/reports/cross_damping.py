"""The page of a cross-damping calibration, and the pictures like the CVG paper's figures 1 and 2."""

from typing import TYPE_CHECKING

import numpy as np

from compensation.decimation import average_blocks
from compensation.improvement import AVERAGING
from shell.constants import zero_Celsius
from studies.models.kinds.cross_damping import OUTPUTS
from studies.reports import style
from studies.reports.digits import lowered, raised, to_error
from studies.reports.page import Chapter, Facts, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from compensation.cross_damping import CrossDampingModel, RestRun
    from studies.cross_damping import CrossDampingStudy
    from studies.papers.cvg_cross_damping import CrossDampingTwin
    from studies.rest import RestData

SOURCES = ("Apostolyuk V., Chikovani V., Temperature error model in Coriolis vibratory gyroscopes: eqs. (1)–(10).",)
UNITS = {"bias_deg_per_h": "°/h", "measured_rate_deg_per_s": "°/s"}


def cross_damping_page(study: "CrossDampingStudy", data: "RestData", source: str) -> str:
    """Return the page for a user's own records."""
    lead = (
        f"The zero-rate output of {source} as cross-damping that varies with temperature, through the filter (9), with a"
        f" polynomial of order {len(study.model.coefficients) - 1} for eq. (10)."
    )
    chapters = [
        Chapter("In short", [_facts(study, data), *([] if study.is_useful else [Text(USELESS, "warning")])]),
        Chapter("Output before and after", [output_figure(study, data.output), improvement_table(study, data)]),
        Chapter(
            "Cross-damping over temperature", [curve_figure(study), coefficients_table(study), Text(SCALE, "note")]
        ),
    ]
    return render_page("Cross-damping over temperature", lead, chapters, SOURCES)


USELESS = (
    "On data left out of the fit the compensation does not improve the output: this record shows no cross-damping that varies"
    " with temperature, beyond its noise."
)
SCALE = (
    "The output shows only 2k/g₂ · ζ₁₂, so the size of ζ₁₂ is as good as the natural frequency given, and a constant bias of"
    " any other origin counts into ζ₀."
)


def twin_chapters(twin: "CrossDampingTwin") -> list[Chapter]:
    """Return the chapter on figures 1 and 2 of the paper, from a virtual gyro, for the page of `hrg reproduce`."""
    from studies.papers import cvg_cross_damping as paper

    unit = paper.DEG_PER_H
    low, middle, high = twin.spread
    told = (
        f'The paper prints the shape of ζ₁₂(T) and "approximately {paper.PRINTED_IMPROVEMENT:g} times". The twin takes that shape at'
        f" {paper.BIAS_AT_CALIBRATION:g} °/h for 20 °C, a random walk of {paper.RANDOM_WALK:g} °/√h, a bias that wanders by"
        f" {paper.WANDER:g} °/h per √h, and a resonator {paper.LAG:g} s behind its sensor: typical values, not tuned to 8. Fitted on"
        f" one run it improves the output {twin.study.training.rows.ratio:.1f} times there and {twin.improvement.ratio:.1f} times on the"
        f" next run; over seeds {middle:.1f} times (90 %: {low:.1f}…{high:.1f}) on runs that were not fitted. The figure hangs"
        " on that lag, which the paper does not give: see the table."
    )
    shape = (
        "Shape only: taken as absolute values the printed coefficients would mean"
        f" {paper.count_bias_of_printed_values():.0f} rad/s of bias at {paper.FREQUENCY:g} Hz. The filter (9) itself moves the"
        f" correction by at most {twin.study.memory / unit:.2g} °/h: its time constant is below a second, the temperature's is minutes."
    )
    picture = draw_runs((*twin.study.runs, twin.second), twin.study.model, unit, "°/h")
    chapter = Chapter(
        "CVG figures 1 and 2: cross-damping compensated",
        [Text(told), picture, determinants_table(twin), Text(shape, "note")],
    )
    return [chapter]


def determinants_table(twin: "CrossDampingTwin") -> Table:
    """Return what the improvement depends on: lag of the resonator and white noise."""
    rows = [
        [f"{lag:g}", *(f"{ratio:.1f}" for ratio in ratios)] for lag, ratios in zip(twin.lags, twin.table, strict=True)
    ]
    columns = ["Lag (s)", *(f"{noise:g} °/√h" for noise in twin.noises)]
    note = (
        "Median over seeds, on runs that were not fitted. Without lag the wander of the bias sets the limit; with it, the part of the"
        " temperature that the sensor does not show."
    )
    return Table("Times better, by lag of the resonator and white noise", columns, rows, note)


def _facts(study: "CrossDampingStudy", data: "RestData") -> Facts:
    unit, name = OUTPUTS[data.output], UNITS[data.output]
    return Facts(
        [
            (
                "Improvement",
                f"{study.training.averages.ratio:.2f} times",
                "100 s averages of the data that were fitted",
            ),
            (
                "Improvement, held out",
                f"{study.held_out.averages.ratio:.2f} times",
                f"100 s averages left out of the fit; rows {study.held_out.rows.ratio:.2f} times",
            ),
            (
                "Left after compensation",
                f"{study.held_out.averages.after / unit:.3g} {name}",
                "rms of averages, held out",
            ),
            (
                "Part of the dynamics",
                f"{study.memory / unit:.2g} {name}",
                "largest share of the filter (9) in the correction",
            ),
        ]
    )


def coefficients_table(study: "CrossDampingStudy") -> Table:
    """Return ζᵢ with their standard errors, and their ratio to ζ₀, which does not depend on the frequency given."""
    model = study.model
    rows = [
        [
            f"ζ{lowered(i)}",
            *to_error(value, error),
            ("ratio", "per °C")[i] if i < 2 else f"per °C{raised(i)}",
            f"{value / model.coefficients[0]:.4g}",
        ]
        for i, (value, error) in enumerate(zip(model.coefficients, np.sqrt(np.diag(model.covariance)), strict=True))
    ]
    at = model.calibration_temperature - zero_Celsius
    columns = ["Coefficient", "Value", "Standard error", "Unit", "Over ζ₀"]
    note = "The errors allow for white noise plus a random walk of the bias."
    return Table(f"Cross-damping about {at:g} °C", columns, rows, note)


def improvement_table(study: "CrossDampingStudy", data: "RestData") -> Table:
    """Return the zero-rate output before and after, on the fitted data and on data left out."""
    unit, name = OUTPUTS[data.output], UNITS[data.output]
    rows = [
        [label, f"{case.before / unit:.4g}", f"{case.after / unit:.4g}", f"{case.ratio:.2f}"]
        for label, case in (
            ("fitted, rows", study.training.rows),
            ("fitted, 100 s averages", study.training.averages),
            ("held out, rows", study.held_out.rows),
            ("held out, 100 s averages", study.held_out.averages),
        )
    ]
    columns = ["Data", f"Before ({name})", f"After ({name})", "Times better"]
    note = "Before: standard deviation about the mean; after: rms. Held out: each run, or each fifth of a single run, predicted from the others."
    return Table("Zero-rate output", columns, rows, note)


def curve_figure(study: "CrossDampingStudy") -> Picture:
    """Draw ζ₁₂(T)/ζ₁₂(0) with its 90 % band."""
    model = study.model
    T = np.linspace(model.lowest, model.highest, 200)
    powers = (T - model.calibration_temperature)[:, None] ** np.arange(len(model.coefficients))
    size = model.coefficients[0]
    spread = 1.645 * np.sqrt(np.einsum("ni,ij,nj->n", powers, model.covariance, powers)) / abs(size)
    middle = powers @ model.coefficients / size
    with style.figure(height=3.0) as (made, axes):
        axes.fill_between(
            T - zero_Celsius, middle - spread, middle + spread, color=style.SKY, alpha=0.4, label="90 % band"
        )
        axes.plot(T - zero_Celsius, middle, color=style.BLUE, label="fitted")
        axes.set_xlabel("temperature (°C)")
        axes.set_ylabel("ζ₁₂ over its value at calibration")
        axes.legend()
    return draw(made, "Shape of the cross-damping over temperature.", "A curve of relative cross-damping.")


def output_figure(study: "CrossDampingStudy", output: str) -> Picture:
    """Draw temperature and output over time, before and after (CVG cross-damping paper, figures 1 and 2)."""
    return draw_runs(study.runs, study.model, OUTPUTS[output], UNITS[output])


def draw_runs(runs: "tuple[RestRun, ...]", model: "CrossDampingModel", unit: float, name: str) -> Picture:
    """Draw runs one after the other; `unit` in rad/s, called `name`."""
    with style.figure(2, height=4.8, sharex=True, height_ratios=(1, 2)) as (made, (upper, lower)):
        begin = 0.0
        for i, run in enumerate(runs):
            after = model.compensate(run.time, run.rate, run.temperature, extrapolate=True)
            width = max(AVERAGING, 2 * float(np.median(np.diff(run.time))))
            blocks = average_blocks(run.time, {"T": run.temperature, "before": run.rate, "after": after}, width)
            means = blocks.columns
            hours = (blocks.time - run.time[0]) / 3600 + begin
            begin = hours[-1]
            upper.plot(hours, means["T"] - zero_Celsius, color=style.VERMILION)
            for when, colour, label in (
                ("before", style.ORANGE, "uncompensated"),
                ("after", style.BLUE, "compensated"),
            ):
                lower.plot(hours, means[when] / unit, color=colour, linewidth=0.9, label=None if i else label)
        lower.axhline(0, color=style.BLACK, linewidth=0.8)
        upper.set_ylabel("temperature (°C)")
        lower.set_ylabel(f"zero-rate output ({name})")
        lower.set_xlabel("time (h)")
        lower.legend()
    return draw(
        made,
        "Temperature, and zero-rate output before and after compensation, 100 s averages.",
        "Temperature over time above, output with and without compensation below.",
    )
