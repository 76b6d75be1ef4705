"""The page of an import: what was understood, every column over time."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.reports import style
from studies.reports.gaps import find_gaps
from studies.reports.page import Block, Chapter, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Columns = Mapping[str, Array]
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
            drawn = x[rows], columns[name][rows]
            if timed:
                gaps = find_gaps(columns["time_s"], columns[name]) / 3600
                drawn = _broken(*drawn, gaps)
                spans = [(begin, end - begin) for begin, end in gaps]
                axis.broken_barh(
                    spans, (0, 1), transform=axis.get_xaxis_transform(), color=style.ORANGE, alpha=0.35, linewidth=0.8
                )
            axis.plot(*drawn, mark, color=style.BLUE, linewidth=0.9)
            axis.set_title(name.replace("$", r"\$"), fontsize=9, loc="left")
        axes[-1, 0].set_xlabel(label.replace("$", r"\$"))
        made: Figure = figure
    return made


def _broken(x: Array, y: Array, gaps: Array) -> tuple[Array, Array]:
    """Return a line that is interrupted where its column has gaps."""
    at = np.searchsorted(x, gaps[:, 0], side="right")
    return np.insert(x, at, gaps[:, 0]), np.insert(y, at, np.nan)


def _figure(columns: Columns) -> Picture:
    shaded = " Shaded: no values." if "time_s" in columns else ""
    return draw(draw_columns(columns), f"Every column as it was understood.{shaded}", "Columns over time.")


def _ranges(columns: Columns) -> Table:
    rows, timed = [], "time_s" in columns
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
        if timed:
            gaps = find_gaps(columns["time_s"], values)
            rows[-1] += [str(len(gaps)), f"{float(np.max(np.ptp(gaps, axis=1))):.6g}" if len(gaps) else ""]
    names = ["Column", "Lowest", "Highest", "Usual step between rows", "Missing"]
    return Table("Columns", [*names, *(["Gaps", "Longest gap (s)"] if timed else [])], rows)


def _first_rows(columns: Columns) -> Table:
    count = min(FIRST_ROWS, len(next(iter(columns.values()))))
    rows = [[f"{values[k]:.10g}" for values in columns.values()] for k in range(count)]
    return Table("First rows", list(columns), rows)
