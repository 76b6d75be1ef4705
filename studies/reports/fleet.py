"""What a fleet of one design shares, and which device is not like the others: sentences, tables, and a page."""

from typing import TYPE_CHECKING

from studies.diagnosis.fleet.outcome import Fleet, Share, Value
from studies.reports.diagnosis import NAMES, cause_table, remarks, response_table
from studies.reports.digits import plain
from studies.reports.page import Block, Chapter, Picture, Table, Text, draw, render_page
from studies.reports.style import BLUE, VERMILION, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 3
KINDS = {"all": "all devices", "all but": "all but {0}", "alone": "{0} alone", "own": "each device its own"}
METHOD = (
    "Every device is diagnosed alone. For each cause that any of them shows, the evidence for every effect in its place is summed "
    "over the devices: one cause of the design costs its prior once, a device that differs costs besides. A value is far where it "
    "lies beyond three standard deviations of what the other devices, as scattered as they are, foretell; of two devices "
    "values cannot say which is the odd one."
)


def headline(fleet: Fleet) -> str:
    """Return what the fleet has in common and who is the odd one out, in a few sentences."""
    common = [one for one in fleet.shares if one.kind in ("all", "all but")]
    parts = [
        "Common to the design: " + ", ".join(f"{_names(one)} ({NAMES[one.response]})" for one in common) + "."
        if common
        else "No cause is common to the devices."
    ]
    odd = fleet.odd
    if odd is not None:
        parts.append(f"The odd one out is {odd}: {'; '.join(fleet.reasons[odd])}.")
    elif any(fleet.reasons.values()):
        parts.append("Several devices differ from the others.")
    else:
        parts.append("No device differs from the others.")
    return " ".join(parts)


def _names(share: Share) -> str:
    return " or ".join([share.effect, *share.equivalent])


def share_table(fleet: Fleet) -> Table:
    """Return the causes over the fleet as a table."""
    rows = [
        [
            _names(one),
            NAMES[one.response],
            KINDS[one.kind].format(one.odd),
            f"{one.probability:.2f}",
            plain(one.evidence),
            ", ".join(f"{device} {plain(size.value)}" for device, size in one.sizes.items()) or "—",
            one.coefficient or "—",
        ]
        for one in fleet.shares
    ]
    columns = (
        "Cause",
        "Response",
        "Who has it",
        "Probability",
        "Evidence",
        "Size of each device",
        "Which is",
    )
    return Table("Causes over the fleet", columns, rows)


def value_table(fleet: Fleet) -> Table:
    """Return the values of every device as a table, those first in which a device is odd."""
    devices = list(fleet.devices)
    ordered = sorted(fleet.values, key=lambda value: -max(map(abs, value.odd.values()), default=0.0))
    rows = [
        [
            value.name,
            *(plain(value.of[d].value) + (" !" if d in value.odd else "") if d in value.of else "—" for d in devices),
            plain(value.common),
            plain(value.scatter),
        ]
        for value in ordered
    ]
    note = "!: far from what the others foretell; it is left out of mean and scatter."
    return Table("Values of every device", ("Value", *devices, "Mean", "Scatter"), rows, note)


def device_table(fleet: Fleet) -> Table:
    """Return one row a device: its verdict, its causes, and why it is odd."""
    rows = [
        [
            name,
            one.verdict.verdict,
            ", ".join(" or ".join(cause.names) for cause in one.verdict.causes) or "—",
            "; ".join(fleet.reasons[name]) or "—",
        ]
        for name, one in fleet.devices.items()
    ]
    return Table("Every device alone", ("Device", "Verdict", "Causes", "Differs from the others"), rows)


def value_picture(fleet: Fleet, most: int = 6) -> Picture | None:
    """Draw values of the devices with their 90 % intervals, over the mean of those that are alike."""
    shown = sorted(fleet.values, key=lambda v: -max(map(abs, v.odd.values()), default=0.0))[:most]
    if not shown:
        return None
    devices = list(fleet.devices)
    rows = -(-len(shown) // COLUMNS)
    with figure(rows, COLUMNS, height=2.4 * rows, squeeze=False) as (canvas, axes):
        for axis in axes.flat[len(shown) :]:
            axis.set_visible(False)
        for axis, value in zip(axes.flat, shown, strict=False):
            _draw_value(axis, value, devices)
        return draw(
            canvas,
            "Values of every device with 90 % intervals; the line is the mean of those that are alike.",
            "values of the devices beside each other",
        )


def _draw_value(axis: "Axes", value: Value, devices: list[str]) -> None:
    for k, device in enumerate(devices):
        if device in value.of:
            own, colour = value.of[device], VERMILION if device in value.odd else BLUE
            span = [[own.value - own.low], [own.high - own.value]]
            axis.errorbar([k], [own.value], yerr=span, fmt="o", color=colour, capsize=3)
    axis.axhline(value.common, color="0.5", linewidth=0.8)
    axis.set_xticks(range(len(devices)), devices)
    axis.set_xlim(-0.5, len(devices) - 0.5)
    axis.set_title(value.name.rpartition(".")[2].replace(": ", "\n"), fontsize=7)


def fleet_page(fleet: Fleet) -> str:
    """Return the page as HTML."""
    first: list[Block] = [device_table(fleet)]
    if fleet.shares:
        first.insert(0, share_table(fleet))
    chapters = [Chapter("The answer", first)]
    picture = value_picture(fleet)
    if picture is not None:
        chapters.append(Chapter("Values", [picture, value_table(fleet)]))
    for name, one in fleet.devices.items():
        own: list[Block] = [cause_table(one.verdict)] if one.verdict.causes else []
        said = [*remarks(one.verdict), *one.verdict.notes]
        own += [response_table(one.verdict), *(Text(words, "note") for words in said)]
        chapters.append(Chapter(f"Device {name}", own))
    chapters.append(Chapter("How it was found", [Text(METHOD)]))
    return render_page("Diagnosis of a fleet", headline(fleet), chapters)
