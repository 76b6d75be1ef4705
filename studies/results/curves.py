"""What a matplotlib figure of a page shows, as numbers to point at and enlarge; axes with images or contours stay pictures."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from studies.results import Drawing

MOST = 100_000  # points of a figure beyond which it stays a picture
DIGITS = 6  # digits of the axis's range to which values are kept


def read_curves(figure: Drawing, left: float, bottom: float, width: float, height: float) -> str:
    """Return the curves of a drawn figure as JSON for `curves.js`, of the part (inch) that the picture shows; empty where it has none."""
    from matplotlib.collections import LineCollection, PathCollection, PolyCollection

    wide, high = figure.get_size_inches()

    def place(x: float, y: float, w: float, h: float) -> list[float]:
        """Parts of the picture, from its upper left corner."""
        parts = (x * wide - left) / width, 1 - ((y + h) * high - bottom) / height, w * wide / width, h * high / height
        return [round(float(part), 5) for part in parts]

    plots = []
    for axes in figure.axes:
        drawn = all(isinstance(one, LineCollection | PathCollection | PolyCollection) for one in axes.collections)
        if axes.name != "rectilinear" or not axes.axison or axes.images or not drawn:
            continue
        x, y = _Axis(axes.xaxis), _Axis(axes.yaxis)
        series = [found for found in _series(axes, x, y) if found["x"]]
        if not series:
            continue
        labels = [
            label.get_window_extent().transformed(figure.transFigure.inverted()).bounds
            for axis in (axes.xaxis, axes.yaxis)
            for label in (*axis.get_ticklabels(), axis.get_offset_text())
            if label.get_visible() and label.get_text()
        ]
        shared = axes.get_shared_x_axes().get_siblings(axes)
        plots.append(
            {
                "box": place(*axes.get_position().bounds),
                "clear": [place(*bounds) for bounds in labels],
                "below": any(label.get_text() for label in axes.xaxis.get_ticklabels() if label.get_visible()),
                "group": min(map(figure.axes.index, (one for one in shared if one in figure.axes))),
                "title": axes.get_title(loc="left") or axes.get_title(),
                "x": x.describe(),
                "y": y.describe(),
                "series": series,
            }
        )
    if not plots or sum(len(one["x"]) for plot in plots for one in plot["series"]) > MOST:
        return ""
    return json.dumps(plots, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


class _Axis:
    """One axis: its ends, its scale, and its values to the digits that can be told apart."""

    def __init__(self, axis: Any) -> None:
        low, high = (float(end) for end in axis.get_view_interval())
        self.label = " ".join(str(axis.get_label_text()).replace("$", "").split())
        self.log = axis.get_scale() == "log"
        self.ends = low, high
        self.decimals = DIGITS - int(np.floor(np.log10(abs(high - low) or 1.0)))

    def describe(self) -> dict[str, Any]:
        return {"ends": [float(f"{end:.9g}") for end in self.ends], "log": self.log, "label": self.label}

    def values(self, values: ArrayLike) -> list[float | None]:
        given = np.asarray(values, dtype=float)
        if self.log:
            return [float(f"{v:.6g}") if np.isfinite(v) else None for v in given.tolist()]
        return _plain(np.round(given, self.decimals))


def _plain(values: ArrayLike) -> list[float | None]:
    """Return numbers as JSON has them: what is missing is null."""
    return [v if np.isfinite(v) else None for v in np.asarray(values, dtype=float).tolist()]


def _series(axes: Any, x: _Axis, y: _Axis) -> Iterator[dict[str, Any]]:
    """Yield the parts of axes: `kind` line, dots, or area; `across` where one direction is in parts of the axes ("x", "y")."""
    from matplotlib.collections import LineCollection, PathCollection
    from matplotlib.colors import to_hex

    def make(kind: str, points: Array, of: Any, colour: Any, transform: Any) -> Iterator[dict[str, Any]]:
        inside = transform.contains_branch_seperately(axes.transData)
        if not any(inside):
            return
        scaled = [axis.values(v) if of_data else _plain(v) for axis, v, of_data in zip((x, y), points.T, inside, strict=True)]  # fmt: skip
        name = str(of.get_label())
        named = "" if name.startswith("_") else " ".join(name.replace("$", "").split())
        across = "" if all(inside) else "y" if inside[0] else "x"
        paint = to_hex(colour, keep_alpha=True)
        yield {"kind": kind, "name": named, "colour": paint, "across": across, "x": scaled[0], "y": scaled[1]}

    for line in axes.lines:
        if line.get_visible():
            points = np.column_stack([np.asarray(one, dtype=float) for one in line.get_data()])
            style = line.get_linestyle()
            kind = "dots" if style in ("None", "none", "", " ") else "dash" if style in ("--", ":", "-.") else "line"
            yield from make(kind, points, line, line.get_color(), line.get_transform())
    for own in axes.collections:
        if isinstance(own, PathCollection):
            colours = own.get_facecolor()
            yield from make("dots", np.ma.filled(own.get_offsets(), np.nan), own, colours[0] if len(colours) else "k", own.get_offset_transform())  # fmt: skip
        elif paths := own.get_paths():
            kind = "line" if isinstance(own, LineCollection) else "area"
            colours = own.get_edgecolor() if kind == "line" else own.get_facecolor()
            ends = np.full((1, 2), np.nan)
            points = np.concatenate([part for path in paths for part in (path.vertices, ends)])
            yield from make(kind, points, own, colours[0] if len(colours) else "k", own.get_transform())
    for bar in axes.patches:
        corners = bar.get_patch_transform().transform(bar.get_path().vertices)
        yield from make("area", np.asarray(corners, dtype=float), bar, bar.get_facecolor(), bar.get_transform())
