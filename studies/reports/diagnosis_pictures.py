"""Pictures of a diagnosis: the ladder of the residual, the residual in time and against its inputs, the next run."""

from typing import TYPE_CHECKING

import numpy as np

from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import ResponseResult
from studies.reports.digits import plain
from studies.reports.style import BLACK, BLUE, ORANGE, VERMILION, few_rows, figure, panels
from studies.results import Drawing

if TYPE_CHECKING:
    from studies.inference.diagnosis import Inference
    from studies.planning.programme import NextRun


def ladder(diagnosis: "Inference") -> Drawing:
    """Draw what is left of every response: with the card as given, calibrated, with the named physics, noise; on held-out rows."""
    columns = diagnosis.shown_responses
    with figure(1, len(columns), height=3.0, squeeze=False) as (canvas, axes):
        for axis, column in zip(axes[0], columns, strict=True):
            response, result = RESPONSES[column], diagnosis.verdict.responses[column]
            steps = [(word, value) for word, value in rungs(result) if value]
            values = [value * response.scale for _, value in steps]
            colours = {"as given": BLACK, "calibrated": VERMILION, "with causes": BLUE, "noise": ORANGE}
            axis.bar(range(len(steps)), values, color=[colours[word] for word, _ in steps], width=0.7)
            for k, (_, value) in enumerate(steps):
                label = plain(value * response.scale)
                kelvin = as_temperature(diagnosis, column, value)
                words = label if kelvin is None else f"{label}\n{kelvin}"
                axis.annotate(words, (k, values[k]), ha="center", va="bottom", fontsize=8)
            axis.set_xticks(range(len(steps)), [word.replace(" ", "\n") for word, _ in steps], fontsize=8)
            axis.set_ylim(0.0, 1.3 * max(values, default=1.0))
            axis.set_title(f"{response.word} ({response.shown})", loc="left", fontsize=10)
            axis.grid(visible=False, axis="x")
        return canvas


def rungs(result: ResponseResult) -> list[tuple[str, float | None]]:
    """Return the steps of the ladder, held out where that could be had."""

    def best(pair: tuple[float | None, float | None] | None) -> float | None:
        return None if pair is None else (pair[1] if pair[1] is not None else pair[0])

    return [
        ("as given", result.shipped),
        ("calibrated", best(result.baseline)),
        ("with causes", best(result.extended)),
        ("noise", result.noise),
    ]


def as_temperature(diagnosis: "Inference", column: str, value: float) -> str | None:
    """Return the error of temperature that a residual of the frequency amounts to; None for the others."""
    if not RESPONSES[column].thermometer:
        return None
    slope = diagnosis.seen(column).slope
    size, unit = (1e3, "mK") if value < 0.1 * slope else (1.0, "K")
    return f"{plain(size * value / slope, 2)} {unit}" if slope else None


def before_and_after(diagnosis: "Inference", response: str) -> Drawing:
    """Draw the residual over the campaign before and, if anything is named, after the extension; the noise as a band."""
    seen, unit = diagnosis.seen(response), RESPONSES[response]
    noise = (diagnosis.verdict.responses[response].noise or 0.0) * unit.scale
    strips = [(seen.plain, "calibrated simulation", VERMILION)]
    if seen.named:
        strips.append((seen.final, "with the named causes", BLUE))
    with figure(len(strips), 1, height=2.0 * len(strips), sharex=True, sharey=True, squeeze=False) as (canvas, grid):
        axes = grid[:, 0]
        for axis, (residuals, title, colour) in zip(axes, strips, strict=True):
            begin = 0.0
            for rows, rest in zip(seen.time, residuals, strict=True):
                few = few_rows(len(rows))
                axis.plot((begin + rows[few] - rows[0]) / 3600.0, rest[few] * unit.scale, color=colour, linewidth=0.6)
                begin += float(rows[-1] - rows[0])
                axis.axvline(begin / 3600.0, color="#b0b6bd", linewidth=0.8)
            axis.axhspan(-2 * noise, 2 * noise, color=ORANGE, alpha=0.25, label="noise, ±2 rms")
            axis.set_title(title, loc="left", fontsize=10)
            axis.set_ylabel(f"residual ({unit.shown})")
        axes[0].legend(loc="upper right")
        axes[-1].set_xlabel("time, runs in sequence (h)")
        return canvas


def residual_views(diagnosis: "Inference", response: str) -> Drawing:
    """Draw the baseline's residual against temperature (heating and cooling), rate, frequency and the drives."""
    seen, unit = diagnosis.seen(response), RESPONSES[response]
    inputs, rest, runs = seen.inputs, seen.rest * unit.scale, seen.run
    heating = inputs["rate (K/min)"] > 0
    with panels(len(inputs) + 1, sharey=True) as (canvas, axes):
        for axis, (label, values) in zip(axes, inputs.items(), strict=False):
            for rows, colour, name in ((heating, VERMILION, "heating"), (~heating, BLUE, "cooling")):
                axis.plot(values[rows], rest[rows], ".", color=colour, markersize=2, label=name, rasterized=True)
            axis.set_xlabel(label)
            axis.locator_params(axis="x", nbins=4)
            axis.ticklabel_format(axis="x", useOffset=False)
        axes[-1].boxplot([rest[runs == k] for k in np.unique(runs)], showfliers=False)
        axes[-1].set_xlabel("run")
        for axis in axes[::2]:
            axis.set_ylabel(f"residual ({unit.shown})")
        axes[0].legend(markerscale=4)
        return canvas


def next_run_picture(run: "NextRun") -> Drawing:
    """Draw the suggested run: the chamber's temperature, and the drives that step."""
    rows = 1 + len(run.drives)
    heights = [2.0] + [0.7] * len(run.drives)
    tall = 1.1 + sum(heights)
    with figure(rows, 1, tall, sharex=True, squeeze=False, height_ratios=heights) as (canvas, axes):
        axes[0, 0].plot(run.time_h, run.temperature_degC, color=VERMILION)
        axes[0, 0].set_ylabel("chamber (°C)")
        for axis, (column, steps) in zip(axes[1:, 0], run.drives.items(), strict=True):
            begin = np.arange(len(steps.levels) + 1) * steps.hold_min / 60.0
            axis.stairs(steps.levels, begin, baseline=None, color=BLUE)
            axis.set_ylabel(column, rotation=0, ha="right", va="center", fontsize=8)
            axis.locator_params(axis="y", nbins=3)
            axis.margins(y=0.2)
        axes[-1, 0].set_xlabel("time (h)")
        return canvas
