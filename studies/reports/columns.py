"""Pictures of records: every column over time, with its gaps."""

from collections.abc import Mapping

import numpy as np

from compensation.arrays import Array
from studies.files.stored import portions
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
    unit, label = (3600, "Time (h)") if timed else (1, column_title(names[0]))
    shown = names[1:]
    mark = "-" if timed and len(columns[names[0]]) >= FEW else "."
    with style.figure(len(shown), height=1.9 * len(shown) + 0.6, squeeze=False, sharex=True) as (figure, axes):
        for axis, name in zip(axes[:, 0], shown, strict=True):
            drawn = _outline(columns[names[0]], columns[name])
            drawn = drawn[0] / unit, drawn[1]
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


def _outline(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the rows of a column that are drawn; of a long one those of every portion, and of them again."""
    parts = [(x[k], y[k], style.outline_rows(y[k])) for k in portions(len(x))]
    a, b = (np.concatenate([part[i][part[2]] for part in parts]) for i in (0, 1))
    rows = style.outline_rows(b) if len(parts) > 1 else np.arange(len(b))
    return a[rows], b[rows]


def find_gaps(time: Array, values: Array) -> Array:
    """Return begin and end of every gap of a column, (k, 2): the times of the values beside it, or the ends of the record."""
    count = len(time)
    if count < 2:
        return np.empty((0, 2))
    found, usual, last, row = [], np.nan, float(time[:1][0]), -1
    first, end = last, float(time[count - 1 : count][0])
    for k in portions(count):
        known = np.flatnonzero(np.isfinite(values[k]))
        t, rows = np.append(last, time[k][known]), np.append(row, k.start + known)
        if row < 0 and known.size:
            usual = float(np.median(np.diff(t[1:]))) if known.size > 1 else usual
            found += [(first, t[1])] if t[1] - first > usual / 2 else []
            t, rows = t[1:], rows[1:]
        steps = np.diff(t)
        far = (steps > LONG * usual) | ((np.diff(rows) > 1) & (steps > SKIPPED * usual))
        found += zip(t[:-1][far].tolist(), t[1:][far].tolist(), strict=True)
        last, row = (float(t[-1]), int(rows[-1])) if rows.size else (last, row)
    if np.isnan(usual):
        return np.array([[first, end]])
    return np.array(found + ([(last, end)] if end - last > usual / 2 else [])).reshape(-1, 2)
