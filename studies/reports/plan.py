"""Parts of a plan: which effects a campaign can identify, how small they may be, and what would be named instead."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from studies.diagnosis.response import RESPONSES
from studies.planning.plan import ROW, SNRS, SURE, Plan, Prospect
from studies.reports.digits import plain
from studies.reports.style import figure
from studies.results import Chapter, Column, Drawing, Facts, Figure, Head, Sentence, Table

SNR_WORDS = (
    "SNR: rms of the part of the effect that the calibrated card cannot absorb, over the rms noise of one row of the record."
    " With many rows an effect far below the noise of one row can be identified. A cell is empty where the effect would be larger than any published one."
)
METHOD = (
    "The card is simulated through the planned runs. Each effect of the library is added in several shapes, together with all"
    " uncertainties of the card and of the initial states, in the noise that the card states. For each hypothesis the"
    " expected log odds and their scatter follow from Gram matrices; sets and margins are those of the diagnosis. Answers that need a"
    " comparison with rows left out of the fit, and unknown causes, are not predicted."
)
SENSORS = "sensor | count: pairs | pairs: effects distinguished"


def headline(plan: Plan) -> str:
    """Return what the campaign can identify, in a few sentences."""
    rows = [one.as_dict() for one in plan.prospects]
    sure = [sum((row["identified"][f"{snr:g}"] or 0.0) >= SURE for row in rows) for snr in SNRS]
    counts = ", ".join(f"{count} of {len(rows)} at SNR {snr:g}" for count, snr in zip(sure, SNRS, strict=True))
    text = f"Effects identified in at least 90 % of cases: {counts}. SNR 1 is {_noise(plan)}."
    if never := [shown(one) for one, row in zip(plan.prospects, rows, strict=True) if row["least"] is None]:
        text += f" Not identified at any published size: {', '.join(never)}."
    for reason in dict.fromkeys(plan.invisible.values()):
        text += f" Not testable ({reason}): {', '.join(n for n, why in plan.invisible.items() if why == reason)}."
    return text


def shown(one: Prospect) -> str:
    """Return the name of a hidden effect with its response, such as "jump (bias)"."""
    return f"{one.hidden.effect.name} ({RESPONSES[one.hidden.response].word})"


def _noise(plan: Plan) -> str:
    units = ((RESPONSES[name], rms) for name, rms in plan.noise.items())
    return ", ".join(f"{rms * unit.scale:.2g} {unit.shown}" for unit, rms in units) + " rms"


def _listed(key: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda row: ", ".join(f"{name} {100 * share:.0f} %" for name, share in row.get(key, {}).items())


def _smallest(row: Mapping[str, Any]) -> str:
    return f"{row['coefficient']} = {plain(row['least']['value'], 2)}" if row.get("least") else ""


def plan_table(plan: Plan) -> Table:
    """Return the prediction as a table, the effects that are identified at the smallest SNR first."""
    rows: list[dict[str, Any]] = [{**one.as_dict(), "shown": shown(one)} for one in plan.prospects]
    rows += [{"shown": name, "instead": {why: 1.0}, "why": why} for name, why in plan.invisible.items()]
    columns: Head = (
        "shown: hidden effect | least.snr: smallest SNR identified .2",
        Column(_smallest, "smallest size identified"),
        *(Column(_at(snr), f"at SNR {snr:g}", "%", ".0f", scale=100.0) for snr in SNRS),
        "least_alone.snr: smallest SNR identified alone .2",
        Column(_listed("as_set_with"), "in one set with, at the smallest size"),
        Column(lambda row: row.get("why") or _listed("instead")(row), "named instead, at half that size"),
        "survives_baseline: share that the card cannot absorb (%) ×100 .0f",
    )
    note = f"Identified: the answer is the effect, or a set that contains it. Smallest: identified in {100 * SURE:.0f} % of cases. "
    return Table("Effects that this campaign can identify", rows, columns, note + SNR_WORDS)


def _at(snr: float) -> Callable[[Mapping[str, Any]], float | None]:
    return lambda row: row.get("identified", {}).get(f"{snr:g}")


def plan_parts(plan: Plan, profiles: Sequence[str]) -> list[Chapter]:
    """Return what people read of a plan."""
    facts = [
        ("Card", plan.card, "its own simulation and noise"),
        ("Chamber time", f"{plan.hours:.3g} h", "of all planned runs"),
        ("SNR 1", _noise(plan), f"noise of a row of {ROW:g} s"),
        ("Not testable", str(len(plan.invisible)), "the plan does not excite these effects"),
    ]
    sensors = [{"sensor": name, "count": len(pairs), "pairs": ", ".join(pairs)} for name, pairs in plan.sensors.items()]
    note = "Pairs that are confused at the smallest identified size. A sensor costs no chamber time; the most useful is listed first."
    return [
        Chapter("In short", [
            Sentence(headline(plan), where="terminal"),
            Facts(facts, "page"),
            Table("Planned runs", list(enumerate(profiles, 1)), "0: run | 1: chamber", where="page"),
            Figure(lambda: _draw(plan), "Probability (%) that each effect is identified, by its SNR; grey: larger than any published effect."),
        ]),
        Chapter("All effects", [
            plan_table(plan),
            Table("Sensors that distinguish effects without a further run", sensors, SENSORS, note, "page"),
        ]),
        Chapter("Method", [Sentence(METHOD, where="page")]),
    ]  # fmt: skip


def _draw(plan: Plan) -> Drawing:
    snrs = 10.0 ** np.arange(-2.0, 1.51, 0.5)
    table = [[one.at(one.chances.named, float(snr)) for snr in snrs] for one in plan.prospects]
    shares = np.array([[np.nan if share is None else share for share in row] for row in table])
    with figure(height=0.25 * len(table) + 0.8, x="SNR") as (made, axes):
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        axes.grid(False)
        axes.set_facecolor("0.8")
        axes.set_xticks(range(len(snrs)), [f"{snr:.2g}" for snr in snrs], fontsize=8)
        axes.set_yticks(range(len(table)), list(map(shown, plan.prospects)), fontsize=8)
        for i, j in zip(*np.nonzero(np.round(100 * np.nan_to_num(shares))), strict=True):
            colour = "w" if shares[i, j] > 0.55 else "k"
            axes.text(j, i, f"{100 * shares[i, j]:.0f}", ha="center", va="center", fontsize=7, color=colour)
        return made
