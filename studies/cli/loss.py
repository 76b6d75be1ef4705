"""`hrg loss`: 1/Q over temperature as a sum of its parts, and which part to attack first."""

from typing import Any

import numpy as np

from shell.constants import zero_Celsius
from shell.damping.budget import Budget, LossPart
from shell.damping.thermoelastic import trace_share
from studies.cli.arguments import Card, FromDegC, Harmonic, Step, Theory, ToDegC, lay_temperatures
from studies.cli.output import answers
from studies.instrument.card import Instrument, load_card
from studies.loss.account import StatedLoss, damping_around, stated_loss
from studies.loss.model import LossModel, loss_model
from studies.reports import style
from studies.reports.digits import plain
from studies.reports.scenes import live_chapter
from studies.results import Chapter, Drawing, Fact, Facts, Figure, Result, Sentence, Table, row_of, rows_of

DEG = float(np.degrees(1))
WALL = (
    "The effect of a surface depends on its position: a damaged layer or a film dissipates in proportion to the strain energy, heat"
    " flow in a film to the square of the area strain, gas damping to the square of the normal motion. A film or a scratch does least harm where these curves are low."
)
SQUEEZE = "the share of elastic energy with volume change, relative to a bent beam; twist and pure shear produce no heat."  # fmt: skip


@answers("hrg.loss/1")
def loss(
    card: Card,
    *,
    from_degC: FromDegC = -20.0,
    to_degC: ToDegC = 40.0,
    step: Step = 10.0,
    harmonic: Harmonic = 2,
    theory: Theory = "solid",
    anchor: bool = False,
) -> Result:
    """Show Q over temperature, its loss contributions, and which of them to reduce first.

    Thermoelastic, bulk and surface losses follow from geometry and material. Films, gas, activated losses, imbalance and
    mount loss are set in the card's table [loss], in [[loss.film]] and [[loss.activated]].

    Args:
        anchor: Compute the anchor loss of a stem (a second or two).
    """
    temperatures = lay_temperatures(from_degC, to_degC, step)
    instrument = load_card(card)
    T = instrument.material.check(temperatures)
    model = loss_model(instrument, harmonic, theory, anchor)
    budget = model.budget(T)
    around, stated = damping_around(model, budget), stated_loss(instrument, model)
    payload = {
        "card": instrument.name,
        **_describe(model, budget, theory),
        "anisotropy": around
        and row_of(around, inverse_q_split="split", damping_axis_deg=("axis", DEG), largest_drift_deg_per_h="drift"),
        "left_out": model.left_out,
        "stated": stated and row_of(stated, "inverse_q", "explained", explained_low="low", explained_high="high"),
    }
    at = int(np.argmin(abs(T - model.vibration.reference)))
    return Result(
        payload,
        f"Loss budget of {instrument.name}",
        f"1/Q of the mode n = {harmonic} at {model.frequency:.1f} Hz as a sum of contributions, each computed from the mode ({theory} theory).",
        [
            *_parts(payload, model, budget, stated, at),
            Chapter("In a simulation", [_simulated(instrument)]),
            live_chapter(instrument, harmonic, theory, anchor=anchor),
        ],
    )


def _simulated(instrument: Instrument) -> str:
    """Say whether a simulation takes 1/Q from this budget or from the card's own number."""
    if instrument.part("loss", "loss_parts").given:
        return "Simulations take 1/Q from this budget."
    own = instrument.loss.inverse_q
    given = "the card's" if "inverse_q" in instrument.content.get("loss", {}) else "the default of"
    return (
        f"Simulations do not use this budget: they use {given} [loss] inverse_q = {plain(own)} (Q = {plain(1 / own)}). Give a contribution"
        " in the card, such as loss.surface_layer_pm, to simulate with the budget."
    )


