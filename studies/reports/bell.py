"""Chapters and page of the four-step chain of a bell-shaped gyro, and the BVG paper's claims beside it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shell.constants import zero_Celsius
from studies.reports import style
from studies.reports.digits import to_error
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from compensation.bell import BellChain, PolynomialCurve
    from compensation.bell_calibration import BellRun
    from studies.papers.bvg import BellTwin, Claims
    from studies.scale import ScaleStudy, StepFigures

SOURCES = ("Su Z., Liu N., Li Q., Sensors 2015, 15, 23684–23705, doi:10.3390/s150923684: equations (1)–(36).",)
NAMES = {
    "rough": "rough (33)",
    "bias_compensated": "bias over temperature (34)",
    "rate_compensated": "scale over rate (35)",
    "temperature_compensated": "scale over temperature (36)",
    "filtered": "FIR filter",
}
DEG = float(np.pi / 180)


def scale_page(study: "ScaleStudy", source: str) -> str:
    """Return the page for a user's own records."""
    lead = f"Null, bias over temperature, scale over rate and over temperature of {source}, fitted step by step."
    chapters = [
        Chapter("In short", [_facts(study)]),
        Chapter(
            "After each step",
            [steps_table(study.figures, "On the runs that were fitted"), draw_steps(study.chain, study.runs)],
        ),
        Chapter("Coefficients", [coefficients_table(study.chain, study.output)]),
    ]
    return render_page("Bias and scale of a bell-shaped gyro", lead, chapters, SOURCES)


def bell_chapters(twin: "BellTwin") -> list[Chapter]:
    """Return the chapters of the twin for the page of `hrg reproduce`."""
    return [
        Chapter(
            "BVG equations (32)–(36): the compensation chain on a virtual gyro",
            [
                Text(TWIN),
                steps_table(twin.held_out, "Runs that the fit has not seen"),
                steps_table(twin.fitted, "Runs that were fitted"),
                draw_steps(twin.chain, twin.runs),
                draw_allan(twin.chain, twin.runs[1]),
            ],
        ),
        Chapter("BVG: what the printed coefficients can explain", claim_blocks(twin.claims)),
    ]


TWIN = (
    "A virtual gyro that the printed coefficients compensate exactly, with the printed random walk of 2.78 °/√h as white noise and"
    " an assumed wander of 20 °/h per √h. Nothing is tuned to the printed results."
)


def _facts(study: "ScaleStudy") -> Facts:
    last = next(f for f in study.figures if f.step == "temperature_compensated")
    first = study.figures[0]
    linear = "—"
    if first.nonlinearity is not None and last.nonlinearity is not None:
        linear = f"{100 * first.nonlinearity:.3f} → {100 * last.nonlinearity:.3f} %"
    return Facts(
        [
            (
                "Rate error, held out",
                f"{study.error_before:.4f} → {study.error_held_out:.4f} °/s",
                "rms, on fifths of each run left out",
            ),
            ("Nonlinearity", linear, "largest deviation from the line over full scale"),
            ("At rest", f"{first.at_rest:.4f} → {last.at_rest:.4f} °/s", "standard deviation, before the filter"),
            ("Filter delay", f"{study.chain.delay:.2f} s", f"FIR with {len(study.chain.taps)} taps"),
        ]
    )


def steps_table(figures: "Sequence[StepFigures]", caption: str) -> Table:
    """Return the figures of merit after every step."""

    def show(value: float | None, form: str) -> str:
        return "" if value is None else format(value, form)

    kinds: list[tuple[str, Callable[[StepFigures], str]]] = [
        ("After", lambda f: NAMES[f.step]),
        ("Nonlinearity (%)", lambda f: show(f.nonlinearity and 100 * f.nonlinearity, ".4f")),
        ("σ at rest (°/s)", lambda f: f"{f.at_rest:.4f}"),
        ("σ turning (°/s)", lambda f: f"{f.turning:.4f}"),
        ("Bias instability (°/h)", lambda f: show(f.bias_instability, ".2f")),
        ("Random walk at 1 s (°/√h)", lambda f: show(f.random_walk_1s, ".3f")),
        ("at 100 s (°/√h)", lambda f: show(f.random_walk_100s, ".3f")),
    ]
    # A column is left out where the runs are too short for it.
    shown = [(name, cell) for name, cell in kinds if any(cell(f) for f in figures)]
    columns = [name for name, _ in shown]
    rows = [[cell(f) for _, cell in shown] for f in figures]
    note = "σ: standard deviation over the temperature run."
    if any("instability" in name for name, _ in shown):
        note += " Bias instability: lowest Allan deviation over 0.664. A filter lowers the random walk read at 1 s; at 100 s it cannot."
    return Table(caption, columns, rows, note)


