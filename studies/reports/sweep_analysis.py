"""Chapters on what a study means: which parameter matters, the yield, worst cases and designs by inversion."""

from collections.abc import Mapping
from typing import Any

from studies.errors import InputError
from studies.reports import sweep_figures as figures
from studies.reports.page import Block, Chapter, Table, Text
from studies.reports.sweep_cells import main_columns, number, percent
from studies.sweeps.definition import StudyParameter
from studies.sweeps.quantity import Column
from studies.sweeps.results import Results
from studies.sweeps.search import name_search
from studies.sweeps.sensitivity import linear_shares, local_slopes, sobol_indices
from studies.sweeps.tolerance import find_reach, find_yield, resolve_limits


def influence_chapters(results: Results) -> list[Chapter]:
    """Return which parameter matters: Sobol indices, slopes or linear shares, whichever the design allows."""
    blocks: list[Block] = []
    method = results.study.sampling.method
    for column in main_columns(results):
        try:
            if method == "sensitivity":
                blocks += _sobol(results, column)
            elif method == "one-at-a-time":
                blocks += _slopes(results, column)
            elif method in ("latin-hypercube", "sobol"):
                blocks += _shares(results, column)
        except InputError as error:
            blocks.append(Text(str(error), "warning"))
    return [Chapter("Influence of the parameters", blocks)] if blocks else []


def _sobol(results: Results, column: Column) -> list[Block]:
    found = sobol_indices(results, column.name)
    if found.variance == 0:
        return [Text(f"{column.label} is the same for every design: no parameter influences it.", "note")]
    rows = []
    for k, name in enumerate(found.parameters):
        first = [f"{found.first[k]:.4f}", f"{found.first_low[k]:.4f} … {found.first_high[k]:.4f}"]
        rows.append([name, *first, f"{found.total[k]:.4f}", f"{found.total_low[k]:.4f} … {found.total_high[k]:.4f}"])
    heads = ["Parameter", "First order", "95 % interval", "Total", "95 % interval"]
    table = Table(
        f"Sobol indices of {column.label}",
        heads,
        rows,
        "A parameter whose total interval includes zero has no significant influence.",
        True,
    )
    return [table, figures.sobol_figure(found, column)]


def _slopes(results: Results, column: Column) -> list[Block]:
    found = local_slopes(results, column.name)
    units = {p.name: p.unit for p in results.study.parameters}
    rows = []
    for slope in found:
        unit = _slope_unit(column.unit, units[slope.parameter])
        rows.append([slope.parameter, f"{slope.slope:.6g}", f"{slope.uncertainty:.2g}", unit, f"{slope.swing:.6g}"])
    heads = ["Parameter", "Slope", "±", "Unit", f"Change over the range ({column.unit})"]
    note = (
        "± includes curvature beyond the outer levels and the solver error; a slope smaller than ± is not significant."
    )
    return [
        Table(f"Slopes of {column.label} at the nominal design", heads, rows, note, True),
        figures.tornado_figure(found, column),
    ]


def _shares(results: Results, column: Column) -> list[Block]:
    found = linear_shares(results, column.name)
    if found is None:
        return []
    units = {p.name: p.unit for p in results.study.parameters}
    rows = [
        [name, f"{slope:.6g}", f"{half:.2g}", _slope_unit(column.unit, units[name]), percent(share)]
        for name, slope, half, share in zip(found.parameters, found.slope, found.half_width, found.share, strict=True)
    ]
    note = f"A linear model explains {percent(found.r_squared)} of the variance. ± is half of the 95 % interval; a slope smaller than ± is not significant."
    return [
        Table(
            f"Linear influence on {column.label}",
            ["Parameter", "Slope", "±", "Unit", "Share of variance"],
            rows,
            note,
            True,
        )
    ]


def _slope_unit(column: str, parameter: str) -> str:
    return column if parameter == "1" else f"{column} per {parameter}"


def tolerance_chapters(results: Results) -> list[Chapter]:
    """Return the yield under the requirements, and how far the tolerances may reach."""
    study = results.study
    if not study.requirements or not len(results):
        return []
    try:
        rows = []
        for requirement in study.requirements:
            limits = resolve_limits(results, requirement)
            rows.append(
                [limits.column, number(limits.low), number(limits.high), *_yield_cells(results, (requirement,))]
            )
        rows.append(["all requirements", "", "", *_yield_cells(results, study.requirements)])
        reach = find_reach(results, study.requirements)
    except InputError as error:
        return [Chapter("Tolerances", [Text(str(error), "warning")])]
    note = (
        "For the interval, a design without a result counts as failed at the lower end and as passed at the upper end."
    )
    heads = ["Requirement", "From", "To", "Designs that meet it", "95 % interval", "Without a result"]
    if reach.part is None:
        words = "No sampled design fails: the tolerances can be wider than the ranges of the study."
    else:
        words = (
            f"The largest box around the nominal design without a failed design covers {100 * reach.part:.3g} % of every range"
            f" ({reach.inside} designs inside): "
            + ", ".join(_reach(p, reach.part) for p in study.parameters if not isinstance(p.nominal, str))
            + ". This is based on the sampled designs only; confirm it with a worst-case search."
        )
    found = _findings(results, "tolerance")
    return [Chapter("Tolerances", [*found, Table("Yield", heads, rows, note), Text(words, "note")])]


