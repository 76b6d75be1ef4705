"""`hrg optimise`: dimensions for objectives under constraints, with tolerances."""

from collections import Counter
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from studies.cli.arguments import Quiet, Workers
from studies.cli.output import answers, resumable
from studies.design.answer import Answer
from studies.design.run import CARD, TABLE, best_instrument
from studies.design.run import optimise as find_best
from studies.design.task import shown
from studies.errors import numbered
from studies.instrument.settings import settings_of
from studies.reports import style
from studies.reports.digits import plain
from studies.reports.scenes import moving_mode, show_mode
from studies.reports.sweep_figures import column_label
from studies.results import Blocks, Chapter, Column, Drawing, Facts, Figure, Result, Sentence, Table, row_of
from studies.sweeps.tolerance import tell_doubt


@answers("hrg.optimise/1")
def optimise(design: str, *, out: str, workers: Workers = None, quiet: Quiet = False) -> Result:
    """Find dimensions of a resonator for objectives under constraints; every answer is verified by full solves.

    Run again with the same folder to resume: finished designs are never computed again, and objectives, limits and bounds
    may change between runs.

    Args:
        design: A TOML file with schema = "hrg.design/1", or the name of a worked design: dome-8khz, light-cylinder,
            robust-dome. hrg design new FILE writes one to start from; hrg keys design lists its keys.
        out: Folder for the best design as a card (best.toml), all designs (evaluations.csv) and the store.
    """
    with resumable(out, "designs"):
        found = find_best(design, out, workers=workers, show_progress=not quiet)
    payload: dict[str, Any] = {
        **row_of(found, "evaluations", design="task.name", card="task.study.instrument.name"),
        "failed": len(found.failures),
        "parameters": _parameters(found),
        "defaults": _defaults(found),
        "columns": _columns(found),
        "constraints": [
            row_of(one, "column", "limit", "value", "room", "margin", "price")
            | {"error": float(found.errors[found.task.place(one.column)])}
            | {"kind": "most" if one.sign > 0 else "least", "active": one.price is not None}
            for one in found.limits
        ],
        "front": _front(found),
        "tolerances": [
            row_of(one, "column", "value", "sd", "low", "high", "passed", worst_case="first_order")
            for one in found.spreads
        ],
        "out": out,
        "best_card": str(Path(out) / CARD),
    }
    count = len(found.task.keys.objective)
    lead = f"{numbered(found.task.free, 'parameter')}, {numbered(count, 'objective')}, {numbered(len(found.limits), 'limit')}: {numbered(found.evaluations, 'design')} solved in full."
    return Result(payload, f"Design {found.task.name}", lead, _parts(found, payload))


def _parameters(found: Answer) -> list[dict[str, Any]]:
    rows = []
    for p, start, best in zip(
        found.task.study.parameters[: found.task.free], found.task.start, found.best, strict=False
    ):
        near = 1e-3 * (p.high - p.low)
        at = "low" if best - p.low < near else "high" if p.high - best < near else None
        rows.append(row_of(p, "name", "low", "high") | {"start": float(start), "best": float(best), "at_bound": at})
    return rows


def _defaults(found: Answer) -> dict[str, Any]:
    """What neither card nor task states, of the resonator and of parameters and tolerances, and stands at its default."""
    task = found.task
    stated = {one.name for one in task.study.derived} | {p.name for p in task.keys.parameter if p.start is not None}
    return {
        name: one.value
        for name, one in settings_of(task.study.instrument).items()
        if one.stated is None and name not in stated and (name in task.study.names or name.startswith("resonator."))
    }


def _columns(found: Answer) -> list[dict[str, Any]]:
    wanted = set(found.task.wanted)
    solved = {"start": found.before, "interpolant": found.foretold, "best": found.after, "verified": found.verified}
    rows = [
        row_of(column, "label", "unit", column="name") | {name: float(of[k]) for name, of in solved.items()}
        for k, column in enumerate(found.task.study.columns)
        if "_of_n" not in column.name and not column.name.endswith("nearest_harmonic")
    ]
    return sorted(rows, key=lambda row: row["column"] not in wanted)


def _front(found: Answer) -> list[dict[str, Any]]:
    names = found.task.study.names[: found.task.free]
    return [
        dict(zip(names, design.tolist(), strict=False))
        | {column: shown(column, values[found.task.place(column)]) for column in found.task.wanted}
        for design, values in zip(found.front, found.front_values, strict=True)
        if len(found.task.keys.objective) > 1
    ]