def coefficients_table(chain: "BellChain", output: str) -> Table:
    """Return the coefficients with their standard errors, in °C and °/s."""
    raw = "counts" if output == "output_counts" else "°/s"
    errors = np.sqrt(np.diag(chain.rough_covariance))
    rows = [
        ["rough (33)", "null", *to_error(chain.null, errors[0]), raw],
        ["rough (33)", "scale", *to_error(chain.scale / DEG, errors[1] / DEG), f"°/s per {raw}"],
    ]
    curves: list[tuple[str, PolynomialCurve, float, float, tuple[str, ...]]] = [
        ("bias (34)", chain.bias, 1.0, 0.0, ("°/s", "°/s per °C", "°/s per °C²")),
        ("scale over rate (35)", chain.scale_over_rate, 1.0, 1.0, ("°/s", "ratio", "per °/s")),
        ("scale over temperature (36)", chain.scale_over_temperature, 0.0, 0.0, ("ratio", "per °C", "per °C²")),
    ]
    for name, curve, y, x, units in curves:
        size = DEG ** (x * np.arange(len(curve.coefficients)) - y)
        spread = size * np.sqrt(np.diag(curve.covariance))
        for i, (value, error) in enumerate(zip(size * curve.coefficients, spread, strict=True)):
            rows.append([name, f"c{i}", *to_error(value, error), units[i] if i < len(units) else ""])
    note = (
        "Each step is fitted to what the steps before it deliver, and its errors hold given those. Temperature from 0 °C. The errors"
        " allow for white noise plus a random walk."
    )
    columns = ["Step", "Coefficient", "Value", "Standard error", "Unit"]
    return Table("Coefficients of the chain", columns, rows, note)


def claim_blocks(claims: "Claims") -> list[Block]:
    """Return the printed results beside what the printed coefficients make of them."""
    short = dict(claims.averaging)
    rows = [
        [
            "σ that (34) takes out at rest",
            f"{claims.bias_deviation[1]:.4f} °/s",
            f"{claims.bias_deviation[0]:.4f} °/s",
            "agrees",
        ],
        [
            "σ that (36) takes out at 300 °/s",
            f"{claims.scale_deviation[1]:.4f} °/s",
            f"{claims.scale_deviation[0]:.4f} °/s",
            "agrees within 12 %",
        ],
        [
            "Nonlinearity before (35)",
            "0.2 %",
            f"{100 * claims.curvature_nonlinearity:.2f} %",
            "the quadratic makes 0.7 of it",
        ],
        ["What (35) makes of −361.4 °/s", "−360 °/s (applied)", f"{claims.mapped[0]:.1f} °/s", "disagrees by 0.8 %"],
        ["… and (36) at 25 °C after it", "−360 °/s (applied)", f"{claims.mapped[1]:.1f} °/s", "disagrees by 1.1 %"],
        [
            "Factor (36) at 25 °C, where (35) was fitted",
            "1, if both are right",
            f"{claims.mapped[1] / claims.mapped[0]:.4f}",
            "disagrees by 0.3 %",
        ],
        [
            "σ of 2.78 °/√h at 10 Hz",
            "0.0619 °/s in all",
            f"{claims.noise_deviation:.4f} °/s",
            "cannot both be white noise",
        ],
        [
            "Random walk after the filter, read at 1 s",
            "3.98 times lower",
            f"{short[1.0]:.2f} times lower",
            f"a cut-off of {claims.cutoff_for_printed:.2f} Hz would do it",
        ],
        [
            "Random walk after the filter, read at 100 s",
            "3.98 times lower",
            f"{short[100.0]:.3f} times lower",
            "no filter of 5 s can",
        ],
        ["Cut-off of the filter", "200 Hz", "below 5 Hz", "impossible at an output every 0.1 s"],
        ["Rough scale", "0.0242 in (33), 0.00242 in the text", "0.0242 used", "misprint"],
    ]
    note = (
        "Ours: computed from the printed coefficients over −45…55 °C and ±360 °/s; filter of order 50, cut-off 1 Hz. The bias instability"
        " of 20.5 → 4.67 °/h depends on the length and ramp of a record that is not printed, so it can be neither confirmed nor refuted."
    )
    return [Table("Printed claims", ["Claim", "Printed", "Ours", "Verdict"], rows, note)]


