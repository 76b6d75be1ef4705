"""Parts of a fleet's diagnosis: what devices of one design have in common, and which of them differs."""

from typing import TYPE_CHECKING

from studies.diagnosis.fleet.outcome import Fleet, Share, Value
from studies.reports.diagnosis import NAMES, cause_table, remarks, response_table
from studies.reports.digits import plain
from studies.reports.style import BLUE, VERMILION, figure
from studies.results import Chapter, Column, Drawing, Figure, Part, Sentence, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ACROSS, MOST = 3, 6
KINDS = {"all": "all devices", "all but": "all but {0}", "alone": "{0} alone", "own": "each device its own"}
METHOD = (
    "Each device is diagnosed alone. For each cause that any of them shows, the evidence for every alternative effect is summed over"
    " the devices. A cause of the design pays its prior once; a device that differs pays an extra prior. A value is flagged if it"
    " lies more than three standard deviations from the prediction of the other devices, including their scatter. With two devices,"
    " values alone cannot show which one differs."
)
SHARES = (
    Column("cause", "cause"),
    Column("response", "response"),
    Column("devices", "devices"),
    Column("probability", "probability", form=".2f"),
    Column("evidence", "evidence", digits=3),
    Column("sizes", "size in each device"),
    Column("coefficient", "coefficient"),
)
DEVICES = (
    Column("device", "device"),
    Column("verdict", "verdict"),
    Column("causes", "causes"),
    Column("differs", "differs from the others"),
)


def headline(fleet: Fleet) -> str:
    """Return what the fleet has in common and which device differs, in a few sentences."""
    common = [f"{_names(one)} ({NAMES[one.response]})" for one in fleet.shares if one.kind in ("all", "all but")]
    first = f"Common to the design: {', '.join(common)}." if common else "The devices have no cause in common."
    if fleet.odd is not None:
        return f"{first} Device {fleet.odd} differs from the others: {'; '.join(fleet.reasons[fleet.odd])}."
    several = any(fleet.reasons.values())
    return f"{first} {'Several devices differ' if several else 'No device differs'} from the others."


def _names(share: Share) -> str:
    return " or ".join([share.effect, *share.equivalent])


def share_table(fleet: Fleet) -> Table:
    """Return the causes over the fleet."""
    rows = [
        {
            "cause": _names(one),
            "response": NAMES[one.response],
            "devices": KINDS[one.kind].format(one.odd),
            "probability": one.probability,
            "evidence": one.evidence,
            "sizes": ", ".join(f"{device} {plain(size.value)}" for device, size in one.sizes.items()),
            "coefficient": one.coefficient or "",
        }
        for one in fleet.shares
    ]
    return Table("Causes", rows, SHARES, "Size: value of the coefficient named in the last column.")


def device_table(fleet: Fleet) -> Table:
    """Return one row a device: its verdict, its causes, and how it differs."""
    rows = [
        {
            "device": name,
            "verdict": one.verdict.verdict,
            "causes": ", ".join(" or ".join(cause.names) for cause in one.verdict.causes),
            "differs": "; ".join(fleet.reasons[name]),
        }
        for name, one in fleet.devices.items()
    ]
    return Table("Devices", rows, DEVICES)


def _ordered(fleet: Fleet) -> list[Value]:
    return sorted(fleet.values, key=lambda value: -max(map(abs, value.odd.values()), default=0.0))


def value_table(fleet: Fleet) -> Table:
    """Return the values of every device, those first in which a device differs."""
    rows = [
        {
            "value": value.name,
            "of": {d: plain(own.value) + (" !" if d in value.odd else "") for d, own in value.of.items()},
            "common": value.common,
            "scatter": value.scatter,
        }
        for value in _ordered(fleet)
    ]
    each = [(f"of.{device}", device) for device in fleet.devices]
    columns = (Column("value", "value"), *(Column(key, heading) for key, heading in each))
    ends = (Column("common", "mean", digits=3), Column("scatter", "scatter", digits=3))
    note = "!: far from the prediction of the other devices; left out of mean and scatter."
    return Table("Values of the devices", rows, (*columns, *ends), note)


def fleet_parts(fleet: Fleet) -> list[Chapter]:
    """Return what people read of a fleet."""
    caption = "Values of the devices with 90 % intervals; the line is the mean of those that agree."
    values: list[Part] = [Figure(lambda: _draw_values(fleet), caption)] if fleet.values else []
    return [
        Chapter("The answer", [Sentence(headline(fleet), where="terminal"), share_table(fleet), device_table(fleet)]),
        Chapter("Values", [*values, value_table(fleet)]),
        *(Chapter(f"Device {name}", [
            *_on_page(cause_table(one.verdict), response_table(one.verdict)),
            *(Sentence(said.text, said.kind, "page") for said in remarks(one.verdict)),
        ]) for name, one in fleet.devices.items()),
        Chapter("Method", [Sentence(METHOD, where="page")]),
    ]  # fmt: skip


def _on_page(*tables: Table) -> list[Table]:
    return [Table(one.title, one.rows, one.columns, one.note, "page") for one in tables]


def _draw_values(fleet: Fleet) -> Drawing:
    drawn, devices = _ordered(fleet)[:MOST], list(fleet.devices)
    rows = -(-len(drawn) // ACROSS)
    with figure(rows, ACROSS, height=2.4 * rows, squeeze=False) as (canvas, axes):
        for axis in axes.flat[len(drawn) :]:
            axis.set_visible(False)
        for axis, value in zip(axes.flat, drawn, strict=False):
            _draw_value(axis, value, devices)
        return canvas


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
