"""Figures of a study: how results are spread, how they follow the parameters, and which parameter matters."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from studies.errors import InputError
from studies.instrument.units import split_unit
from studies.reports import style
from studies.results import Drawing, Figure
from studies.sweeps.definition import StudyParameter
from studies.sweeps.quantity import Column
from studies.sweeps.results import Results
from studies.sweeps.sensitivity import LocalSlope, SobolIndices


def label(name: str, unit: str) -> str:
    """Return a parameter's name without its table and the unit that it carries, and the unit in brackets."""
    words = name.split(".", 1)[-1]
    plain = split_unit(words)[0].replace("_", " ").replace(".", " ")
    return plain + ("" if unit == "1" else f" ({unit})")


def column_label(column: Column) -> str:
    """Return what a column is, with its unit in brackets."""
    return column.label + ("" if column.unit == "1" else f" ({column.unit})")


def first_figure(results: Results) -> Drawing:
    """Draw the first column against the parameters."""
    column = results.study.columns[0]
    if not _is_drawable(results, column):
        raise InputError(f"no design of the study '{results.study.name}' has a value of '{column.name}'.")
    return _draw_response(results, column)


def response_figures(results: Results, column: Column) -> list[Figure]:
    """Return a column against the parameters, where there is a number to draw it over."""
    if not _is_drawable(results, column):
        return []
    mapped = _is_map(results)
    words = f"Map of {column.label}; failed designs are left blank." if mapped else f"{column.label} by parameter."
    alt = f"Map of {column.label} over two parameters." if mapped else f"{column.label} over each parameter."
    return [Figure(lambda: _draw_response(results, column), words, alt)]


def _numeric(results: Results) -> list[StudyParameter]:
    return [p for p in results.study.parameters if not isinstance(p.nominal, str)]


def _is_drawable(results: Results, column: Column) -> bool:
    return bool(_numeric(results)) and bool(np.isfinite(results.column(column.name)).any())


def _is_map(results: Results) -> bool:
    """Return whether a study is a grid of two numbers."""
    return results.study.sampling.method == "grid" and len(_numeric(results)) == 2 == len(results.study.parameters)


def draw_spread(results: Results, column: Column, limits: Sequence[float]) -> Drawing:
    """Draw the histogram of a column, with the nominal design and the limits asked for."""
    y, n = results.column(column.name), results.numbers[column.name]
    count = int(np.isfinite(y).sum())
    bars, edges = np.histogram(y, min(60, max(5, int(np.sqrt(count)))), (n["least"], n["greatest"]))
    with style.figure(height=2.6, x=column_label(column), y="designs") as (made, axes):
        axes.hist(edges[:-1], list(edges), weights=bars, color=style.SKY, edgecolor="white", linewidth=0.4)
        if results.nominal is not None:
            axes.axvline(n["nominal"], color=style.BLACK, linewidth=1.2, label="nominal design")
        near = n["greatest"] - n["least"]  # what lies farther away than the spread is said, so that the bars stay wide
        for end in sorted({end for end in limits if np.isfinite(end)}):
            if n["least"] - near <= end <= n["greatest"] + near:
                axes.axvline(end, color=style.VERMILION, linestyle="--", label=f"required: {end:.8g}")
            else:
                axes.plot([], [], color=style.VERMILION, linestyle="--", label=f"required: {end:.8g}, outside the plot")
        axes.ticklabel_format(axis="x", useOffset=False)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
    return made


def _draw_response(results: Results, column: Column) -> Drawing:
    """Draw a column against the parameters: a map for a grid of two, else one panel for each of the first six."""
    if _is_map(results):
        return _draw_map(results, column)
    numeric = _numeric(results)
    shown = numeric[:6]
    few = style.few_rows(len(results))
    y = results.column(column.name)[few]
    mark = (
        {"marker": "o", "markersize": 4} if len(numeric) == 1 else {"marker": ".", "markersize": 2.5, "linestyle": ""}
    )
    with style.panels(len(shown), 3, 2.6, sharey=True) as (made, axes):
        for panel, parameter in zip(axes, shown, strict=True):
            x = results.parameter(parameter.name)[few].astype(float)
            order = np.argsort(x)
            panel.plot(x[order], y[order], color=style.BLUE, rasterized=len(few) > 500, **mark)
            panel.set_xlabel(label(parameter.name, parameter.unit), fontsize=9)
            panel.locator_params(axis="x", nbins=4)
            panel.tick_params(labelsize=8)
            panel.ticklabel_format(useOffset=False)
        for panel in axes[::3]:
            panel.set_ylabel(column_label(column), fontsize=9)
    return made


def _draw_map(results: Results, column: Column) -> Drawing:
    one, other = results.study.parameters
    x, y = (np.unique(results.parameter(p.name).astype(float)) for p in (one, other))
    z = np.full((len(y), len(x)), np.nan)
    rows = np.searchsorted(y, results.parameter(other.name).astype(float))
    places = np.searchsorted(x, results.parameter(one.name).astype(float))
    z[rows, places] = results.column(column.name)
    steps_x, steps_y = (max(1, len(axis) // 200) for axis in (x, y))
    x, y, z = x[::steps_x], y[::steps_y], z[::steps_y, ::steps_x]
    with style.figure(height=4.0, x=label(one.name, one.unit), y=label(other.name, other.unit)) as (made, axes):
        picture: Any = axes.pcolormesh(x, y, z, cmap="cividis", shading="nearest", rasterized=True)
        if min(z.shape) > 1 and np.isfinite(z).all() and np.ptp(z) > 0:
            lines = axes.contour(x, y, z, colors="white", linewidths=0.8)
            axes.clabel(lines, fontsize=8, fmt="%.6g")
        made.colorbar(picture, label=column_label(column), format="%.6g")
    return made


def draw_sobol(indices: SobolIndices, column: Column) -> Drawing:
    """Draw first-order and total indices with their intervals."""
    at = np.arange(len(indices.parameters))
    with style.figure(height=1.2 + 0.45 * len(at), x=f"share of the variance of {column.label}") as (made, axes):
        for shift, name, colour, values, low, high in (
            (-0.18, "alone (first order)", style.BLUE, indices.first, indices.first_low, indices.first_high),
            (0.18, "with all interactions (total)", style.ORANGE, indices.total, indices.total_low, indices.total_high),
        ):
            reach = np.maximum([values - low, high - values], 0)
            axes.barh(at + shift, values, 0.32, color=colour, label=name)
            axes.errorbar(values, at + shift, xerr=reach, fmt="none", color=style.BLACK, linewidth=1, capsize=2)
        axes.set_yticks(at, [label(name, "1") for name in indices.parameters])
        axes.invert_yaxis()
    return made


def draw_tornado(slopes: list[LocalSlope], column: Column) -> Drawing:
    """Draw what each parameter alone does to a column between the ends of its range."""
    ordered = sorted(slopes, key=lambda slope: abs(slope.swing))
    at = np.arange(len(ordered))
    with style.figure(height=1.2 + 0.4 * len(at), x=f"change of {column_label(column)}") as (made, axes):
        for end, colour, words in (("at_low", style.SKY, "lower end"), ("at_high", style.BLUE, "upper end")):
            change = [getattr(slope, end) - slope.nominal for slope in ordered]
            axes.barh(at, change, 0.6, color=colour, label=words)
        axes.axvline(0, color=style.BLACK, linewidth=0.8)
        axes.set_yticks(at, [label(slope.parameter, "1") for slope in ordered])
    return made
