"""The page of a loss budget: Q and its parts over temperature, what each is worth, where on the wall it arises."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import zero_Celsius

from shell.damping.thermoelastic import trace_share
from studies.loss_account import DampingAround, StatedLoss, damping_around, stated_loss, write_quality
from studies.reports import style
from studies.reports.digits import plain
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from shell.damping.budget import Budget, LossPart
    from studies.instrument.card import Instrument
    from studies.loss import LossModel

COLOURS = (style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.PURPLE, style.SKY, style.YELLOW)
DASHES = ("-", "--", ":")
MOST_COLUMNS = 7
SMALLEST = 1e-6  # of the sum: smaller parts are in the tables, not in the pictures


def loss_page(instrument: "Instrument", model: "LossModel", budget: "Budget", theory: str) -> str:
    """Return the page."""
    at = int(np.argmin(abs(budget.temperatures - model.vibration.reference)))
    stated, around = stated_loss(instrument, model), damping_around(model, budget)
    degrees = budget.temperatures - zero_Celsius
    span = f"{degrees[0]:g} °C" if len(degrees) == 1 else f"{degrees[0]:g} °C to {degrees[-1]:g} °C"
    lead = (
        f"Where the mode n = {model.harmonic} at {model.frequency:.1f} Hz of {instrument.name} loses its energy, at {span}:"
        f" 1/Q as a sum of parts, each computed from the mode itself ({theory})."
    )
    answer: list[Block] = [_facts(budget, at, stated), *_short(budget, at, stated), _bars(budget, at)]
    chapters = [
        Chapter("In short", answer),
        Chapter("What each part is worth", [_worth(budget, at), _sources(budget)]),
        Chapter("Over temperature", [*_course(budget, stated, model.vibration.reference), *_over_temperature(budget)]),
        Chapter("Where on the wall", [*_wall_words(model), _along(model)]),
    ]
    if around is not None:
        chapters.append(Chapter("Around the axis", _around(budget, around)))
    if model.left_out:
        chapters.append(Chapter("Not in the budget", [Text(_sentence(words)) for words in model.left_out]))
    return render_page(f"Loss budget of {instrument.name}", lead, chapters)


def _facts(budget: "Budget", at: int, stated: StatedLoss | None) -> Facts:
    low, high = (float(end[at]) for end in budget.interval)
    degrees = budget.temperatures[at] - zero_Celsius
    first = budget.first
    facts = [
        (
            f"Q at {degrees:g} °C",
            write_quality(1 / budget.inverse_q[at]),
            f"90 %: {write_quality(1 / high)} … {write_quality(1 / low)}",
        ),
        ("Attack first", first.name, f"{_share(first, budget, at)} of the loss; {_gain(budget, first, at)}"),
        ("Least known", budget.least_known.name, "moves the sum most within its uncertainty"),
    ]
    if stated is not None:
        facts.append((
            "Explained of the stated Q",
            f"{100 * stated.explained:.0f} %",
            f"stated {write_quality(1 / stated.inverse_q)}; 90 %: {100 * stated.low:.0f} … {100 * stated.high:.0f} %",
        ))  # fmt: skip
    return Facts(facts)


def _short(budget: "Budget", at: int, stated: StatedLoss | None) -> list[Text]:
    words = f"Attack first: {budget.first.name}. {_sentence(budget.first.advice)}" if budget.first.advice else ""
    found = [Text(words)] if words else []
    if stated is not None and stated.verdict:
        found.append(Text(stated.verdict, "warning"))
    return found


def _bars(budget: "Budget", at: int) -> Picture:
    """The parts at one temperature with their intervals, largest on top."""
    parts = _shown(budget, at)
    with style.figure(height=0.34 * len(parts) + 1.0) as (made, axis):
        place = np.arange(len(parts))[::-1]
        values = 1e9 * np.array([part.inverse_q[at] for part in parts])
        low, high = (1e9 * np.array([part.interval[end][at] for part in parts]) for end in (0, 1))
        axis.barh(place, values, color=[COLOURS[k % len(COLOURS)] for k in range(len(parts))], height=0.6)
        axis.errorbar(
            values, place, xerr=[values - low, high - values], fmt="none", ecolor=style.BLACK, capsize=3, linewidth=1.0
        )
        axis.set_yticks(place, [f"{part.name}, {_share(part, budget, at)}" for part in parts])
        axis.set_xlim(left=0.0)
        axis.set_xlabel("1/Q (1e−9)")
        words = f"The parts of 1/Q at {budget.temperatures[at] - zero_Celsius:g} °C with their 90 % intervals."
        return draw(made, words + _omitted(budget, at), words)


def _worth(budget: "Budget", at: int) -> Table:
    rows = []
    for part in budget.parts:
        rest = budget.inverse_q[at] - part.inverse_q[at] / 2
        low, high = (plain(1e9 * float(end[at]), 2) for end in part.interval)
        rows.append([
            part.name,
            _share(part, budget, at),
            plain(1e9 * part.inverse_q[at]),
            f"{low} … {high}",
            write_quality(1 / rest),
            _without(budget, part, at),
            _sentence(part.advice),
        ])  # fmt: skip
    return Table(
        f"At {budget.temperatures[at] - zero_Celsius:g} °C, largest first",
        ["Part", "Share", "1/Q (1e−9)", "90 %", "Q with half of it", "Q without it", "What lowers it"],
        rows,
    )


def _sources(budget: "Budget") -> Table:
    rows = [[part.name, f"{100 * part.relative_sd:.0f} %", part.source] for part in budget.parts]
    return Table("Where the numbers come from", ["Part", "Standard uncertainty", "Source"], rows)


def _course(budget: "Budget", stated: StatedLoss | None, reference: float) -> list[Block]:
    """1/Q and its parts over temperature."""
    if len(budget.temperatures) < 2:
        return []
    degrees, middle = budget.temperatures - zero_Celsius, len(budget.temperatures) // 2
    low, high = budget.interval
    with style.figure(height=4.0) as (made, axis):
        axis.fill_between(degrees, low, high, color=style.BLACK, alpha=0.12, linewidth=0)
        axis.plot(degrees, budget.inverse_q, color=style.BLACK, linewidth=2.2, label="sum, with its 90 % interval")
        for k, part in enumerate(_shown(budget, middle)):
            axis.plot(
                degrees,
                np.where(part.inverse_q > 0, part.inverse_q, np.nan),
                DASHES[k // len(COLOURS) % len(DASHES)],
                color=COLOURS[k % len(COLOURS)],
                label=part.name,
            )
        if stated is not None:
            axis.plot(reference - zero_Celsius, stated.inverse_q, "k*", markersize=11, label="stated in the card")
        axis.set_yscale("log")
        axis.set_xlabel("temperature (°C)")
        axis.set_ylabel("1/Q")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
        words = "1/Q and its parts over temperature."
        return [draw(made, words + _omitted(budget, middle), words)]


def _over_temperature(budget: "Budget") -> list[Block]:
    low, high = budget.interval
    rows = [
        [
            f"{T:.4g}",
            write_quality(1 / total),
            f"{write_quality(1 / most)} … {write_quality(1 / least)}",
            f"{100 * slope:+.2f}",
        ]
        for T, total, least, most, slope in zip(
            budget.temperatures - zero_Celsius, budget.inverse_q, low, high, budget.slope, strict=True
        )
    ]
    found: list[Block] = [Table("Q", ["T (°C)", "Q", "90 %", "Slope of 1/Q (%/°C)"], rows)]
    if len(rows) > 1:
        picked = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_COLUMNS)).round().astype(int))
        parts = [[part.name, *(plain(1e9 * part.inverse_q[k]) for k in picked)] for part in budget.parts]
        columns = ["Part", *(f"{rows[k][0]} °C" for k in picked)]
        found.append(Table("1/Q of the parts (1e−9)", columns, parts))
    return found


def _wall_words(model: "LossModel") -> list[Text]:
    share = trace_share(model.vibration.solution)
    return [
        Text(
            "What a treatment of the faces costs or gains depends on where it is done. Energy: what a damaged surface or a film"
            " takes part in. Squeeze, the change of area: what heats a film. Motion along the normal: what a gas brakes. Each is per area"
            " and over its mean; a film or a scratch does least harm where the curves are low."
        ),
        Text(
            f"P = {share:.3g}: so much of its elastic energy the mode squeezes where a bent beam squeezes 1; the rest is twist and bending"
            " without a change of volume, which does not heat."
        ),
    ]


def _along(model: "LossModel") -> Picture:
    faces = model.vibration.faces
    with style.figure(height=3.0) as (made, axis):
        for words, field, colour, dash in (
            ("energy", "energy", style.BLUE, "-"),
            ("squeeze", "stretch", style.VERMILION, "--"),
            ("motion along the normal", "moved", style.GREEN, ":"),
        ):
            density = 0.0
            for face in faces:
                values = {"energy": face.energy, "stretch": face.stretch**2, "moved": face.moved[2] ** 2}[field]
                density = density + values
            area = faces[0].area + faces[1].area
            mean = float(np.sum(density * area) / np.sum(area))
            order = np.argsort(faces[0].position)
            axis.plot(
                faces[0].position[order], np.asarray(density)[order] / (mean or 1.0), dash, color=colour, label=words
            )
        axis.set_xlabel("position on the meridian, 0 where it starts, 1 where it ends")
        axis.set_ylabel("per area, over its mean")
        axis.set_ylim(bottom=0.0)
        axis.legend()
        words = "Where the faces of the wall meet energy, squeeze and motion, both faces together."
        return draw(made, words, words)


def _around(budget: "Budget", around: DampingAround) -> list[Block]:
    degrees = budget.temperatures - zero_Celsius
    rows = [
        [f"{T:.4g}", f"{1e9 * split:.3g}", f"{axis:.2f}", f"{drift:.4g}"]
        for T, split, axis, drift in zip(degrees, around.split, np.degrees(around.axis), around.drift, strict=True)
    ]
    words = (
        "Damping that differs around the axis turns the standing wave: a bias of up to this drift, by sin 2n of the angle between"
        " the wave and the axis that is damped most."
    )
    columns = ["T (°C)", "Δ(1/Q) (1e−9)", "Axis (°)", "Drift at most (°/h)"]
    return [Text(words), Table("Damping around the axis", columns, rows)]


def _shown(budget: "Budget", at: int) -> list["LossPart"]:
    return [part for part in budget.parts if part.inverse_q[at] > SMALLEST * budget.inverse_q[at]]


def _omitted(budget: "Budget", at: int) -> str:
    left = [part.name for part in budget.parts if part not in _shown(budget, at)]
    return f" Too small to be drawn: {', '.join(left)}." if left else ""


def _share(part: "LossPart", budget: "Budget", at: int) -> str:
    share = 100 * part.inverse_q[at] / budget.inverse_q[at]
    return f"{share:.3g} %" if share >= 0.01 else "below 0.01 %"


def _gain(budget: "Budget", part: "LossPart", at: int) -> str:
    Q = float(budget.without(part.name)[at])
    return f"without it Q = {write_quality(Q)}" if np.isfinite(Q) else "nothing known would be left"


def _without(budget: "Budget", part: "LossPart", at: int) -> str:
    Q = float(budget.without(part.name)[at])
    return write_quality(Q) if np.isfinite(Q) else "nothing left"


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + "." * (not words.endswith(".")) if words else ""
