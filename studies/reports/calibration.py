"""Parts of a calibration's answer: residuals from the card as given to the noise, values, and the figures of its page."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from compensation.constants import NINETY
from shell.constants import zero_Celsius
from shell.material import spell
from studies.calibration.calibrate import Calibration
from studies.calibration.observed import HOUSING, QUADRATURE, SETTLED, WORDS
from studies.errors import numbered
from studies.instrument.display import display_name
from studies.reports import style
from studies.reports.digits import plain
from studies.results import Chapter, Column, Drawing, Facts, Figure, Sentence, Table

NAMES = {name: word[0].upper() + word[1:] for name, word in WORDS.items()}
SHOWN = {
    "frequency_Hz": ("mHz", 1e3), "bias_deg_per_h": ("°/h", 1.0), "inverse_q": ("ppb", 1e9),
    QUADRATURE: ("mV", 1e3), HOUSING: ("mK", 1e3), SETTLED: ("mHz", 1e3),
}  # fmt: skip
"""Unit in which small numbers of a response are shown, and how many of it make one."""
VALUE = ("parameter", "unit", "card", "value", "low", "high", "shift_sd", "width", "told_by", "bound", "interval")
"""What is told of each value in the JSON."""
TOLD = {"data": "data", "prior": "prior", "both": "data and prior"}
VALUES = (
    Column("parameter", "quantity", spell=display_name),
    "unit | card: card .5",
    "value in low … high: calibrated | low … high: 90 % interval .0 | shift_sd: shift (sd) +.2f | width: width .3f | told: determined by",
)
KEY = Column("parameter", "key of the card", where="page")
RESIDUALS = "response | unit | as_shipped: as given .3 | calibrated: calibrated .3 | noise: noise .3 | run_offset: run offset .2 | outliers"
PREDICTED = "response | unit | source: predicted from | as_shipped: as given .3 | calibrated: calibrated .3 | stated: expected error .3 | noise: noise .3"
LEVELS = "response | unit | white: white .3 | flicker: flicker .3 | walk: walk .3 | offset: offset .3 | markov: correlated .3 | time: correlation time (s) .3"
OFFSETS = "Rms of block averages about the mean of each run; run offset: rms of these means after the calibration."
DRIVEN = "The measured housing drives the other responses where there is one."
ROWS = "Settled frequency: rms residual over the rows of the tables; noise: the scatter of these rows about the calibrated card."
WIDTHS = (
    "Shift: change in prior standard deviations. Width: posterior over prior standard deviation; the data determine a value up to 0.5,"
    " a value above 0.95 remains at its prior. Material properties: deviation from the law, relative where no unit is given."
)


def lead(found: Calibration, data: Sequence[str]) -> str:
    """Return what was calibrated, and how many of its values changed."""
    told = [one.told_by for one in found.estimates]
    moved = sum(abs(one.shift_sd) > 2 for one in found.estimates)
    return (
        f"Most probable values of the card {found.card.name}, from {', '.join(data)}. Of {len(told)} uncertain values the data determine"
        f" {told.count('data')}; {told.count('prior')} stay at their prior; {moved or 'none'} moved by more than two prior standard deviations."
    )


def best_known_first(payload: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the values as rows of `VALUES`."""
    return [
        {**one, "unit": one["unit"] if one["unit"] != "1" else "", "told": TOLD[one["told_by"]] + (f", at its {one['bound']} bound" if one["bound"] else "")}
        for one in sorted(payload["values"], key=lambda one: float(one["width"]))
    ]  # fmt: skip


def calibration_parts(found: Calibration, payload: Mapping[str, Any]) -> list[Chapter]:
    """Return what people read of a calibration, with the tables over rows of its payload."""
    responses = [_scaled(name, row) for name, row in payload["responses"].items()]
    facts = []
    for row in responses:
        given, calibrated, noise = (f"{plain(row[key])} {row['unit']}" for key in ("as_shipped", "calibrated", "noise"))
        facts.append((f"{row['response']}, residual", calibrated, f"{given} as given; noise {noise}"))
    rows = best_known_first(payload)
    touched = [one for one in rows if one["width"] <= 0.9995 or abs(one["shift_sd"]) >= 0.005]
    rest = [one for one in rows if one not in touched]
    unchanged = f" The data do not depend on {numbered(len(rest), 'more value')}." if rest else ""
    runs = set(found.ladder) - {SETTLED}
    notes = [*([OFFSETS, DRIVEN] if runs else []), *([ROWS] if SETTLED in found.ladder else [])]
    levels = [
        _scaled(name, {"white": n.white, "flicker": n.flicker, "walk": 60.0 * n.walk, "offset": n.offset, "markov": n.markov or None})
        | {"time": n.markov_time or None}
        for name, n in found.fit.noise.items()
        if name in runs
    ]  # fmt: skip
    groups = "; ".join(spell([display_name(name) for name in group]) for group in found.groups)
    return [
        Chapter("Fit of the card to the data", [
            *(" ".join(one.sentences) for one in found.settled),
            Facts(facts, "page"),
            *(Sentence(warning, "warning", "page") for warning in found.warnings),
            Table("Residuals", responses, RESIDUALS, " ".join(notes)),
            Figure(lambda: _draw_residuals(found), "Residuals with the card as given and calibrated; dashed: the noise."),
            Table("Held-out run", _predicted(payload), PREDICTED, _held_out_note(payload)),
        ]),
        Chapter("Values", [
            Table("Values, best known first", touched, (*VALUES, KEY), WIDTHS + unchanged, sortable=True),
            f"Correlated by more than 0.9, so that the data determine a combination better than each value: {groups}." if groups else "",
            Figure(lambda: _draw_shifts(found), "Shifts of the values that the data determine at least in part, with 90 % intervals; shaded: 90 % of the prior."),
            Table("Values that the data do not depend on", rest, (*VALUES[:2], KEY), "", "page", sortable=True),
        ]),
        Chapter("Residuals over time, and noise" if runs else "Residuals over temperature", [
            Figure(lambda: residual_figure(found), "Measured minus predicted after the calibration" + ("; block averages, one colour for each run." if runs else ".")),
            Table("Noise levels", levels, LEVELS, "White: Allan deviation at 1 s. Flicker: flat part of the Allan deviation. Walk: standard deviation of the change in 1 h. Offset: standard deviation from run to run. Correlated: rms of Gauss–Markov noise, where there is some.", "page"),
        ]),
    ]  # fmt: skip


