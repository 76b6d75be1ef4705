"""Pictures of records: every column over time, with its gaps."""

from collections.abc import Mapping

import numpy as np

from compensation.arrays import Array
from studies.instrument.display import display_name
from studies.instrument.units import unit_of
from studies.reports import style
from studies.results import Drawing

Columns = Mapping[str, Array]
FEW = 300  # rows that are drawn as points
LONG = 10.0  # usual steps between two values that make a gap, whatever the rows between them hold
SKIPPED = 1.5  # the same where rows between them are empty


def column_title(name: str, per: str = "") -> str:
    """Return the name of a column with its unit, for a picture."""
    unit = unit_of(name)
    return f"{display_name(name)}{f' ({unit}{per})' if per or unit != '1' else ''}".replace("$", r"\$")


def draw_columns(columns: Columns) -> Drawing:
    """Return a figure with every column over time, or over the first column of a table of settled readings."""
    names = list(columns)
    timed = names[0] == "time_s"
    x, label = (columns["time_s"] / 3600, "Time (h)") if timed else (columns[names[0]], column_title(names[0]))
    shown = names[1:]
    mark = "-" if timed and len(x) >= FEW else "."
    with style.figure(len(shown), height=1.9 * len(shown) + 0.6, squeeze=False, sharex=True) as (figure, axes):
        for axis, name in zip(axes[:, 0], shown, strict=True):
            rows = style.outline_rows(columns[name])
            drawn = x[rows], columns[name][rows]
            if timed:
                gaps = find_gaps(columns["time_s"], columns[name]) / 3600
                at = np.searchsorted(drawn[0], gaps[:, 0], side="right")  # the line is interrupted in gaps
                drawn = np.insert(drawn[0], at, gaps[:, 0]), np.insert(drawn[1], at, np.nan)
                spans = [(begin, end - begin) for begin, end in gaps]
                shade = {"color": style.ORANGE, "alpha": 0.35, "linewidth": 0.8}
                axis.broken_barh(spans, (0, 1), transform=axis.get_xaxis_transform(), **shade)
            axis.plot(*drawn, mark, color=style.BLUE, linewidth=0.9)
            axis.set_title(column_title(name), fontsize=9, loc="left")
        axes[-1, 0].set_xlabel(label)
        made: Drawing = figure
    return made


def find_gaps(time: Array, values: Array) -> Array:
    """Return begin and end of every gap of a column, (k, 2): the times of the values beside it, or the ends of the record."""
    rows = np.flatnonzero(np.isfinite(values))
    if rows.size < 2:
        return np.array([[time[0], time[-1]]]) if time.size > 1 else np.empty((0, 2))
    steps = np.diff(time[rows] if rows.size < time.size else time)
    usual = float(np.median(steps))
    at = np.flatnonzero(steps > min(LONG, SKIPPED) * usual)
    at = at[(steps[at] > LONG * usual) | ((rows[at + 1] - rows[at] > 1) & (steps[at] > SKIPPED * usual))]
    inner = np.column_stack([time[rows[at]], time[rows[at + 1]]])
    ends = [(time[0], time[rows[0]]), (time[rows[-1]], time[-1])]
    outer = [end for end in ends if end[1] - end[0] > usual / 2]
    found = np.concatenate([inner, np.array(outer).reshape(-1, 2)])
    return np.asarray(found[np.argsort(found[:, 0])])