def _parts(found: Answer, payload: dict[str, Any]) -> list[Any]:
    unit = {row["column"]: f" {row['unit']}" if row["unit"] != "1" else "" for row in payload["columns"]}
    label = {row["column"]: row["label"] for row in payload["columns"]}
    named = {column.name: column_label(column) for column in found.task.study.columns}
    goals = [(goal.column, found.task.place(goal.column)) for goal in found.task.keys.objective]
    facts = [(label[n], f"{plain(found.after[k])}{unit[n]}", f"before: {plain(found.before[k])}") for n, k in goals]
    reasons = Counter(reason for _, reason in found.failures)
    several = len(goals) > 1
    price = "price, by fractions of the ranges" if several else f"price, {label[goals[0][0]]} per unit"
    words = (
        ""
        if all(not abs(row["verified"] - row["best"]) > 1e-9 * abs(row["best"]) for row in payload["columns"])
        else " The solve from the card differs: see the table."
    )
    doubts = [
        tell_doubt(label[name], unit[name].strip(), shown(name, found.after[k]), float(found.errors[k]), limits)
        for name in dict.fromkeys(one.column for one in found.task.keys.constraint if not one.is_relative)
        for k, limits in [(found.task.place(name), [one.limit for one in found.limits if one.column == name])]
    ]
    keys = found.task.study.names[: found.task.free]
    defaults = ", ".join(f"{name} = {value}" for name, value in payload["defaults"].items())
    front = [Column(itemgetter(name), name.removeprefix("resonator."), digits=5) for name in keys]
    front += [Column(itemgetter(name), named[name], digits=6) for name in found.task.wanted]
    return [
        Chapter("The design", [
            Facts(facts),
            *(Sentence(one, "warning") for one in doubts if one),
            f"{payload['best_card']} is the best design as a card; {TABLE} beside it has all {found.evaluations} designs.{words}",
            Table("Parameters", payload["parameters"], [
                Column(lambda row: row["name"].removeprefix("resonator."), "parameter"),
                "start: before .7 | best: best .7 | low: lowest | high: highest | at bound",
            ]),
            f"Neither the card nor the design states what stands at its default: {defaults}. A parameter among these starts there." if defaults else None,
            Table("Before and after", payload["columns"], [
                "label: quantity", Column(lambda row: row["unit"] if row["unit"] != "1" else None, "unit"),
                "start: before .6 | interpolant: best, interpolated .7 | best: best, full solve .7",
            ], "Interpolated: from all other designs. Full solve: the design itself, solved again from its card with the same result."
               " Only the magnitude of a separation counts; its sign shows on which side the nearest mode lies."),
            Figure(lambda: show_mode(best_instrument(found)).mode.plot(), "Section of the best design, at rest and at maximum displacement."),
        ]),
        Chapter("About the best design", [Blocks(lambda: moving_mode(best_instrument(found),
            names=[name for name in keys if name.startswith("resonator.")], derived=found.task.study.derived))]),
        Chapter("Constraints", [
            Table("Cost of the limits", payload["constraints"], [
                Column(lambda row: named[row["column"]], "quantity"), "kind: bound | limit: limit .7 | value: value .7 | room: distance to the limit .3",
                Column(lambda row: row["margin"] or None, "margin for tolerances", digits=3), Column("price", price, digits=3),
            ], "Price: gain of the objective per unit by which the limit is relaxed, to first order and before rounding; empty where the limit"
               " is not active."),
        ]),
        Chapter("Front", [
            "One design is best in every objective: they do not conflict here." if several and len(payload["front"]) == 1 else None,
            Figure(lambda: _draw_front(found), "All designs that meet the constraints, and the Pareto front.") if several else None,
            Table("Pareto front", payload["front"], front),
        ]),
        Chapter("Tolerances", [
            Table("Effect of the tolerances", payload["tolerances"], [
                Column(lambda row: named[row["column"]], "quantity"),
                "value: value .6 | worst_case: worst case ± .3 | sd: standard deviation .3 | low … high: full solves .6 | passed: within limits (%) ×100 .1f",
            ], "Worst case and standard deviation to first order; a tolerance given by its standard deviation is normal, its worst case three of it. Full solves: the extremes among the worst corners and designs drawn from the tolerances."),
        ]),
        Chapter("Search", [
            Figure(lambda: _draw_history(found), "Objective, and violation of the limits, of each design in the order in which they were computed."),
            Table("Designs that could not be computed", reasons.most_common(8), "1: designs | 0: reason", where="page"),
        ]),
    ]  # fmt: skip


def _draw_history(found: Answer) -> Drawing:
    over, t = found.history.T
    count = np.arange(1, len(over) + 1)
    held = over == 0
    best = np.minimum.accumulate(np.where(held, t, np.inf))
    labels = ("objective, scaled", "excess, scaled")
    with style.figure(2, 1, 4.2, "design", labels, sharex=True) as (made, (top, low)):
        top.plot(count[held], t[held], ".", color=style.SKY, label="keeps all limits")
        top.plot(count[np.isfinite(best)], best[np.isfinite(best)], color=style.BLUE, label="best so far")
        if held.any():
            spread = np.ptp(t[held]) or 1.0
            top.set_ylim(t[held].min() - 0.1 * spread, t[held].max() + 0.1 * spread)
        low.semilogy(count, np.maximum(over, 1e-9), ".", color=style.VERMILION)
        return made


def _draw_front(found: Answer) -> Drawing:
    a, b = (found.task.place(one.column) for one in found.task.keys.objective[:2])
    titles = [column_label(found.task.study.columns[k]) for k in (a, b)]
    held = found.history[:, 0] == 0
    with style.figure(height=3.8, x=titles[0], y=titles[1]) as (made, axis):
        axis.plot(found.values[held, a], found.values[held, b], ".", color=style.SKY, label="keeps all limits")
        axis.plot(found.front_values[:, a], found.front_values[:, b], "o-", color=style.BLUE, label="front")
        axis.plot(found.after[a], found.after[b], "*", color=style.VERMILION, markersize=13, label="best design")
        for c, scale in ((a, axis.set_xscale), (b, axis.set_yscale)):
            if (found.values[held, c] > 0).all() and np.ptp(np.log10(found.values[held, c])) > 1:
                scale("log")
        return made
