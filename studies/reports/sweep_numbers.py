"""Numbers of a study: every column over all designs, sensitivities, yield."""

from typing import Any

import numpy as np

from studies.errors import InputError
from studies.reports.digits import plain, to_numerical_error
from studies.results import Column, Table, row_of
from studies.sweeps.quantity import Column as Output
from studies.sweeps.results import Results
from studies.sweeps.sensitivity import linear_shares, local_slopes, sobol_indices
from studies.sweeps.tolerance import Yield, find_yield

STATISTICS = (
    *(Column("label", "Quantity"), "Unit", "Nominal", "Mean", Column("deviation", "Standard deviation")),
    *(Column("least", "Minimum"), Column("greatest", "Maximum"), Column("error", "Numerical error")),
)
NUMERICAL = "The numerical error is the largest error estimate of the solver over all designs, relative to the exact solution of its theory."


def summarise(results: Results) -> dict[str, Any]:
    """Return the numbers behind the page (schema hrg.study-report/1)."""
    found: dict[str, Any] = {
        "schema": "hrg.study-report/1",
        "study": results.study.name,
        "cases": len(results),
        **row_of(results, "done", "total"),
        "failed": len(results.failed),
        "columns": {c.name: {"unit": c.unit, **numbers_of(results, c)} for c in results.study.columns},
        "searches": results.store.findings,
    }
    for key, analyse in (("sobol", sobol_indices), ("slopes", local_slopes), ("linear", linear_shares)):
        found[key] = {c.name: _data(analyse, results, c.name) for c in results.study.columns}
    whole = yield_of(results)
    if whole is not None:
        found["yield"] = {k: v for k, v in vars(whole).items() if k != "limits"} | {"share": whole.share}
    return found


def _data(analyse: Any, results: Results, column: str) -> Any:
    try:
        found = analyse(results, column)
    except InputError:
        return None
    return [vars(one) for one in found] if isinstance(found, list) else None if found is None else vars(found)


def numbers_of(results: Results, column: Output) -> dict[str, float]:
    """Return a column at the nominal design and over all designs, with its largest numerical error."""
    y = results.column(column.name)
    y = y[np.isfinite(y)]
    place = [c.name for c in results.study.columns].index(column.name)
    nominal = results.nominal.values[place] if results.nominal is not None else np.nan
    errors = results.error(column.name)
    error = float(np.nanmax(errors)) if np.isfinite(errors).any() else np.nan
    numbers: dict[str, Any] = {"mean": np.mean, "deviation": np.std, "least": np.min, "greatest": np.max}
    over_all = {name: float(function(y)) if y.size else np.nan for name, function in numbers.items()}
    return {"nominal": nominal, **over_all, "error": error}


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
        n = numbers_of(results, column)
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
