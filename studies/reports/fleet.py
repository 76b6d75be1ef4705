"""Parts of a fleet's diagnosis: what devices of one design have in common, and which of them differs."""

from collections.abc import Callable
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


SHARES = (
    Column(_names, "cause"),
    Column(lambda one: NAMES[one.response], "response"),
    Column(lambda one: KINDS[one.kind].format(one.odd), "devices"),
    Column("probability", "probability", form=".2f"),
    Column("evidence", "evidence", digits=3),
    Column(lambda one: ", ".join(f"{name} {plain(size.value)}" for name, size in one.sizes.items()), "size in each device"),
    Column("coefficient", "coefficient"),
)  # fmt: skip


def share_table(fleet: Fleet) -> Table:
    """Return the causes over the fleet."""
    return Table("Causes", fleet.shares, SHARES, "Size: value of the coefficient named in the last column.")


def device_table(fleet: Fleet) -> Table:
    """Return one row a device: its verdict, its causes, and how it differs."""
    columns = (
        Column("0", "device"),
        Column("1.verdict.verdict", "verdict"),
        Column(lambda row: ", ".join(" or ".join(cause.names) for cause in row[1].verdict.causes), "causes"),
        Column(lambda row: "; ".join(fleet.reasons[row[0]]), "differs from the others"),
    )
    return Table("Devices", list(fleet.devices.items()), columns)


def _ordered(fleet: Fleet) -> list[Value]:
    return sorted(fleet.values, key=lambda value: -max(map(abs, value.odd.values()), default=0.0))


def value_table(fleet: Fleet) -> Table:
    """Return the values of every device, those first in which a device differs."""
    columns = (
        Column("name", "value"),
        *(Column(_of(device), device) for device in fleet.devices),
        Column("common", "mean", digits=3),
        Column("scatter", "scatter", digits=3),
    )
    note = "!: far from the prediction of the other devices; left out of mean and scatter."
    return Table("Values of the devices", _ordered(fleet), columns, note)


def _of(device: str) -> Callable[[Value], str]:
    def write(value: Value) -> str:
        return plain(value.of[device].value) + " !" * (device in value.odd) if device in value.of else ""

    return write


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
