"""The page of an import: what was understood, every column over time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.reports import style
from studies.reports.page import Block, Chapter, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Columns = Mapping[str, NDArray[np.float64]]
FEW = 300  # rows that are drawn as points
FIRST_ROWS = 5


def import_page(records: Mapping[str, Columns], notes: Sequence[str]) -> str:
    """Return the page; `records` is file name to columns, of a record in time or of a table of settled readings."""
    chapters = []
    for name, columns in records.items():
        blocks: list[Block] = [_figure(columns), _ranges(columns), _first_rows(columns)]
        chapters.append(Chapter(name, blocks))
    chapters.append(Chapter("What was changed", [Text("\n".join(notes), "source")]))
    lead = "What the import understood. Compare it with what you know of the run before you use it."
    return render_page("Preview of an import", lead, chapters)


def draw_columns(columns: Columns) -> "Figure":
    """Return a figure with every column over time, or over the first column of a table of settled readings."""
    names = list(columns)
    timed = names[0] == "time_s"
    x, label = (columns["time_s"] / 3600, "Time (h)") if timed else (columns[names[0]], names[0])
    shown = names[1:]
    rows = style.few_rows(len(x))
    mark = "-" if timed and len(x) >= FEW else "."
    with style.figure(len(shown), height=1.9 * len(shown) + 0.6, squeeze=False, sharex=True) as (figure, axes):
        for axis, name in zip(axes[:, 0], shown, strict=True):
            axis.plot(x[rows], columns[name][rows], mark, color=style.BLUE, linewidth=0.9)
            axis.set_title(name.replace("$", r"\$"), fontsize=9, loc="left")
        axes[-1, 0].set_xlabel(label.replace("$", r"\$"))
        made: Figure = figure
    return made


def _figure(columns: Columns) -> Picture:
    return draw(draw_columns(columns), "Every column as it was understood.", "Columns over time.")


def _ranges(columns: Columns) -> Table:
    rows = []
    for name, values in columns.items():
        known = values[np.isfinite(values)]
        low, high = (f"{known.min():.8g}", f"{known.max():.8g}") if known.size else ("", "")
        rows.append(
            [
                name,
                low,
                high,
                f"{np.median(np.abs(np.diff(known))):.3g}" if known.size > 1 else "",
                str(values.size - known.size),
            ]
        )
    return Table("Columns", ["Column", "Lowest", "Highest", "Usual step between rows", "Missing"], rows)


def _first_rows(columns: Columns) -> Table:
    count = min(FIRST_ROWS, len(next(iter(columns.values()))))
    rows = [[f"{values[k]:.10g}" for values in columns.values()] for k in range(count)]
    return Table("First rows", list(columns), rows)
