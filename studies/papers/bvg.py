"""The BVG paper's compensation chain on a virtual gyro by its printed coefficients, beside its claims and what can explain them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np

from compensation.arrays import Array
from compensation.bell import BellChain, PolynomialCurve, apply_chain, design_smoother, invert_chain
from compensation.bell_calibration import BellRun, fit_chain
from compensation.linearity import measure_nonlinearity
from compensation.stability import allan_deviation
from studies.fits.misread_scale import Runs
from studies.fits.scale import StepFigures, judge_steps
from studies.reports import style
from studies.results import Chapter, Column, Drawing, Figure, Table

STEP = 0.1  # output step (s), printed
RANDOM_WALK, WANDER = 2.7821, 20.0
"""White noise (°/√h): the printed random walk before compensation. Random walk of the bias (°/h per √h): assumed."""
LOWEST, HIGHEST, ROOM = -45.0, 55.0, 25.0
SWEEP, DWELL = 10_000.0, 60.0  # length (s) of a temperature sweep at 0.6 °C/min and of one applied rate: assumed
CUTOFF, ORDER = 1.0, 50
PRINTED = {
    "nonlinearity": (0.002, 0.0003), "deviation_at_rest": (0.1624, 0.0619),
    "deviation_turning": (0.1663, 0.0638), "bias_instability": (20.5, 4.67), "random_walk": (2.7821, 0.6982),
}  # fmt: skip


def read_printed_chain() -> BellChain:
    """Return the chain with the printed coefficients (rough scale 0.0242, as eq. (33) has it), valid everywhere."""
    text = (files("studies.papers") / "bvg_compensation.csv").read_text(encoding="utf-8")
    lines = [line.split(",") for line in text.splitlines() if line and not line.startswith(("#", "quantity"))]
    row = {name: np.array([float(value) for value in values]) for name, *values in lines}

    def curve(name: str) -> PolynomialCurve:
        return PolynomialCurve(row[name], np.zeros((3, 3)), -np.inf, np.inf)

    return BellChain(
        null=float(row["rough"][0]),
        scale=float(row["rough"][1]),
        rough_covariance=np.zeros((2, 2)),
        bias=curve("bias"),
        scale_over_rate=curve("scale_over_rate"),
        scale_over_temperature=curve("scale_over_temperature"),
        taps=np.empty(0),
        sampling=STEP,
    )


def simulate_runs(generator: np.random.Generator) -> tuple[BellRun, BellRun, BellRun]:
    """Return virtual runs: rates ±360 °/s at 25 °C, rest and 300 °/s over −45…55 °C."""
    gyro = read_printed_chain()
    sweep = np.linspace(LOWEST, HIGHEST, round(SWEEP / STEP))
    plateaus = np.repeat(np.arange(-360.0, 361.0, 40.0), round(DWELL / STEP)).astype(np.float64)

    def run(rate: Array, temperature: Array) -> BellRun:
        white = RANDOM_WALK * 60 / np.sqrt(STEP) * generator.standard_normal(len(rate))
        wander = WANDER * np.sqrt(STEP / 3600) * np.cumsum(generator.standard_normal(len(rate)))
        noise = (white + wander) / 3600 / gyro.scale
        time = (STEP * np.arange(len(rate))).astype(np.float64)
        return BellRun(time, invert_chain(gyro, rate, temperature) + noise, temperature, rate)

    rest, turning = np.zeros(len(sweep)), np.full(len(sweep), 300.0)
    return run(plateaus, np.full(len(plateaus), ROOM)), run(rest, sweep), run(turning, sweep)


@dataclass(frozen=True)
class BellTwin:
    """The fitted chain, its figures step by step on the runs fitted and on runs not seen, and the printed claims tested."""

    chain: BellChain
    runs: tuple[BellRun, BellRun, BellRun]
    fitted: list[StepFigures]
    held_out: list[StepFigures]
    claims: "Claims"


def reproduce_bell(seed: int = 0) -> BellTwin:
    """Return the twin for one seed."""
    generator = np.random.default_rng(seed)
    runs, fresh = simulate_runs(generator), simulate_runs(generator)
    chain = fit_chain(*runs, cutoff=CUTOFF, order=ORDER)
    return BellTwin(chain, runs, judge_steps(chain, *runs), judge_steps(chain, *fresh), examine_claims())


@dataclass(frozen=True)
class Claims:
    """What the printed coefficients imply for the printed results."""

    # standard deviations (°/s) of (34), and of (36) at 300 °/s, over −45…55 °C; and those that the printed before and after imply
    bias_deviation: tuple[float, float]
    scale_deviation: tuple[float, float]
    curvature_nonlinearity: float  # that the quadratic term of (35) makes over ±360 °/s
    mapped: tuple[float, float]  # what (35), and (35) with (36) at 25 °C, make of the printed −361.4 °/s
    noise_deviation: float  # (°/s) of samples that are white noise of the printed random walk before the filter
    averaging: tuple[tuple[float, float], ...]  # τ (s), factor by which the filter lowers white noise's Allan deviation
    cutoff_for_printed: float  # Hz, with which the order-50 filter lowers it at τ = 1 s by the printed ratio


def examine_claims() -> Claims:
    """Return the printed results computed from the printed coefficients, where that can be done."""
    from scipy.optimize import brentq

    gyro = read_printed_chain()
    sweep = np.linspace(LOWEST, HIGHEST, 2001)
    rates = np.linspace(-360, 360, 2001)
    curved = measure_nonlinearity(rates, gyro.scale_over_rate.value(rates))
    over_rate = float(gyro.scale_over_rate.value(-361.4))
    taps = design_smoother(STEP, CUTOFF, ORDER)
    before, after = PRINTED["random_walk"]
    cutoff = brentq(lambda f: reduce_white(design_smoother(STEP, f, ORDER), 10) - before / after, 0.05, 4.0)
    return Claims(
        (float(np.std(gyro.bias.value(sweep))), _removed("deviation_at_rest")),
        (float(np.std(gyro.scale_over_temperature.value(sweep))) * 300, _removed("deviation_turning")),
        curved,
        (over_rate, over_rate * float(gyro.scale_over_temperature.value(ROOM))),
        float(before / 60 / np.sqrt(STEP)),
        tuple((rows * STEP, reduce_white(taps, rows)) for rows in (1, 10, 100, 1000)),
        float(cutoff),
    )


def reduce_white(taps: Array, rows: int) -> float:
    """Return the factor by which a FIR filter lowers the Allan deviation of white noise over `rows` samples: exact, by the window convolved."""
    window = np.r_[-np.ones(rows), np.ones(rows)]
    return float(np.linalg.norm(window) / np.linalg.norm(np.convolve(window, taps)))


def _removed(name: str) -> float:
    before, after = PRINTED[name]
    return float(np.sqrt(before**2 - after**2))


SOURCES = ("Su Z., Liu N., Li Q., Sensors 2015, 15, 23684–23705, doi:10.3390/s150923684: equations (1)–(36).",)
NAMES = {
    "rough": "rough (33)",
    "bias_compensated": "bias over temperature (34)",
    "rate_compensated": "scale over rate (35)",
    "temperature_compensated": "scale over temperature (36)",
    "filtered": "FIR filter",
}
ERRORS = "Rate error after the first step (rough) and after all steps (compensated), before the filter."
ALLAN = (
    "Allan deviation at rest during the temperature ramp, with its 68 % band. The dotted line marks the filter length; at longer"
    " averaging times filtering changes nothing, so it cannot reduce a random walk read there. The run was used for the fit, which lowers the curve at the longest times."
)
STEP_COLUMNS = (
    Column(lambda figures: NAMES[figures.step], "After"),
    "nonlinearity: Nonlinearity (%) ×100 .4f | at_rest: σ at rest (°/s) .4f | turning: σ at constant rate (°/s) .4f | bias_instability: Bias instability (°/h) .2f"
    " | random_walk_1s: Random walk at 1 s (°/√h) .3f | random_walk_100s: Random walk at 100 s (°/√h) .3f",
)


def bell_chapters(twin: BellTwin) -> list[Chapter]:
    """Return the chapters of the twin for the page of `hrg reproduce`."""
    steps = Figure(lambda: draw_steps(twin.chain, twin.runs), ERRORS)
    tables = [steps_table(twin.held_out, "Held-out runs"), steps_table(twin.fitted, "Fitted runs")]
    alt = "Allan deviation over averaging time, three curves."
    allan = Figure(lambda: _draw_allan(twin.chain, twin.runs[1]), ALLAN, alt)
    title = "BVG equations (32)–(36): the compensation chain on a virtual gyro"
    return [
        Chapter(title, [TWIN, *tables, steps, allan]),
        Chapter("BVG: check of the published claims", [_claims_table(twin.claims)]),
    ]


TWIN = (
    "A virtual gyro that the published coefficients compensate exactly, with the published angle random walk of 2.78 °/√h as white noise"
    " and an assumed bias random walk of 20 °/h per √h. Nothing was tuned to the published results."
)


def steps_table(steps: Sequence[StepFigures], title: str) -> Table:
    """Return the figures of merit after every step; a column is left out where the records are too short for it."""
    note = (
        "σ: standard deviation over the temperature run. At a constant rate the temperature errors of bias and scale may partly cancel:"
        " σ can then grow when only the bias is compensated, until the scale over temperature is, too."
    )
    if any(step.bias_instability is not None for step in steps):
        note += " Bias instability: minimum of the Allan deviation divided by 0.664. A filter lowers the random walk at 1 s, not at 100 s."
    return Table(title, steps, STEP_COLUMNS, note)


def _claims_table(claims: Claims) -> Table:
    """Return the printed results beside what the printed coefficients make of them."""
    short = dict(claims.averaging)
    (bias, printed_bias), (scale, printed_scale) = claims.bias_deviation, claims.scale_deviation
    rows = [
        ("σ removed by (34) at rest", f"{printed_bias:.4f} °/s", f"{bias:.4f} °/s", "agrees"),
        ("σ removed by (36) at 300 °/s", f"{printed_scale:.4f} °/s", f"{scale:.4f} °/s", "agrees within 12 %"),
        ("Nonlinearity before (35)", "0.2 %", f"{100 * claims.curvature_nonlinearity:.2f} %", "the quadratic term explains 0.7 of it"),
        ("−361.4 °/s after (35)", "−360 °/s (applied)", f"{claims.mapped[0]:.1f} °/s", "disagrees by 0.8 %"),
        ("… and after (36) at 25 °C", "−360 °/s (applied)", f"{claims.mapped[1]:.1f} °/s", "disagrees by 1.1 %"),
        ("Factor (36) at 25 °C, where (35) was fitted", "1, if both are correct", f"{claims.mapped[1] / claims.mapped[0]:.4f}", "disagrees by 0.3 %"),
        ("σ of 2.78 °/√h at 10 Hz", "0.0619 °/s in total", f"{claims.noise_deviation:.4f} °/s", "cannot both be white noise"),
        ("Random walk after the filter, read at 1 s", "3.98 times lower", f"{short[1.0]:.2f} times lower", f"a cut-off of {claims.cutoff_for_printed:.2f} Hz would be needed"),
        ("Random walk after the filter, read at 100 s", "3.98 times lower", f"{short[100.0]:.3f} times lower", "impossible with a filter of 5 s"),
        ("Cut-off of the filter", "200 Hz", "below 5 Hz", "impossible with a sampling interval of 0.1 s"),
        ("Rough scale", "0.0242 in (33), 0.00242 in the text", "0.0242 used", "misprint"),
    ]  # fmt: skip
    note = (
        "Recomputed from the published coefficients over −45 … 55 °C and ±360 °/s; filter of order 50, cut-off 1 Hz. The bias instability"
        " of 20.5 → 4.67 °/h depends on the length and temperature ramp of an unpublished record and cannot be checked."
    )
    return Table("Published claims", rows, "0: Claim | 1: Published | 2: Recomputed | 3: Verdict", note)


def draw_steps(chain: BellChain, runs: Runs) -> Drawing:
    """Draw the error of the rate before and after: at rest and turning over temperature, and over the applied rate."""
    rates, rest, turning = runs
    unfiltered = replace(chain, taps=np.empty(0))
    named = (("at rest", rest), ("several rates", rates), ("constant rate", turning))
    panels = [(title, run) for title, run in named if run is not None]
    with style.panels(len(panels), 3, 3.2, sharey=True) as (made, axes):
        axes[0].set_ylabel("rate error (°/s)")
        for panel, (title, run) in zip(axes, panels, strict=True):
            over_rate = run is rates
            x = run.rate if over_rate else run.temperature
            label = "applied rate (°/s)" if over_rate else "temperature (°C)"
            result = apply_chain(unfiltered, run.time, run.output, run.temperature, extrapolate=True)
            rows = style.few_rows(len(run.time))
            for values, colour, name in (
                (result.rough, style.ORANGE, "rough"),
                (result.temperature_compensated, style.BLUE, "compensated"),
            ):
                error = (values - run.rate)[rows]
                panel.plot(x[rows], error, ".", markersize=1.5, color=colour, label=name, rasterized=True)
            panel.axhline(0, color=style.BLACK, linewidth=0.8)
            panel.set_xlabel(label)
            panel.set_title(title, fontsize=10)
            panel.legend(markerscale=6, fontsize=8)
        return made


def _draw_allan(chain: BellChain, rest: BellRun) -> Drawing:
    """Draw the Allan deviation at rest after the rough step, after the chain, and after the filter (figure 19)."""
    result = apply_chain(chain, rest.time, rest.output, rest.temperature, extrapolate=True)
    step = float(rest.time[1] - rest.time[0])
    with style.figure(height=3.4, x="averaging time τ (s)", y="Allan deviation (°/h)") as (made, axes):
        for values, colour, name in (
            (result.rough, style.ORANGE, "rough"),
            (result.temperature_compensated, style.BLUE, "compensated"),
            (result.filtered, style.GREEN, f"and filtered, {len(chain.taps)} taps"),
        ):
            style.draw_allan(axes, allan_deviation(values * 3600, step), colour, name)
        axes.axvline(step * len(chain.taps), color=style.BLACK, linewidth=0.8, linestyle=":")
        return made