def _describe(model: LossModel, budget: Budget, theory: str) -> dict[str, Any]:
    part = {"slope_per_K": "slope", "low": "interval.0", "high": "interval.1"}
    return {
        **row_of(model, "harmonic", frequency_Hz="frequency"),
        "theory": theory,
        "temperature_degC": budget.temperatures - zero_Celsius,
        **row_of(budget, "inverse_q", inverse_q_low="interval.0", inverse_q_high="interval.1"),
        "q": 1 / budget.inverse_q,
        **row_of(budget, slope_per_K="slope", least_known="least_known.name"),
        "parts": [row_of(one, "name", "inverse_q", "relative_sd", "source", **part) for one in budget.parts],
        "attack_first": row_of(budget.first, "advice", part="name") | {"q_without": budget.without(budget.first.name)},
    }


def _parts(
    payload: dict[str, Any], model: LossModel, budget: Budget, stated: StatedLoss | None, at: int
) -> list[Chapter]:
    degrees, around = payload["temperature_degC"], payload["anisotropy"]
    low, high = budget.interval
    q = {"q": payload["q"], "q_low": 1 / high, "q_high": 1 / low}
    over = rows_of({"T": degrees, **q, **row_of(budget, "inverse_q", "slope")})
    rows = []
    for entry, part in zip(payload["parts"], budget.parts, strict=True):
        own, total, rest = part.inverse_q[at], budget.inverse_q[at], float(budget.without(part.name)[at])
        shown = {"share": 100 * own / total, "half": 1 / (total - own / 2), "advice": _sentence(part.advice)}
        rows.append(entry | shown | {"without": rest if np.isfinite(rest) else "nothing left"})
    picked = sorted({0, at, len(degrees) - 1})
    values = " | ".join(f"inverse_q.{k}: 1/Q at {degrees[k]:.0f} °C (1e-9) ×1e9 .3g" for k in picked)
    damped = [] if around is None else rows_of({"T": degrees, **around})
    words = [
        f"Reduce first: {budget.first.name}. {_sentence(budget.first.advice)}",
        f"Largest share of the uncertainty of the total: {budget.least_known.name}.",
        stated.verdict if stated is not None else "",
    ]
    return [
        Chapter("Summary", [
            Facts(_facts(budget, stated, at, degrees[at])),
            *words,
            Figure(lambda: _draw_bars(budget, at), f"Contributions to 1/Q at {degrees[at]:g} °C with 90 % intervals."),
        ]),
        Chapter(f"Contributions at {degrees[at]:g} °C", [
            Table("Contributions", rows,
                f"name: contribution | share: share (%) .3g | {values} | low.{at} … high.{at}: 90 % interval (1e-9) ×1e9 .2"
                f" | slope_per_K.{at}: slope (%/°C) ×100 +.2g | half: Q with it halved .3 | without: Q without it .3", "Largest first; all columns except 1/Q are at the temperature above."),
            Table("Remedies and sources", rows,
                "name: contribution | relative_sd: standard uncertainty (%) ×100 .0f | advice: remedy | source"),
        ]),
        Chapter("Over temperature", [
            Table("Q", over, "T: T (°C) .1f | q: Q .3 | q_low … q_high: 90 % interval .3 | inverse_q: 1/Q (1e-9) ×1e9 .3g"
                " | slope: slope of 1/Q (%/°C) ×100 +.2g"),
            Figure(lambda: _draw_course(budget, stated, model.vibration.reference), "1/Q and its parts.") if len(degrees) > 1 else None,
        ]),
        Chapter("Along the meridian", [
            Sentence(WALL, where="page"),
            Sentence(f"Thermoelastic participation {trace_share(model.vibration.solution):.3g}: {SQUEEZE}", where="page"),
            Figure(lambda: _draw_along(model), "Energy, area strain and normal motion of the faces, each normalised to its mean over the surface."),
        ]),
        Chapter("Around the axis", [
            Table("Damping anisotropy", damped,
                "T: T (°C) .1f | inverse_q_split: Δ(1/Q) (1e-9) ×1e9 .3g | damping_axis_deg: axis (°) .2f | largest_drift_deg_per_h: largest drift (°/h)",
                "Axis: azimuth of the pattern with the largest damping. The drift is proportional to sin 2n of the angle from it."),
        ]),
        Chapter("Not included", [
            *(Sentence(_sentence(words), where="page") for words in model.left_out),
            *(Sentence(_sentence(f"not included: {words}"), where="terminal") for words in model.left_out),
        ]),
    ]  # fmt: skip


