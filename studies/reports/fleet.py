"""Parts of a lot: what devices of one design have in common, which differ, and control charts of their values."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from compensation.constants import NINETY
from studies.fleet.comparison import Share
from studies.fleet.lot import Lot
from studies.fleet.population import FEWEST, MONTH, Quantity, Trend
from studies.instrument.display import spell_parameter
from studies.reports.diagnosis import NAMES
from studies.reports.digits import plain
from studies.reports.style import BLUE, ORANGE, VERMILION, panels
from studies.results import Chapter, Column, Drawing, Facts, Figure, Sentence, Table

ACROSS, MOST, NAMED = 2, 8, 25  # charts: side by side, in all; devices named below one
METHOD = (
    "Each device is calibrated and diagnosed separately. The mean of a value and its scatter over the devices (normal, restricted"
    " likelihood) allow for the error of each device. A device is odd if a value so far from the others has a probability below 1 %, with"
    " allowance for the number of devices and values examined; a batch likewise, also without its most extreme device; a change with the date (a straight line) too. The evidence for each cause is summed over"
    " the devices that show it; a device counts as free of a cause only if its records could show it."
)


def headline(lot: Lot) -> str:
    """Return what the lot has in common and who differs, in a few sentences."""
    shared = (one for one in lot.shares if one.kind in ("all", "all but"))
    common = [f"{' or '.join(one.names)} ({NAMES[one.response]})" for one in shared]
    text = f"Common to the lot: {', '.join(common)}." if common else _of_all(lot)
    moving = [f"{_name(one)} by {_monthly(lot.trends[one.name])}" for one in lot.quantities if one.name in lot.trends]
    if moving:
        text += f" In {MONTH:.0f} days of the devices' dates the lot changes: {'; '.join(moving)}."
    for name, why in lot.bad_batches.items():
        text += f" Batch {name} differs: {_first(why)}."
    if len(lot.odd) == 1:
        text += f" Device {lot.odd[0]} differs from the others: {_first(lot.reasons[lot.odd[0]])}."
    elif lot.odd:
        text += f" Devices that differ from the others: {', '.join(lot.odd)}."
    elif len(lot.answers) < FEWEST:
        text += f" Too few devices to say that one differs; from {FEWEST} on their values tell."
    else:
        text += f" No device differs from the others.{_farthest(lot)}"
    return text + (f" No answer: {', '.join(sorted(lot.failed))}." if lot.failed else "")


def _monthly(own: Trend) -> str:
    return f"{plain(own.per_month, 2)} ± {plain(own.sd, 1)}"


def _of_all(lot: Lot) -> str:
    """Return what is said of a lot without shared causes: those of the heat path, values of each card, every device may have."""
    having = [
        {cause["effect"] for cause in own.verdict["causes"] if cause["kind"] == "physics"}
        for own in lot.answers.values()
    ]
    names = sorted(set.intersection(*having)) if having else []
    if not names:
        return "The devices have no cause in common."
    return f"All devices have {' and '.join(names)}, and no other cause in common."


def _farthest(lot: Lot) -> str:
    """Return who is the farthest of those that are not odd: in a small lot a large distance may still be chance."""
    chance, serial, name = min(((*one.farthest, _name(one)) for one in lot.quantities), default=(1.0, "", ""))
    return f" The farthest is {serial} in {name}, by a chance of {chance:.1g}." if chance < 1 else ""


def _first(reasons: list[str]) -> str:
    return reasons[0] + (f", and {len(reasons) - 1} more" if len(reasons) > 1 else "")


def _devices(one: Share) -> str:
    able = len(one.having) + len(one.lacking)
    words = f"{len(one.having)} of {able} that could show it"
    if one.kind == "batch":
        return f"batch {one.batch}"
    return f"{words}; not {', '.join(one.lacking)}" if one.kind == "all but" else words


SHARES = (
    Column(lambda one: " or ".join(one.names), "cause"),
    Column(lambda one: NAMES[one.response], "response"),
    Column(_devices, "devices"),
    Column(lambda one: ", ".join(one.odd), "odd"),
    "evidence: evidence .3",
    Column(lambda one: _sizes(one), "sizes"),
)


def _values(lot: Lot) -> tuple[Column | str, ...]:
    return (
        Column(lambda one: _name(one), "value"),
        "population.mean ± population.mean_sd: mean | population.scatter: scatter .2",
        Column(lambda one: _monthly(lot.trends[one.name]) if one.name in lot.trends else "", f"in {MONTH:.0f} days"),
        Column(lambda one: len(one.of), "devices"),
        Column(lambda one: ", ".join(f"{s} {plain(one.of[s].value)}" for s in one.odd), "odd"),
        Column(lambda one: ", ".join(one.bad_batches), "odd batches"),
    )


def _sizes(one: Share) -> str:
    name = next(iter(one.sizes.values())).coefficient
    name, factor = (name, 1.0) if " " in name else spell_parameter(name)
    values = [factor * size.first for size in one.sizes.values()]
    if len(values) == 1:
        return f"{name} {plain(values[0])}"
    return f"{name} {plain(min(values), 2)} … {plain(max(values), 2)}"


def _unseen(verdict: Mapping[str, Any]) -> str:
    """Return the residual of rows that were kept aside over that of those used, for each response; nothing where none was kept."""
    ends = {name: one["extended"] or one["baseline"] for name, one in verdict["responses"].items()}
    ratios = {name: (of["held_out_rms"] or 0.0) / (of["residual_rms"] or 1.0) for name, of in ends.items() if of}
    return ", ".join(f"{NAMES[name]} {ratio:.2f}" for name, ratio in ratios.items() if ratio > 0)


def device_table(lot: Lot, page: Callable[[str], str] | None = None) -> Table:
    """Return one row a device: its verdict, its causes, and how it differs."""
    rows: list[dict[str, Any]] = [
        {
            "device": serial,
            "date": str(lot.made.get(serial, "")),
            "batch": lot.batches.get(serial, ""),
            "verdict": one.verdict["verdict"],
            "causes": ", ".join(" or ".join([c["effect"], *c["equivalent"]]) for c in one.verdict["causes"]),
            "unseen_over_used_rows": _unseen(one.verdict),
            "differs_from_the_others": "; ".join(lot.reasons[serial]),
            "page": page(serial) if page else "",
        }
        for serial, one in lot.answers.items()
    ]
    columns = "device | date | batch | verdict | causes | unseen over used rows | differs from the others | page"
    note = "Unseen over used rows: rms of what is left in rows that were kept aside over that in the others: about 1 where the model holds, less where slow noise has carried off the level of the kept rows, which is fitted."
    if silent := [row["device"] for row in rows if not row["unseen_over_used_rows"]]:
        note += f" Of {len(silent)} devices no rows could be kept aside, so nothing judges their models: {', '.join(silent[:6])}."
    return Table("Devices", rows, columns, note, sortable=True)


def fleet_parts(lot: Lot, page: Callable[[str], str] | None = None) -> list[Chapter]:
    """Return what people read of a lot; `page` gives the page of a device, where it has one."""
    facts = [
        ("Devices", str(len(lot.answers)), f"{len(lot.failed)} without an answer" if lot.failed else "all diagnosed"),
        ("Odd devices", str(len(lot.odd)), ", ".join(lot.odd[:6])),
        ("Odd batches", str(len(lot.bad_batches)), ", ".join(lot.bad_batches)),
    ]
    # those first in which a device or a batch differs
    ordered = sorted(lot.quantities, key=lambda q: min([*q.odd.values(), *q.bad_batches.values()], default=1.0))
    caption = "Values with 90 % intervals in the order of the serial numbers; red: odd device, orange: odd batch; band: mean ± 3 standard deviations."
    dated = [
        one for one in sorted(ordered, key=lambda q: q.name not in lot.trends) if sum(s in lot.made for s in one.of) > 2
    ]
    charts = [
        Figure(lambda: _draw(lot, ordered[:MOST]), caption) if ordered else None,
        Figure(lambda: _draw(lot, dated[:MOST], by_date=True), "The same over the date.") if dated else None,
    ]
    return [
        Chapter("The lot", [
            Sentence(headline(lot), where="terminal"), Facts(facts, "page"),
            Table("Causes", lot.shares, SHARES, "Sizes: smallest and largest of the coefficient."),
            Table("Values", ordered, _values(lot), "Mean and scatter of the devices that agree with each other."),
            Table("Devices without an answer", list(lot.failed.items()), "0: device | 1: why"),
        ]),
        Chapter("Control charts", charts),
        Chapter("Devices", [device_table(lot, page)]),
        Chapter("Method", [Sentence(METHOD, where="page")]),
    ]  # fmt: skip


def _name(one: Quantity) -> str:
    """Return a settled reading by its name, a value of the card by what people call it."""
    return one.name if " " in one.name else spell_parameter(one.name)[0]


def _draw(lot: Lot, quantities: list[Quantity], by_date: bool = False) -> Drawing:
    with panels(len(quantities), ACROSS, 2.3) as (canvas, axes):
        for axis, one in zip(axes, quantities, strict=True):
            _draw_chart(axis, lot, one, by_date)
        return canvas


def _draw_chart(axis: Any, lot: Lot, one: Quantity, by_date: bool) -> None:
    serials = [s for s in lot.answers if s in one.of and (not by_date or s in lot.made)]
    first = min(lot.made.values(), default=None)
    at = [(lot.made[s] - first).days if by_date and first else k for k, s in enumerate(serials)]
    bad = {s for s in serials if one.batches.get(s, "") in one.bad_batches}
    for x, serial in zip(at, serials, strict=True):
        own = one.of[serial]
        colour = VERMILION if serial in one.odd else ORANGE if serial in bad else BLUE
        axis.errorbar([x], [own.value], yerr=[NINETY * own.sd], fmt="o", markersize=3, color=colour, elinewidth=0.8)
    lot_mean, error = one.population.mean, np.median([m.sd for m in one.of.values()])
    scatter = float(np.hypot(one.population.scatter, error))
    axis.axhline(lot_mean, color="0.5", linewidth=0.8)
    axis.axhspan(lot_mean - 3 * scatter, lot_mean + 3 * scatter, color="0.5", alpha=0.12)
    axis.tick_params(labelsize=7)
    if by_date:
        axis.set_xlabel(f"days since {first}", fontsize=7)
    elif len(serials) <= NAMED:
        axis.set_xticks(range(len(serials)), serials, rotation=90, fontsize=6)
    axis.ticklabel_format(axis="y", useOffset=False)
    axis.set_title(_name(one), fontsize=7, loc="right")  # a power of ten stands on the left
