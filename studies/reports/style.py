"""How figures look: colours that survive print and colour blindness, a light grid, SI units in the labels."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.results import Drawing

if TYPE_CHECKING:
    from compensation.stability import AllanDeviation, NoiseCoefficients

# Okabe and Ito's set: distinguishable with every common kind of colour vision, and by lightness in print.
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, YELLOW)  # in the order in which the lines of a figure take them
_STYLE = {
    "font.size": 10,
    "axes.grid": True,
    "grid.color": "#d5dae0",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.prop_cycle": f"cycler(color={COLOURS})",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.6,
}
MOST_POINTS = 4000  # of a line or a cloud; more only make the page heavy


def few_rows(count: int) -> NDArray[np.intp]:
    """Return the rows that are drawn of so many: all, or as many as can be told apart, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, MOST_POINTS).astype(np.intp))


def outline_rows(values: Array) -> NDArray[np.intp]:
    """Return the rows of a column that are drawn: all, or the least and the largest of as many parts as can be told apart."""
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    part = np.arange(len(values)) * (MOST_POINTS // 2) // len(values)
    order = np.lexsort((values, part))  # missing values last
    known = np.bincount(part, np.isfinite(values)).astype(np.intp)
    first = np.concatenate([[0], np.cumsum(np.bincount(part))[:-1]])
    ends = np.concatenate([first, first + np.maximum(known, 1) - 1, first + known - 1 + (known < np.bincount(part))])
    return np.unique(np.concatenate([[0, len(values) - 1], order[ends]]))


def draw_allan(
    axes: Any, allan: "AllanDeviation", colour: str, label: str, noise: "NoiseCoefficients | None" = None
) -> None:
    """Draw an Allan deviation with its interval, and dashed the noise that was fitted to it."""
    axes.fill_between(allan.tau, allan.low, allan.high, color=colour, alpha=0.25, linewidth=0)
    axes.loglog(allan.tau, allan.deviation, color=colour, label=label)
    if noise is not None:
        axes.loglog(allan.tau, noise.deviation(allan.tau), "--", color=colour, linewidth=1, alpha=0.8)


@contextmanager
def panels(
    count: int, across: int = 2, height: float = 2.5, x: str = "", **options: Any
) -> Iterator[tuple[Drawing, list[Any]]]:
    """Give a figure with so many axes side by side and below each other, as `figure` does; `x` stands below the last of every column."""
    rows = -(-count // across)
    with figure(rows, min(count, across), height=height * rows, squeeze=False, **options) as (made, axes):
        shown = list(axes.flat)
        for axis in shown[count:]:
            axis.set_visible(False)
        for axis in shown[max(count - across, 0) : count]:
            axis.set_xlabel(x)
        yield made, shown[:count]


@contextmanager
def figure(
    rows: int = 1, columns: int = 1, height: float = 3.4, x: str = "", y: str | Sequence[str] = "", **options: Any
) -> Iterator[tuple[Drawing, Any]]:
    """Give a figure and its axes in the house style, with `x` below the last row, `y` beside every row, and legends of named lines."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        made = Figure(figsize=(7.4, height), layout="constrained")
        axes = made.subplots(rows, columns, **options)
        grid = np.reshape(axes, (rows, columns))
        for axis in grid[-1]:
            axis.set_xlabel(x)
        for axis, label in zip(grid[:, 0], [y] * rows if isinstance(y, str) else y, strict=True):
            axis.set_ylabel(label)
        yield made, axes
        for axis in made.axes:
            if axis.get_legend() is None and axis.get_legend_handles_labels()[0]:
                axis.legend()
