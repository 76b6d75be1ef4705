"""The page of `hrg show`: a record's columns over time and temperature, their spectra, noise and correlation."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from compensation.noise import FLAT
from studies.instrument.display import display_name
from studies.instrument.units import unit_of
from studies.record.rest import TEMPERATURES
from studies.record.survey import CONFIDENCE, Survey, average_evenly
from studies.record.uses import Use
from studies.reports import style
from studies.reports.columns import column_title, draw_columns
from studies.results import Chapter, Column, Drawing, Figure, Head, Part, Sentence, Table, row_of


def _count(key: str, unit: str = "") -> Column:
    """Return a column that is empty where there are none."""
    heading = key.removesuffix("_s").replace("_", " ").capitalize()
    return Column(lambda row: row.get(key) or None, heading, unit, digits=3)


COLUMNS: Head = (
    Column("column", "Column", spell=display_name),
    "Unit | low: Minimum .7g | high: Maximum .7g | resolution: Resolution .2",
    *(_count(key) for key in ("missing", "gaps")),
    _count("longest_gap_s", "s"),
    *(_count(key) for key in ("spikes", "stuck", "zeros", "steps")),
)
COLUMNS_NOTE = "Missing values, gaps, spikes, stuck readings, dropouts to 0 and steps are listed if there are any."
NOISE = (
    Column("column", "Column", spell=display_name),
    "Unit | noise.white ± noise.white_sd: White, at 1 s | noise.flicker ± noise.flicker_sd: Flicker, flat part"
    " | noise.walk ± noise.walk_sd: Random walk, in 1 s | noise.markov: Correlated, rms .2 | noise.markov_s: its time (s) .2 | noise.misfit: Misfit .2 | noise.instability_low …"
    " noise.instability_high: Minimum / 0.664 (bias instability), 90 % .3 | line.period_s: Period of a line (s) | line.rms: Its rms .2",
)
NOISE_NOTE = (
    "White noise, flicker and random walk have the Allan deviations N/√τ, a flat part and K √(τ/3), fitted together; where these miss"
    " the curve, correlated (Gauss–Markov) noise beside them. Where nothing explains the curve (misfit above 3) or the white noise stays open, for example where temperature drives a column, only the white noise is given, from"
    " second differences of the rows. Judge the others on a settled run."
)
USES = "Command | Gives | ready: Possible | Missing"
STEPS = (Column("column", "Column", spell=display_name), "time_s: At (s) .1f | Size")
SETTLED = "start_s: From (s) .0f | end_s: To (s) .0f | temperature_degC: Temperature (°C) .3f | frequency_Hz: Frequency (Hz) .6f | left_K: Remaining settling, at most (K) .2"
CORRELATIONS = (
    Column("one", "Column", spell=display_name),
    Column("two", "With", spell=display_name),
    "values: Correlation of values +.3f | changes: Correlation of changes +.3f",
)
CORRELATION_NOTE = "Slow drifts correlate without a common cause; the correlation of changes (of means over 1/200 of the record) is more telling."
DRIVEN = 3.0  # misfit from which on a column is driven by something, and its curve is not that of noise
FEW = 1500  # means that are drawn over temperature


def use_parts(uses: Sequence[Use]) -> list[Part]:
    """Return what the records can be used for, and the lines to type."""
    lines = "\n".join(use.line for use in uses if not use.missing)
    told = Sentence(lines, "source") if lines else "No command can use these records as they are."
    return [Table("Use of these records", uses, USES), told]


def run_chapters(survey: Survey, told: dict[str, Any], several: bool) -> list[Chapter]:
    """Return the chapters of one record; `told` is what the payload says of it."""
    name = Path(survey.record.path).name
    before, of = (f"{name}: ", f" of {name}") if several else ("", "")
    count = len(survey.record)
    drawn, step = "", 2 * count // style.MOST_POINTS
    if count > style.MOST_POINTS:
        drawn = f" Of {count:,} rows the least and the largest of every {step} are drawn; enlarging shows no more."
    noise = [column for column in survey.columns if column.stability is not None]
    dense = [column for column in survey.columns if column.density is not None]
    made = {column.density.even for column in dense if column.density is not None}
    how = {
        frozenset({True}): "Welch's method",
        frozenset({False}): "Lomb's method, since rows are unevenly spaced or missing",
    }.get(frozenset(made), "Welch's method; Lomb's for columns with missing rows")
    found: dict[str, Sequence[Part]] = {
        "over time": [
            Figure(lambda: draw_columns(survey.record.columns), f"All columns. Shaded: no values.{drawn}"),
        ],
        "steps and settled parts": [
            Table(f"Steps{of}", told["steps"], STEPS, "Small steps are found in means of 8 or 64 rows; the time is that between the two rows of the best fit."),
            Table(f"Settled parts{of}", told["settled"], SETTLED),
        ],
        "over temperature": _temperature_parts(survey),
        "noise": [
            Figure(lambda: _draw_stability(survey),
                "Overlapping Allan deviation with its 90 % interval, and (dashed) white noise, flicker and random walk fitted together."),
            Table(f"Noise{of}", told["columns"], NOISE, NOISE_NOTE),
        ] if noise else ["No column varies over enough rows for an Allan deviation."],
        "spectra": [Figure(lambda: _draw_spectra(survey), f"Amplitude spectral density ({how}), mean and slope removed.")] if dense else [],
        "correlation": [Table(f"Correlation between columns{of}", told["correlations"], CORRELATIONS, CORRELATION_NOTE, "page", sortable=True)],
    }  # fmt: skip
    chapters = [Chapter((before + title) if before else title.capitalize(), parts) for title, parts in found.items()]
    return [chapter for chapter in chapters if chapter.parts]


def _temperature_parts(survey: Survey) -> list[Figure]:
    wide = {c.name for c in survey.columns if c.range.high - c.range.low > 0.1}
    temperature = next((name for name in TEMPERATURES if name in wide), None)
    others = [c.name for c in survey.columns if c.name != temperature and c.varies]
    if temperature is None or not others:
        return []
    caption = "Each column against temperature, means over equal times; red: warming, blue: cooling. Two separate lines indicate a lag or hysteresis."
    return [Figure(lambda: _draw_over_temperature(survey, temperature, others), caption)]


def _draw_over_temperature(survey: Survey, temperature: str, others: Sequence[str]) -> Drawing:
    time, T = survey.record["time_s"], survey.record[temperature]
    with style.panels(len(others), x=column_title(temperature)) as (made, axes):
        for axis, name in zip(axes, others, strict=True):
            both = np.isfinite(T) & np.isfinite(survey.record[name])
            x, y = (average_evenly(time[both], values[both], FEW)[1] for values in (T, survey.record[name]))
            warming = np.gradient(np.convolve(np.pad(x, 7, mode="edge"), np.full(15, 1 / 15), mode="valid")) > 0 if len(x) > 2 else x > 0  # fmt: skip
            for rows, colour, label in ((warming, style.VERMILION, "warming"), (~warming, style.BLUE, "cooling")):
                axis.plot(x[rows], y[rows], ".", color=colour, markersize=2, label=label)
            axis.set_title(column_title(name), fontsize=9, loc="left")
        return made


def _draw_stability(survey: Survey) -> Drawing:
    shown = [(column.name, column.stability) for column in survey.columns if column.stability is not None]
    with style.panels(len(shown), x="averaging time τ (s)") as (made, axes):
        for axis, (name, found) in zip(axes, shown, strict=True):
            style.draw_allan(axis, found.allan, style.BLUE, "Allan deviation", found.noise)
            axis.set_title(column_title(name), fontsize=9, loc="left")
        return made


def _draw_spectra(survey: Survey) -> Drawing:
    shown = [(column.name, column.density) for column in survey.columns if column.density is not None]
    with style.panels(len(shown), x="frequency (Hz)") as (made, axes):
        for axis, (name, found) in zip(axes, shown, strict=True):
            axis.loglog(found.frequency, np.sqrt(found.density), color=style.BLUE, linewidth=1)
            axis.set_title(column_title(name, "/√Hz"), fontsize=9, loc="left")
        return made


def tell(survey: Survey) -> dict[str, Any]:
    """Return the payload of one record."""
    record = survey.record
    columns = []
    for column in survey.columns:
        row: dict[str, Any] = column.range.as_row() | {
            "unit": unit_of(column.name).removeprefix("1"), "mean": column.mean, "spikes": column.spikes, "stuck": column.stuck,
            "zeros": column.zeros, "steps": len(column.steps),
        }  # fmt: skip
        if column.stability is not None:
            noise, (value, low, high) = column.stability.noise, column.stability.allan.bias_instability
            known = noise.misfit < DRIVEN and noise.N_uncertainty <= max(noise.noise.white, column.white)
            levels = row_of(
                noise, white="noise.white", white_sd="N_uncertainty", flicker="noise.flicker", flicker_sd=("B_uncertainty", FLAT),
                walk="noise.walk", walk_sd="K_uncertainty",
            ) | {"instability": value, "instability_low": low, "instability_high": high, "confidence": CONFIDENCE}  # fmt: skip
            if noise.markov:
                levels |= {"markov": noise.markov, "markov_s": noise.markov_time}
            levels = levels if known else {"white": column.white}
            row["noise"] = {**levels, "misfit": noise.misfit}
        if column.line is not None:
            row["line"] = row_of(column.line, "rms", period_s="period")
        columns.append(row)
    steps = [{"column": c.name, "time_s": step.time, "size": step.size} for c in survey.columns for step in c.steps]
    names = {"start_s": "start", "end_s": "end"}
    found = (row_of(s, "temperature_degC", "frequency_Hz", "left_K", **names) for s in survey.settled)
    settled = [{key: value if np.isfinite(value) else None for key, value in row.items()} for row in found]
    correlations = sorted(survey.correlations, key=lambda row: -abs(float(row["changes"] or 0.0)))
    return {
        "path": record.path, "instrument": record.instrument, "start": record.start.isoformat() if record.start else None,
        "rows": len(record), "span_s": float(np.ptp(record["time_s"])), "step_s": survey.step, "even": survey.even,
        "columns": columns, "steps": steps, "settled": settled, "correlations": correlations,
    }  # fmt: skip