def draw_steps(chain: "BellChain", runs: "tuple[BellRun, BellRun, BellRun]") -> Picture:
    """Draw the error of the rate before and after: at rest and turning over temperature, and over the applied rate."""
    from compensation.bell import apply_chain

    rates, rest, turning = runs
    with style.figure(1, 3, height=3.2) as (made, axes):
        for panel, run, x, label in (
            (axes[0], rest, rest.temperature - zero_Celsius, "temperature (°C)"),
            (axes[1], rates, rates.rate / DEG, "applied rate (°/s)"),
            (axes[2], turning, turning.temperature - zero_Celsius, "temperature (°C)"),
        ):
            result = apply_chain(
                replace(chain, taps=np.empty(0)), run.time, run.output, run.temperature, extrapolate=True
            )
            rows = style.few_rows(len(run.time))
            for values, colour, name in (
                (result.rough, style.ORANGE, "rough"),
                (result.temperature_compensated, style.BLUE, "compensated"),
            ):
                error = ((values - run.rate) / DEG)[rows]
                panel.plot(x[rows], error, ".", markersize=1.5, color=colour, label=name, rasterized=True)
            panel.axhline(0, color=style.BLACK, linewidth=0.8)
            panel.set_xlabel(label)
        axes[0].set_ylabel("rate error (°/s)")
        axes[0].set_title("at rest", fontsize=10)
        axes[1].set_title("several rates", fontsize=10)
        axes[2].set_title("turning", fontsize=10)
        axes[0].legend(markerscale=6, fontsize=8)
    return draw(
        made,
        "Error of the rate after the rough step and after all steps, before the filter.",
        "Three panels of rate error, before and after compensation.",
    )


def draw_allan(chain: "BellChain", rest: "BellRun") -> Picture:
    """Draw the Allan deviation at rest after the rough step, after the chain, and after the filter (figure 19)."""
    from compensation.bell import apply_chain
    from compensation.stability import allan_deviation

    result = apply_chain(chain, rest.time, rest.output, rest.temperature, extrapolate=True)
    step = float(rest.time[1] - rest.time[0])
    with style.figure(height=3.4) as (made, axes):
        for values, colour, name in (
            (result.rough, style.ORANGE, "rough"),
            (result.temperature_compensated, style.BLUE, "compensated"),
            (result.filtered, style.GREEN, f"and filtered, {len(chain.taps)} taps"),
        ):
            allan = allan_deviation(values / DEG * 3600, step)
            axes.loglog(allan.tau, allan.deviation, color=colour, label=name)
            axes.fill_between(allan.tau, allan.low, allan.high, color=colour, alpha=0.2)
        axes.axvline(step * len(chain.taps), color=style.BLACK, linewidth=0.8, linestyle=":")
        axes.set_xlabel("averaging time τ (s)")
        axes.set_ylabel("Allan deviation (°/h)")
        axes.legend()
    caption = (
        "Allan deviation at rest while the temperature rises, with its 68 % band. The dotted line is the length of the filter: to its"
        " right filtered and unfiltered are the same, so a random walk read there cannot have become smaller. This is a run that was fitted: the fit itself lowers the longest times."
    )
    return draw(made, caption, "Allan deviation over averaging time, three curves.")