def _yield_cells(results: Results, requirements: Any) -> list[str]:
    found = find_yield(results, requirements)
    between = "" if found.low is None else f"{percent(found.low)} … {percent(found.high)}"
    return [percent(found.share), between, str(found.unknown)]


def _reach(parameter: StudyParameter, part: float) -> str:
    nominal = float(parameter.nominal)
    low, high = (nominal + part * (end - nominal) for end in (parameter.low, parameter.high))
    return f"{figures.label(parameter.name, parameter.unit)} {low:.4g} … {high:.4g}"


def search_chapters(results: Results) -> list[Chapter]:
    """Return what the worst-case searches and inversions found."""
    blocks = _findings(results, "worst-case", "inversion")
    return [Chapter("Searches", blocks)] if blocks else []


def _findings(results: Results, *kinds: str) -> list[Block]:
    findings = results.store.findings()
    blocks: list[Block] = []
    for search in (one for one in results.study.searches if one.kind in kinds):
        found = findings.get(name_search(search))
        if found is None:
            blocks.append(
                Text(f"The search for {name_search(search)} has not been run yet: run the study again.", "warning")
            )
        elif "failed" in found:
            blocks.append(Text(f"The search for {name_search(search)} failed: {found['failed']}", "warning"))
        else:
            blocks += SEARCHES[search.kind](results, found)
    return blocks


def _worst_case(results: Results, found: Mapping[str, Any]) -> list[Block]:
    names = results.study.names
    rows = [
        [end, number(found[end]["value"]), *(number(found[end]["parameters"][name]) for name in names)]
        for end in ("least", "greatest")
    ]
    heads = ["", found["column"], *(figures.label(p.name, p.unit) for p in results.study.parameters)]
    note = "Bounded quasi-Newton search from the worst corner of the box; text parameters keep their nominal value."
    return [Table(f"Worst cases of {found['column']} within the ranges", heads, rows, note)]


def _inversion(results: Results, found: Mapping[str, Any]) -> list[Block]:
    rows = [[column, number(wanted), number(found["values"][column])] for column, wanted in found["targets"].items()]
    design = ", ".join(f"{name} = {number(value)}" for name, value in found["parameters"].items())
    if found["reached"]:
        words, kind = f"The targets are met by {design}.", "note"
    else:
        limits = f" It is at the limit of {', '.join(found['at_limit'])}." if found["at_limit"] else ""
        words, kind = f"No design within the ranges meets the targets. The closest is {design}.{limits}", "warning"
    if found["condition"] and found["condition"] > 1e3:
        words += f" The targets barely separate the parameters (condition number {found['condition']:.1e})."
    return [Table("Design by inversion", ["Column", "Target", "Found"], rows), Text(words, kind)]


def _tolerances(results: Results, found: Mapping[str, Any]) -> list[Block]:
    rows = describe_tolerances(results, found)
    head = f"Tolerances with which {100 * found['share']:g} % of designs meet the requirements"
    note = (
        f"{tell_tolerance(found)} Each of the {found['cases']} sampled designs is scaled along its line through the nominal design;"
        " the interval is the 90 % interval of the quantile for this number of samples."
    )
    return [Table(head, ["Parameter", "Specified", "Found"], rows, note)]


def describe_tolerances(results: Results, found: Mapping[str, Any]) -> list[list[str]]:
    """Rows of parameter, the tolerance that was asked, and the one that was found."""
    asked = {p.name: p for p in results.study.parameters}
    rows = []
    for one in found["tolerances"]:
        p = asked[one["name"]]
        label = figures.label(p.name, p.unit)
        if p.standard_deviation is not None:
            rows.append([label, f"σ = {number(p.standard_deviation)}", f"σ = {one['standard_deviation']:.4g}"])
        else:
            rows.append([label, f"{number(p.low)} … {number(p.high)}", f"{one['low']:.6g} … {one['high']:.6g}"])
    return rows


def tell_tolerance(found: Mapping[str, Any]) -> str:
    """Say by which factor tolerances may be wider, in a sentence."""
    low, high = found["low"], found["high"]
    return (
        f"{100 * found['share']:g} % of designs meet the requirements if the tolerances are {found['factor']:.3g} times those of"
        f" the study ({low:.3g} … {high:.3g})."
    )


SEARCHES = {"worst-case": _worst_case, "inversion": _inversion, "tolerance": _tolerances}