def _facts(budget: Budget, stated: StatedLoss | None, at: int, degrees: float) -> list[Fact]:
    low, high = (float(end[at]) for end in budget.interval)
    without = float(budget.without(budget.first.name)[at])
    gain = f"Q would be {plain(without)} without it" if np.isfinite(without) else "no other contribution is known"
    facts = [
        (f"Q at {degrees:g} °C", plain(1 / budget.inverse_q[at]), f"90 %: {plain(1 / high)} … {plain(1 / low)}"),
        ("Largest contribution", budget.first.name, gain),
    ]
    if stated is not None:
        share, least, most = (100 * part for part in (stated.explained, stated.low, stated.high))
        remark = f"90 %: {least:.0f} … {most:.0f} %; the card states Q = {plain(1 / stated.inverse_q)}"
        facts.append(("Explained share of the stated loss", f"{share:.0f} %", remark))
    return facts


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + "." * (not words.endswith(".")) if words else ""


DASHES = ("-", "--", ":")
SMALLEST = 1e-6  # of the sum: smaller parts are in the tables, not in the pictures


def _draw_bars(budget: Budget, at: int) -> Drawing:
    parts = _shown(budget, at)
    with style.figure(height=0.34 * len(parts) + 1.0, x="1/Q (1e−9)") as (made, axis):
        place = np.arange(len(parts))[::-1]
        values = 1e9 * np.array([part.inverse_q[at] for part in parts])
        low, high = (1e9 * np.array([part.interval[end][at] for part in parts]) for end in (0, 1))
        axis.barh(place, values, color=[style.COLOURS[k % 7] for k in range(len(parts))], height=0.6)
        ends = {"fmt": "none", "ecolor": style.BLACK, "capsize": 3, "linewidth": 1.0}
        axis.errorbar(values, place, xerr=[values - low, high - values], **ends)
        shares = [100 * part.inverse_q[at] / budget.inverse_q[at] for part in parts]
        axis.set_yticks(place, [f"{part.name}, {share:.3g} %" for part, share in zip(parts, shares, strict=True)])
        axis.set_xlim(left=0.0)
        return made


def _draw_course(budget: Budget, stated: StatedLoss | None, reference: float) -> Drawing:
    degrees, middle = budget.temperatures - zero_Celsius, len(budget.temperatures) // 2
    low, high = budget.interval
    with style.figure(height=4.0, x="temperature (°C)", y="1/Q") as (made, axis):
        axis.fill_between(degrees, low, high, color=style.BLACK, alpha=0.12, linewidth=0)
        axis.plot(degrees, budget.inverse_q, color=style.BLACK, linewidth=2.2, label="sum, with its 90 % interval")
        for k, part in enumerate(_shown(budget, middle)):
            course = np.where(part.inverse_q > 0, part.inverse_q, np.nan)
            axis.plot(degrees, course, DASHES[k // 7 % 3], color=style.COLOURS[k % 7], label=part.name)
        if stated is not None:
            axis.plot(reference - zero_Celsius, stated.inverse_q, "k*", markersize=11, label="stated in the card")
        axis.set_yscale("log")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
        return made


def _draw_along(model: LossModel) -> Drawing:
    faces = model.vibration.faces
    area, order = faces[0].area + faces[1].area, np.argsort(faces[0].position)
    shares = {
        "energy": [face.energy for face in faces],
        "area strain": [face.stretch**2 for face in faces],
        "normal motion": [face.moved[2] ** 2 for face in faces],
    }
    x, y = "position on the meridian, 0 where it starts, 1 where it ends", "per area, over its mean"
    with style.figure(height=3.0, x=x, y=y) as (made, axis):
        for (words, parts), dash, colour in zip(shares.items(), DASHES, style.COLOURS, strict=False):
            density = np.sum(parts, axis=0)
            mean = float(np.sum(density * area) / np.sum(area)) or 1.0
            axis.plot(faces[0].position[order], density[order] / mean, dash, color=colour, label=words)
        axis.set_ylim(bottom=0.0)
        return made


def _shown(budget: Budget, at: int) -> list["LossPart"]:
    return [part for part in budget.parts if part.inverse_q[at] > SMALLEST * budget.inverse_q[at]]
