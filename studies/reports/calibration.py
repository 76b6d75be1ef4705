"""The page of a calibration: from the card as shipped to the noise, what moved, and what is left over."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shell.constants import zero_Celsius
from studies.calibration.observed import HOUSING, QUADRATURE, SETTLED
from studies.reports import style
from studies.reports.digits import plain, to_interval
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from studies.calibration.calibrate import Calibration
    from studies.calibration.estimates import Estimate

NAMES = {
    "frequency_Hz": "Frequency",
    "bias_deg_per_h": "Zero-rate output",
    "inverse_q": "1/Q",
    QUADRATURE: "Quadrature control",
    HOUSING: "Housing temperature",
    SETTLED: "Settled frequency",
}
SHOWN = {
    "frequency_Hz": ("mHz", 1e3),
    "bias_deg_per_h": ("°/h", 1.0),
    "inverse_q": ("ppb", 1e9),
    QUADRATURE: ("mV", 1e3),
    HOUSING: ("mK", 1e3),
    SETTLED: ("mHz", 1e3),
}
"""Unit in which small numbers of a response are shown, and how many of it make one."""
TOLD = {"data": "the data", "prior": "the prior", "both": "both"}


def calibration_page(found: "Calibration", data: Sequence[str]) -> str:
    """Return the page."""
    moved = sum(abs(one.shift_sd) > 2 for one in found.estimates)
    lead = (
        f"The card {found.card.name} against {len(data)} {'file' if len(data) == 1 else 'files'} ({', '.join(data)}): the most probable of its"
        f" {len(found.estimates)} uncertain values, with the noise estimated at the same time."
        f" {sum(one.told_by == 'data' for one in found.estimates)} are determined by the data,"
        f" {sum(one.told_by == 'prior' for one in found.estimates)} stayed at their prior; {moved or 'none'} moved by more than two"
        " prior standard deviations."
    )
    blocks: list[Block] = [
        _facts(found),
        *(Text(warning, "warning") for warning in found.warnings),
        ladder_table(found),
    ]
    held = held_out_table(found)
    chapters = [
        Chapter("From the card to the noise", [*blocks, _ladder_figure(found), *([held] if held is not None else [])]),
        Chapter("Values", [values_table(found), *_inseparable(found), _shift_figure(found)]),
        Chapter("Residuals over time, and noise", [residual_figure(found), noise_table(found)]),
    ]
    return render_page("Calibration", lead, chapters)


def _facts(found: "Calibration") -> Facts:
    rows = []
    for name, rung in found.ladder.items():
        unit, scale = SHOWN[name]
        remark = f"{plain(scale * rung.as_shipped)} {unit} as shipped; noise {plain(scale * rung.noise)} {unit}"
        rows.append((f"{NAMES[name]}, residual", f"{plain(scale * rung.calibrated)} {unit}", remark))
    return Facts(rows)


def values_table(found: "Calibration", touched: bool = False) -> Table:
    """Return what became of every uncertain value, or of those alone that the data touched."""
    silent = [one for one in found.estimates if touched and one.width > 0.9995 and abs(one.shift_sd) < 0.005]
    kept = [one for one in found.estimates if one not in silent]
    rows = [_value_row(one) for one in sorted(kept, key=lambda one: one.width)]
    note = (
        "* follows the curvature of the likelihood. Shift: move in prior standard deviations. Width: posterior over"
        " prior standard deviation; up to 0.5 the data determine the value, from 0.95 it stayed at its prior."
    )
    if silent:
        more = (
            "1 more value is as the card has it"
            if len(silent) == 1
            else f"{len(silent)} more values are as the card has them"
        )
        note += f" {more}: nothing in these data depends on {'it' if len(silent) == 1 else 'them'}."
    columns = ["Value", "Unit", "Card", "Calibrated", "90 % interval", "Shift", "Width", "Determined by"]
    return Table("Values, best known first", columns, rows, note, sortable=True)


def _value_row(one: "Estimate") -> list[str]:
    bound = f", at its {one.bound} bound" if one.bound else ""
    star = " *" if one.interval == "profile" else ""
    value, low, high = to_interval(one.value, one.low, one.high)
    shift = f"{one.shift_sd:+.2f}"
    return [
        one.parameter,
        one.unit if one.unit != "1" else "—",
        plain(one.card, 5),
        value,
        f"{low} … {high}{star}",
        "0.00" if shift in ("+0.00", "-0.00") else shift,
        f"{one.width:.3f}",
        TOLD[one.told_by] + bound,
    ]


def ladder_table(found: "Calibration") -> Table:
    """Return the residuals before and after, beside the noise."""
    rows = [
        [
            NAMES[name],
            SHOWN[name][0],
            *(plain(SHOWN[name][1] * v) for v in (rung.as_shipped, rung.calibrated, rung.noise)),
            plain(SHOWN[name][1] * rung.offset, 2),
            str(found.fit.outliers[name]),
        ]
        for name, rung in found.ladder.items()
    ]
    note = "Rms about the mean of each table; offset: rms of these means after the calibration."
    if set(found.ladder) != {SETTLED}:
        note = (
            "Rms of block averages about the mean of each run; offset: rms of these means after the calibration. Frequency, zero-rate"
            " output and 1/Q follow the measured housing where there is one, the housing its chamber."
        )
    columns = ["Response", "Unit", "As shipped", "Calibrated", "Noise", "Offset", "Outliers"]
    return Table("Residuals", columns, rows, note)


def held_out_table(found: "Calibration") -> Table | None:
    """Return how the held-out run was predicted."""
    held = found.held_out
    if held is None:
        return None
    rows = []
    for name, noise in held.noise.items():
        for words, by in (("chamber alone", held.chamber), ("measured housing", held.housing)):
            if name in by:
                unit, scale = SHOWN[name]
                stated = plain(scale * held.stated[name]) if by is held.chamber else ""
                before, after, usual = (plain(scale * v) for v in (*by[name], noise))
                rows.append([NAMES[name], unit, words, before, after, stated, usual])
    note = (
        f"{held.path or 'The run'} was predicted by a calibration that has not seen it. From the chamber alone nothing is refitted;"
        " from the housing its own offset and initial state are. Stated: what remains uncertain from the chamber, of the calibrated values,"
        " and of how a run begins and turns on, as these runs did."
    )
    columns = ["Response", "Unit", "Predicted from", "As shipped", "Calibrated", "Stated", "Noise"]
    return Table("Held-out run", columns, rows, note)


def noise_table(found: "Calibration") -> Table:
    """Return the levels of the noise."""
    rows = [
        [
            NAMES[name],
            SHOWN[name][0],
            *(plain(SHOWN[name][1] * level) for level in (n.white, n.flicker, 60.0 * n.walk, n.offset)),
        ]
        for name, n in found.fit.noise.items()
    ]
    note = "White: Allan deviation at 1 s. Flicker: its flat part. Walk: standard deviation of the change in 1 h. Offset: of a run's turn-on."
    return Table("Noise, estimated", ["Response", "Unit", "White", "Flicker", "Walk", "Offset"], rows, note)


def separation_sentences(found: "Calibration") -> list[str]:
    """Return what the data cannot tell apart."""
    return [f"The data determine only a combination of {', '.join(group)}." for group in found.groups]


def _inseparable(found: "Calibration") -> list[Block]:
    rows = [[str(k + 1), ", ".join(group)] for k, group in enumerate(found.groups)]
    return [Table("Only combinations of these are determined", ["Group", "Values"], rows)] if rows else []


def _ladder_figure(found: "Calibration") -> Picture:
    with style.figure(1, len(found.ladder), height=2.5, squeeze=False) as (made, axes):
        for axis, (name, rung) in zip(axes[0], found.ladder.items(), strict=True):
            unit, scale = SHOWN[name]
            heights = [scale * rung.as_shipped, scale * rung.calibrated]
            axis.bar(["shipped", "calibrated"], heights, color=[style.VERMILION, style.BLUE], width=0.6)
            axis.axhline(scale * rung.noise, color=style.BLACK, linestyle="--", linewidth=1.0)
            for k, height in enumerate(heights):
                axis.annotate(plain(height), (k, 0.5 * height), ha="center", va="center", fontsize=8, color="white")
            axis.set_ylim(0.0, 1.25 * max(*heights, scale * rung.noise))
            axis.set_title(f"{NAMES[name]} ({unit})", fontsize=8, loc="left")
            axis.tick_params(labelsize=8)
            axis.grid(visible=False, axis="x")
        words = "Residuals as shipped and calibrated; dashed: the noise."
        return draw(made, words, words)


def _shift_figure(found: "Calibration") -> Picture:
    told = [one for one in found.estimates if one.told_by != "prior"][:30] or list(found.estimates)[:30]
    with style.figure(height=0.24 * len(told) + 0.9) as (made, axis):
        place = np.arange(len(told))[::-1]
        axis.axvspan(-1.645, 1.645, color=style.SKY, alpha=0.18)
        shifts, widths = [one.shift_sd for one in told], [1.645 * one.width for one in told]
        axis.errorbar(shifts, place, xerr=widths, fmt="o", markersize=4, capsize=2, color=style.BLUE)
        axis.axvline(0.0, color=style.BLACK, linewidth=0.8)
        axis.set_yticks(place, [one.parameter for one in told], fontsize=8)
        axis.set_xlabel("prior standard deviations from the card")
        words = "Shifts of the values that the data determine at least in part, with 90 % intervals; shaded: 90 % of the prior."
        return draw(made, words, words)


def residual_figure(found: "Calibration") -> Picture:
    """Draw measured minus predicted after the calibration, over time."""
    problem, state = found.fit.problem, found.fit.state
    names = [name for name in problem.responses if name != SETTLED]
    colours = (style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE)
    if not names:
        return _settled_figure(found)
    with style.figure(len(names), 1, height=1.8 * len(names), squeeze=False, sharex=True) as (made, axes):
        for axis, name in zip(axes[:, 0], names, strict=True):
            rows, start = problem.rows[name], 0.0
            for run, (t, s) in enumerate(zip(rows.times, rows.slices, strict=True)):
                values = SHOWN[name][1] * state.residual[name][s]
                axis.plot((start + t - t[0]) / 3600, values, linewidth=0.7, color=colours[run % 5])
                start += t[-1] - t[0] + 600.0
            axis.axhline(0.0, color=style.BLACK, linewidth=0.6)
            axis.set_ylabel(f"{NAMES[name]}\n({SHOWN[name][0]})", fontsize=8)
        axes[-1, 0].set_xlabel("time of the runs one after the other (h)")
        words = "Measured minus predicted after the calibration, block averages, one colour a run."
        return draw(made, words, words)


def _settled_figure(found: "Calibration") -> Picture:
    problem, residual = found.fit.problem, found.fit.state.residual[SETTLED]
    T = np.concatenate([table.temperature for table in problem.tables]) - zero_Celsius
    with style.figure(height=2.4) as (made, axis):
        axis.plot(T, 1e3 * residual, "o", color=style.BLUE, markersize=4)
        axis.axhline(0.0, color=style.BLACK, linewidth=0.6)
        axis.set_xlabel("temperature (°C)")
        axis.set_ylabel("residual (mHz)")
        words = "Measured minus calculated settled frequency after the calibration."
        return draw(made, words, words)
