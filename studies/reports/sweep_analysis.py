"""Chapters on what a study means: which parameter matters, the yield, worst cases."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from studies.errors import InputError
from studies.reports import sweep_figures as figures
from studies.reports.digits import plain, to_numerical_error
from studies.results import Column, Figure, Head, Part, Sentence, Table, row_of, rows_of
from studies.sweeps.quantity import Column as Output
from studies.sweeps.results import Results
from studies.sweeps.search import name_search
from studies.sweeps.sensitivity import linear_shares, local_slopes, sobol_indices
from studies.sweeps.tolerance import Yield, find_yield, resolve_limits, tell_doubt

SOBOL = "Parameter | first: First order .4f | first_low … first_high: 90 % interval .4f | total: Total .4f | total_low … total_high: 90 % interval .4f"
SHARES = "Parameter | slope ± half_width: Slope | Unit | share: Share of variance (%) ×100 .2f"
YIELD = "Requirement | from: From .8g | to: To .8g | share: Designs that meet it (%) ×100 .2f | low … high: 90 % interval (%) ×100 .2f | unknown: Without a result"
TOLERANCES = "label: Parameter | asked: Specified | Found"


def main_columns(results: Results) -> list[Output]:
    """Return the first column of every quantity: those that are drawn."""
    return [asked.columns[0] for asked in results.study.asked]


def number(value: Any) -> str:
    """Return eight digits of a number, text as it is, nothing for nothing and for no end."""
    if isinstance(value, str):
        return value
    return "" if value is None or not np.isfinite(value) else f"{value:.8g}"


def influence_parts(results: Results) -> list[Part]:
    """Return which parameter matters: Sobol indices, slopes or linear shares, whichever the design allows."""
    show = {"sensitivity": _sobol, "one-at-a-time": _slopes, "latin-hypercube": _shares, "sobol": _shares}
    parts: list[Part] = []
    for column in main_columns(results) if results.study.sampling.method in show else ():
        try:
            parts += show[results.study.sampling.method](results, column)
        except InputError as error:
            parts.append(Sentence(str(error), "warning"))
    return parts


def _sobol(results: Results, column: Output) -> list[Part]:
    found = sobol_indices(results, column.name)
    if found.variance == 0:
        return [Sentence(f"{column.label} is the same for every design: no parameter influences it.", "note")]
    names = ("first", "first_low", "first_high", "total", "total_low", "total_high")
    rows = rows_of({"parameter": [figures.label(p, "1") for p in found.parameters], **row_of(found, *names)})
    note = "A parameter whose total interval includes zero has no significant influence."
    table = Table(f"Sobol indices of {column.label}", rows, SOBOL, note, sortable=True)
    return [table, Figure(lambda: figures.draw_sobol(found, column), "Sobol indices with 90 % intervals.")]


def _slopes(results: Results, column: Output) -> list[Part]:
    found = local_slopes(results, column.name)
    units = _slope_units(results, column)
    columns = (
        Column(lambda slope: figures.label(slope.parameter, "1"), "Parameter"),
        "slope: Slope .6g | uncertainty: ± .2g",
        Column(lambda slope: units[slope.parameter], "Unit"),
        Column("swing", "Change over the range", column.unit, ".6g"),
    )
    note = "± includes curvature beyond the outer levels and the solver error; smaller slopes are not significant."
    table = Table(f"Slopes of {column.label} at the nominal design", found, columns, note, sortable=True)
    caption = "Change from the nominal design at the ends of each parameter's range."
    return [table, Figure(lambda: figures.draw_tornado(found, column), caption)]


def _shares(results: Results, column: Output) -> list[Part]:
    found = linear_shares(results, column.name)
    if found is None:
        return []
    units = _slope_units(results, column)
    rows = rows_of({"parameter": found.parameters, **row_of(found, "slope", "half_width", "share")})
    rows = [row | {"parameter": figures.label(row["parameter"], "1"), "unit": units[row["parameter"]]} for row in rows]
    note = f"A linear model explains {100 * found.r_squared:.2f} % of the variance. ± is half of the 90 % interval; a slope smaller than ± is not significant."
    return [Table(f"Linear influence on {column.label}", rows, SHARES, note, sortable=True)]


def _slope_units(results: Results, column: Output) -> dict[str, str]:
    return {p.name: column.unit if p.unit == "1" else f"{column.unit} per {p.unit}" for p in results.study.parameters}


def tolerance_parts(results: Results) -> list[Part]:
    """Return what was found on tolerances, and the yield under the requirements."""
    study = results.study
    if not study.requirements or not len(results):
        return []
    try:
        rows = []
        for requirement in study.requirements:
            low, high = (end if np.isfinite(end) else None for end in resolve_limits(results, requirement))
            limits = {"requirement": requirement.column, "from": low, "to": high}
            rows.append(limits | _yield_row(results, (requirement,)))
        rows.append({"requirement": "all requirements"} | _yield_row(results, study.requirements))
    except InputError as error:
        return [Sentence(str(error), "warning")]
    note = "In the interval, a design without a result counts as failed at the lower end, passed at the upper."
    doubts = (Sentence(one, "warning") for one in _doubts(results) if one)
    return [*search_parts(results, "tolerance"), Table("Yield", rows, YIELD, note), *doubts]


def _doubts(results: Results) -> Iterator[str]:
    """Yield which limits are nearer to the nominal design than its own error; those about its value share that."""
    columns = {column.name: (k, column) for k, column in enumerate(results.study.columns)}
    for asked in results.study.requirements:
        (k, column), nominal = columns[asked.column], results.nominal
        if nominal is not None and not asked.is_relative:
            value, error, limits = nominal.values[k], nominal.errors[k], resolve_limits(results, asked)
            yield tell_doubt(column.label, column.unit, float(value), float(error), limits)


def _yield_row(results: Results, requirements: Any) -> dict[str, Any]:
    return row_of(find_yield(results, requirements), "share", "low", "high", "unknown")


def search_parts(results: Results, *kinds: str) -> list[Part]:
    """Return what the searches of these kinds found."""
    findings = results.store.findings
    parts: list[Part] = []
    for search in (one for one in results.study.searches if one.kind in kinds):
        name = name_search(search)
        found = findings.get(name)
        if found is None:
            parts.append(Sentence(f"The search for {name} has not been run yet: run the study again.", "warning"))
        elif "failed" in found:
            parts.append(Sentence(f"The search for {name} failed: {found['failed']}", "warning"))
        else:
            parts += SEARCHES[search.kind](results, found)
    return parts


def _worst_case(results: Results, found: Mapping[str, Any]) -> list[Part]:
    rows = [{"end": end} | found[end] for end in ("least", "greatest")]
    columns: Head = (
        "end: ",
        Column("value", found["column"], form=".8g"),
        *(Column(_parameter(p.name), figures.label(p.name, p.unit), form=".8g") for p in results.study.parameters),
    )
    note = "Bounded quasi-Newton search from the worst corner of the box; text parameters keep their nominal value."
    if any(p.distribution == "normal" and not p.bounded for p in results.study.parameters):
        note += " The range of a normal parameter without bounds is ± 3 standard deviations: one design in 370 is drawn beyond it for each, and may lie beyond these values."
    return [Table(f"Worst cases of {found['column']} within the ranges", rows, columns, note)]


def _parameter(name: str) -> Callable[[Mapping[str, Any]], Any]:
    return lambda row: row["parameters"][name]


def tolerance_table(results: Results, found: Mapping[str, Any]) -> Table:
    """Return the tolerances that were asked for, and those that were found."""
    asked = {p.name: p for p in results.study.parameters}
    rows = []
    for one in found["tolerances"]:
        p = asked[one["name"]]
        label = figures.label(p.name, p.unit)
        if p.standard_deviation is not None:
            drawn = f", {p.drawn_deviation:.4g} within {number(p.low)} … {number(p.high)}" if p.bounded else ""
            ends = f"σ = {number(p.standard_deviation)}{drawn}", f"σ = {one['standard_deviation']:.4g}"
        else:
            ends = f"{number(p.low)} … {number(p.high)}", f"{one['low']:.6g} … {one['high']:.6g}"
        rows.append({"label": label, "asked": ends[0], "found": ends[1]})
    share = f"{100 * found['share']:g} %"
    note = (
        f"{share} of designs meet the requirements if the tolerances are {found['factor']:.3g} times those of the study"
        f" ({found['low']:.3g} … {found['high']:.3g}). Each of the {found['cases']} sampled designs is scaled along its line through the"
        " nominal design; the interval is the 90 % interval of the quantile for this number of samples."
    )
    return Table(f"Tolerances with which {share} of designs meet the requirements", rows, TOLERANCES, note)


SEARCHES: dict[str, Callable[[Results, Mapping[str, Any]], list[Part]]] = {
    "worst-case": _worst_case,
    "tolerance": lambda results, found: [tolerance_table(results, found)],
}


STATISTICS = "label: Quantity | Unit | Nominal | Mean | deviation: Standard deviation | least: Minimum | greatest: Maximum | error: Numerical error"
NUMERICAL = "The numerical error is the largest error estimate of the solver over all designs, relative to the exact solution of its theory."


def summarise(results: Results) -> dict[str, Any]:
    """Return the numbers behind the page (schema hrg.study-report/1)."""
    found: dict[str, Any] = {
        "schema": "hrg.study-report/1",
        "study": results.study.name,
        "cases": len(results),
        **row_of(results, "done", "total"),
        "failed": len(results.failed),
        "columns": {c.name: {"unit": c.unit, **results.numbers[c.name]} for c in results.study.columns},
        "searches": results.store.findings,
    }
    for key, analyse in (("sobol", sobol_indices), ("slopes", local_slopes), ("linear", linear_shares)):
        found[key] = {c.name: _data(analyse, results, c.name) for c in results.study.columns}
    whole = yield_of(results)
    if whole is not None:
        found["yield"] = vars(whole) | {"share": whole.share}
    return found


def _data(analyse: Any, results: Results, column: str) -> Any:
    try:
        found = analyse(results, column)
    except InputError:
        return None
    return [vars(one) for one in found] if isinstance(found, list) else None if found is None else vars(found)


def yield_of(results: Results) -> Yield | None:
    """Return the yield under all requirements; None without any, and where the nominal design that they need is missing."""
    if not results.study.requirements or not len(results):
        return None
    try:
        return find_yield(results, results.study.requirements)
    except InputError:  # the chapter on tolerances says why
        return None


def to_digits(value: float, error: float) -> str:
    """Return a number to the second digit of an error, six digits of it without one, nothing for nothing."""
    if np.isnan(value):
        return ""
    return to_numerical_error(value, error) if 0 < error < np.inf and abs(value) < 1e9 else f"{value:.6g}"


def statistics_table(results: Results) -> Table:
    """Return every column over all designs that have a result."""
    rows: list[dict[str, Any]] = []
    for column in results.study.columns:
        n = results.numbers[column.name]
        deviation, mean, error = n["deviation"], n["mean"], n["error"]
        to = error if np.isfinite(error) else deviation / 3
        scatter = plain(deviation) if deviation > 1e-12 * abs(mean) else "0"
        written = {key: to_digits(n[key], to) for key in ("nominal", "mean", "least", "greatest")}
        written |= {
            "deviation": "" if np.isnan(deviation) else scatter,
            "error": plain(error, 2) if np.isfinite(error) else "",
        }
        rows.append({"label": column.label, "unit": column.unit} | written)
    return Table("All designs with a result", rows, STATISTICS, NUMERICAL)