def _scaled(name: str, row: Mapping[str, Any]) -> dict[str, Any]:
    unit, scale = SHOWN[name]
    numbers = {key: scale * value if isinstance(value, float) else value for key, value in row.items()}
    if name == SETTLED:
        numbers.pop("run_offset", None)
    return {**numbers, "response": NAMES[name], "unit": unit}


def _predicted(payload: Mapping[str, Any]) -> list[dict[str, Any]]:
    held = payload["held_out"]
    return [
        _scaled(name, {**one[by], "source": words, "noise": one["noise"], "stated": one["stated"] if by == "chamber" else None})
        for name, one in (held["responses"] if held else {}).items()
        for words, by in (("chamber", "chamber"), ("measured housing", "housing"))
        if one[by]
    ]  # fmt: skip


def _held_out_note(payload: Mapping[str, Any]) -> str:
    return (
        f"{(payload['held_out'] or {}).get('record') or 'The run'} was predicted by a calibration without it. The prediction from the"
        " chamber refits nothing; that from the housing refits the run's offset and initial state. Expected error: due"
        " to the uncertainty of the calibrated values, of the run's initial state and of its turn-on."
    )


def _draw_residuals(found: Calibration) -> Drawing:
    with style.figure(1, len(found.ladder), height=2.5, squeeze=False) as (made, axes):
        for axis, (name, rung) in zip(axes[0], found.ladder.items(), strict=True):
            unit, scale = SHOWN[name]
            heights = [scale * rung.as_shipped, scale * rung.calibrated]
            axis.bar(["given", "calibrated"], heights, color=[style.VERMILION, style.BLUE], width=0.6)
            axis.axhline(scale * rung.noise, color=style.BLACK, linestyle="--", linewidth=1.0)
            for k, height in enumerate(heights):
                axis.annotate(plain(height), (k, 0.5 * height), ha="center", va="center", fontsize=8, color="white")
            axis.set_ylim(0.0, 1.25 * max(*heights, scale * rung.noise))
            axis.set_title(f"{NAMES[name]} ({unit})", fontsize=8, loc="left")
            axis.tick_params(labelsize=8)
            axis.grid(visible=False, axis="x")
        return made


def _draw_shifts(found: Calibration) -> Drawing:
    told = [one for one in found.estimates if one.told_by != "prior"][:30] or list(found.estimates)[:30]
    label = "shift from the card (prior standard deviations)"
    with style.figure(height=0.24 * len(told) + 0.9, x=label) as (made, axis):
        place = np.arange(len(told))[::-1]
        axis.axvspan(-NINETY, NINETY, color=style.SKY, alpha=0.18)
        shifts, widths = [one.shift_sd for one in told], [NINETY * one.width for one in told]
        axis.errorbar(shifts, place, xerr=widths, fmt="o", markersize=4, capsize=2, color=style.BLUE)
        axis.axvline(0.0, color=style.BLACK, linewidth=0.8)
        axis.set_yticks(place, [display_name(one.parameter) for one in told], fontsize=8)
        return made


def residual_figure(found: Calibration) -> Drawing:
    """Draw measured minus predicted after the calibration, over time; of tables alone over temperature."""
    problem, state = found.fit.problem, found.fit.state
    names = [name for name in problem.responses if name != SETTLED]
    count = max(len(names), 1)
    with style.figure(count, 1, 1.8 * len(names) or 2.4, squeeze=False, sharex=True) as (made, axes):
        for axis, name in zip(axes[:, 0], names, strict=False):
            rows, start = problem.rows[name], 0.0
            for run, (t, s) in enumerate(zip(rows.times, rows.slices, strict=True)):
                values = SHOWN[name][1] * state.residual[name][s]
                axis.plot((start + t - t[0]) / 3600, values, linewidth=0.7, color=style.COLOURS[run % 5])
                start += t[-1] - t[0] + 600.0
            axis.set_ylabel(f"{NAMES[name]}\n({SHOWN[name][0]})", fontsize=8)
        if not names:
            T = np.concatenate([table.temperature for table in problem.tables]) - zero_Celsius
            axes[0, 0].plot(T, 1e3 * state.residual[SETTLED], "o", color=style.BLUE, markersize=4)
            axes[0, 0].set_ylabel("residual (mHz)")
        for axis in axes[:, 0]:
            axis.axhline(0.0, color=style.BLACK, linewidth=0.6)
        axes[-1, 0].set_xlabel("time, runs in sequence (h)" if names else "temperature (°C)")
        return made
