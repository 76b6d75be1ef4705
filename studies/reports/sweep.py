"""The page of a parametric study: what was asked, what came out, what matters, and where it comes from."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.errors import UNUSABLE_INPUT, InputError
from studies.reports import sweep_figures as figures
from studies.reports.page import Block, Chapter, Facts, Table, Text, render_page
from studies.sweeps.design import nominal_design
from studies.sweeps.parameters import TEMPERATURE, set_parameters
from studies.sweeps.search import name_search
from studies.sweeps.sensitivity import linear_shares, local_slopes, sobol_indices
from studies.sweeps.tolerance import find_reach, find_yield, resolve_limits

if TYPE_CHECKING:
    from studies.sweeps.quantity import Column
    from studies.sweeps.results import Results
    from studies.sweeps.definition import Parameter

MOST_ROWS = 300
ENDS = 20  # designs shown from each end when there are more than MOST_ROWS
METHODS = {
    "grid": "every combination of the values",
    "list": "the combinations that the spec lists",
    "latin-hypercube": "a Latin hypercube",
    "sobol": "a scrambled Sobol sequence",
    "sensitivity": "Saltelli's design for Sobol indices",
    "one-at-a-time": "one parameter at a time about the nominal design",
}


def sweep_page(results: "Results") -> str:
    """Return the page of a study as HTML."""
    study = results.study
    done = len(results)
    lead = f"{done} designs by {METHODS[study.sampling.method]} about the card {study.instrument.name}."
    if study.note != "-":
        lead = f"{study.note} {lead}"
    chapters = [
        Chapter("In short", _short(results)),
        Chapter("What was asked", _asked(results)),
        *_failures(results),
        Chapter("Results", [_statistics(results), *_over_temperature(results), *_pictures(results), _designs(results)]),
        *_influence(results),
        *_tolerances(results),
        *_searches(results),
        *_shapes(results),
        Chapter("Provenance", _provenance(results)),
    ]
    return render_page(f"Study: {study.name}", lead, chapters)


def summarise(results: "Results") -> dict[str, Any]:
    """Return the numbers behind the page (schema hrg.study-report/1)."""
    found: dict[str, Any] = {
        "schema": "hrg.study-report/1",
        "study": results.study.name,
        "cases": len(results),
        "failed": len(results.failed),
        "columns": {c.name: {"unit": c.unit, **_numbers(results, c)} for c in results.study.columns},
        "searches": results.store.findings(),
    }
    for key, analyse in (("sobol", sobol_indices), ("slopes", local_slopes), ("linear", linear_shares)):
        found[key] = {c.name: _data(analyse, results, c.name) for c in results.study.columns}
    if results.study.requirements and len(results):
        whole = find_yield(results, results.study.requirements)
        found["yield"] = {k: v for k, v in vars(whole).items() if k != "limits"} | {"share": whole.share}
    return found


def _data(analyse: Any, results: "Results", column: str) -> Any:
    try:
        found = analyse(results, column)
    except InputError:
        return None
    return [vars(one) for one in found] if isinstance(found, list) else None if found is None else vars(found)


def _numbers(results: "Results", column: "Column") -> dict[str, float | None]:
    y = results.column(column.name)
    y = y[np.isfinite(y)]
    place = [c.name for c in results.study.columns].index(column.name)
    nominal = results.nominal.values[place] if results.nominal is not None else np.nan
    errors = results.errors[:, place]
    error = float(np.nanmax(errors)) if np.isfinite(errors).any() else np.nan
    if not y.size:
        return {
            "nominal": nominal,
            "mean": np.nan,
            "deviation": np.nan,
            "least": np.nan,
            "greatest": np.nan,
            "error": error,
        }
    return {
        "nominal": nominal,
        "mean": float(y.mean()),
        "deviation": float(y.std()),
        "least": float(y.min()),
        "greatest": float(y.max()),
        "error": error,
    }


def _short(results: "Results") -> list[Block]:
    facts = [("Designs", str(len(results)), f"{len(results.failed)} failed, of {results.total} asked for")]
    for column in _main(results)[:2]:
        n = _numbers(results, column)
        unit = "" if column.unit == "1" else f" {column.unit}"
        least, greatest, nominal = (f"{_short_g(n[key])}" for key in ("least", "greatest", "nominal"))
        facts.append((column.label, f"{least} … {greatest}{unit}", f"nominal {nominal}{unit}"))
    if results.study.requirements and len(results):
        found = find_yield(results, results.study.requirements)
        words = (
            "of the designs" if found.low is None else f"95 % interval {_percent(found.low)} … {_percent(found.high)}"
        )
        facts.append(("Meet every requirement", _percent(found.share), words))
    blocks: list[Block] = [Facts(facts)]
    if len(results) < results.total and not results.about["repeats"]:
        blocks.append(Text("The study is not finished: run it again to resume, then make this page anew.", "warning"))
    return blocks


def _asked(results: "Results") -> list[Block]:
    study = results.study
    sampling = study.sampling
    parameters = Table(
        "Parameters",
        ["Parameter", "Nominal", "Range", "Distribution"],
        [[figures.label(p.name, p.unit), _g(p.nominal), _range(p), _distribution(p)] for p in study.parameters],
    )
    rows = [
        [
            c.name,
            one.quantity.summary,
            ", ".join(f"{key} = {value}" for key, value in one.options.items() if value is not None),
        ]
        for one in study.asked
        for c in one.columns[:1]
    ]
    words = f"Sampled by {METHODS[sampling.method]}"
    words += f", seed {sampling.seed}" if sampling.method in ("latin-hypercube", "sobol", "sensitivity") else ""
    full = results.about["identity"]["solver"] == "full"
    solver = "every design solved in full" if full else "through reduced bases, with an error estimate for every design"
    return [parameters, Table("Quantities", ["Column", "What", "Options"], rows), Text(f"{words}; {solver}.")]


def _failures(results: "Results") -> list[Chapter]:
    if not results.failed.size:
        return []
    rows = [[str(count), reason] for reason, count in results.store.reasons()]
    examples = [
        [_g(case.parameters[name]) for name in results.study.names] + [case.remark]
        for case in results.failed[:MOST_ROWS]
    ]
    words = "These designs have no value and nothing was put in its place: every number on this page leaves them out."
    heads = [figures.label(p.name, p.unit) for p in results.study.parameters]
    return [
        Chapter(
            "Failed cases",
            [
                Text(words, "warning"),
                Table("Reasons", ["Cases", "Reason"], rows),
                Table("Failed designs", [*heads, "Reason"], examples, sortable=True),
            ],
        )
    ]


def _statistics(results: "Results") -> Table:
    rows = []
    for column in results.study.columns:
        n = _numbers(results, column)
        rows.append(
            [column.label, column.unit, *(_g(n[key]) for key in ("nominal", "mean", "deviation", "least", "greatest"))]
        )
        rows[-1].append(f"{n['error']:.1e}" if n["error"] is not None and np.isfinite(n["error"]) else "")
    heads = ["Quantity", "Unit", "Nominal", "Mean", "Standard deviation", "Least", "Greatest", "Numerical error"]
    note = "The numerical error is the largest estimate of the solver for any design, against the exact solution of its theory."
    return Table("Over all designs that have a value", heads, rows, note)


def _designs(results: "Results") -> Table:
    columns = _main(results)
    places = list(range(len(results)))
    note = "A click on a heading sorts."
    if len(places) > MOST_ROWS:
        order = np.argsort(results.column(columns[0].name), kind="stable")
        order = order[np.isfinite(results.column(columns[0].name)[order])]
        places = [*order[:ENDS].tolist(), *order[-ENDS:].tolist()]
        note += f" Of {len(results)} designs the {ENDS} with the least and greatest {columns[0].label}; export has all."
    rows = []
    for place in places:
        numbers = (results.column(column.name)[place] for column in columns)
        rows.append([str(place), *map(_g, results.design(place).values()), *map(_g, numbers)])
    heads = [figures.label(p.name, p.unit) for p in results.study.parameters]
    return Table("Designs", ["Case", *heads, *map(figures.column_label, columns)], rows, note, sortable=True)


def _pictures(results: "Results") -> list[Block]:
    limits = _limits(results)
    blocks: list[Block] = []
    for column in _main(results):
        y = results.column(column.name)
        if np.isfinite(y).sum() >= 20 and np.nanmax(y) > np.nanmin(y):
            blocks.append(figures.spread_figure(results, column, limits))
        response = figures.response_figure(results, column)
        blocks += [response] if response else []
    return blocks


def _influence(results: "Results") -> list[Chapter]:
    blocks: list[Block] = []
    method = results.study.sampling.method
    for column in _main(results):
        try:
            if method == "sensitivity":
                blocks += _sobol(results, column)
            elif method == "one-at-a-time":
                blocks += _slopes(results, column)
            elif method in ("latin-hypercube", "sobol"):
                blocks += _shares(results, column)
        except InputError as error:
            blocks.append(Text(str(error), "warning"))
    return [Chapter("Which parameter matters", blocks)] if blocks else []


def _sobol(results: "Results", column: "Column") -> list[Block]:
    found = sobol_indices(results, column.name)
    if found.variance == 0:
        return [Text(f"{column.label} is the same for every design: no parameter has any influence on it.", "note")]
    rows = []
    for k, name in enumerate(found.parameters):
        first = [f"{found.first[k]:.4f}", f"{found.first_low[k]:.4f} … {found.first_high[k]:.4f}"]
        rows.append([name, *first, f"{found.total[k]:.4f}", f"{found.total_low[k]:.4f} … {found.total_high[k]:.4f}"])
    heads = ["Parameter", "First order", "95 % interval", "Total", "95 % interval"]
    table = Table(
        f"Sobol indices of {column.label}",
        heads,
        rows,
        "A parameter whose total interval holds zero has no influence that shows.",
        True,
    )
    return [table, figures.sobol_figure(found, column)]


def _slopes(results: "Results", column: "Column") -> list[Block]:
    found = local_slopes(results, column.name)
    units = {p.name: p.unit for p in results.study.parameters}
    rows = []
    for slope in found:
        unit = _slope_unit(column.unit, units[slope.parameter])
        rows.append([slope.parameter, f"{slope.slope:.6g}", f"{slope.uncertainty:.2g}", unit, f"{slope.swing:.6g}"])
    heads = ["Parameter", "Slope", "±", "Unit", f"Swing over the range ({column.unit})"]
    note = "± holds the curvature beyond the outer levels and the solver's error; a slope within it is none."
    return [
        Table(f"Slopes of {column.label} at the nominal design", heads, rows, note, True),
        figures.tornado_figure(found, column),
    ]


def _shares(results: "Results", column: "Column") -> list[Block]:
    found = linear_shares(results, column.name)
    if found is None:
        return []
    units = {p.name: p.unit for p in results.study.parameters}
    rows = [
        [name, f"{slope:.6g}", f"{half:.2g}", _slope_unit(column.unit, units[name]), _percent(share)]
        for name, slope, half, share in zip(found.parameters, found.slope, found.half_width, found.share, strict=True)
    ]
    note = f"A linear law explains {_percent(found.r_squared)} of the variance; ± is half a 95 % interval, a slope within it is none."
    return [
        Table(
            f"Linear influence on {column.label}",
            ["Parameter", "Slope", "±", "Unit", "Share of the variance"],
            rows,
            note,
            True,
        )
    ]


def _slope_unit(column: str, parameter: str) -> str:
    return column if parameter == "1" else f"{column} per {parameter}"


def _tolerances(results: "Results") -> list[Chapter]:
    study = results.study
    if not study.requirements or not len(results):
        return []
    try:
        rows = []
        for requirement in study.requirements:
            limits = resolve_limits(results, requirement)
            rows.append([limits.column, _g(limits.low), _g(limits.high), *_yield_cells(results, (requirement,))])
        rows.append(["all together", "", "", *_yield_cells(results, study.requirements)])
        reach = find_reach(results, study.requirements)
    except InputError as error:
        return [Chapter("Tolerances", [Text(str(error), "warning")])]
    note = "A design without a value counts as failing for the lower end of the interval and as passing for the upper."
    heads = ["Requirement", "From", "To", "Designs that meet it", "95 % interval", "Without a value"]
    if reach.part is None:
        words = "No sampled design fails: the tolerances may be wider than the ranges that were asked for."
    else:
        words = (
            f"The largest box about the nominal design without a failing one reaches {100 * reach.part:.3g} % of every range"
            f" ({reach.inside} designs inside): "
            + ", ".join(_reach(p, reach.part) for p in study.parameters if not isinstance(p.nominal, str))
            + ". It rests on the sampled designs alone; a worst-case search tests it."
        )
    return [Chapter("Tolerances", [Table("Yield", heads, rows, note), Text(words, "note")])]


def _yield_cells(results: "Results", requirements: Any) -> list[str]:
    found = find_yield(results, requirements)
    between = "" if found.low is None else f"{_percent(found.low)} … {_percent(found.high)}"
    return [_percent(found.share), between, str(found.unknown)]


def _reach(parameter: "Parameter", part: float) -> str:
    nominal = float(parameter.nominal)
    low, high = (nominal + part * (end - nominal) for end in (parameter.low, parameter.high))
    return f"{figures.label(parameter.name, parameter.unit)} {low:.8g} … {high:.8g}"


def _searches(results: "Results") -> list[Chapter]:
    findings = results.store.findings()
    blocks: list[Block] = []
    for search in results.study.searches:
        found = findings.get(name_search(search))
        if found is None:
            blocks.append(
                Text(f"The search for {name_search(search)} has not been made yet: run the study again.", "warning")
            )
        elif "failed" in found:
            blocks.append(Text(f"The search for {name_search(search)} failed: {found['failed']}", "warning"))
        else:
            blocks += _worst_case(results, found) if search.kind == "worst-case" else _inversion(results, found)
    return [Chapter("Searches", blocks)] if blocks else []


def _worst_case(results: "Results", found: Mapping[str, Any]) -> list[Block]:
    names = results.study.names
    rows = [
        [end, _g(found[end]["value"]), *(_g(found[end]["parameters"][name]) for name in names)]
        for end in ("least", "greatest")
    ]
    heads = ["", found["column"], *(figures.label(p.name, p.unit) for p in results.study.parameters)]
    note = "From the worst corner of the box, a bounded quasi-Newton search; text parameters stay nominal."
    return [Table(f"Worst cases of {found['column']} over the box", heads, rows, note)]


def _inversion(results: "Results", found: Mapping[str, Any]) -> list[Block]:
    rows = [[column, _g(wanted), _g(found["values"][column])] for column, wanted in found["targets"].items()]
    design = ", ".join(f"{name} = {_g(value)}" for name, value in found["parameters"].items())
    if found["reached"]:
        words, kind = f"The targets are met with {design}.", "note"
    else:
        limits = f" It lies on the limits of {', '.join(found['at_limit'])}." if found["at_limit"] else ""
        words, kind = f"No design in the ranges meets the targets; the nearest has {design}.{limits}", "warning"
    if found["condition"] and found["condition"] > 1e3:
        words += f" The targets hardly tell the parameters apart (condition {found['condition']:.1e})."
    return [Table("Design by inversion", ["Column", "Wanted", "Found"], rows), Text(words, kind)]


def _over_temperature(results: "Results") -> list[Block]:
    """Return the HRG paper's Table 1, its cubic and Table 2 where only the temperature was varied."""
    from studies.papers.hrg import study_table
    from studies.reports import frequency

    study = results.study
    columns = [column for column in study.columns if column.stem.startswith("frequency")]
    if study.names != (TEMPERATURE,) or not columns or len(results) < 5 or results.failed.size:
        return []
    T, f = results.parameter(TEMPERATURE).astype(float), results.column(columns[0].name)
    try:
        fit = study_table(T, f)
        tables: list[Block] = [frequency.coefficients_table(fit), frequency.inverse_table(fit)]
        return [*tables, frequency.fit_figure(fit), frequency.order_table(fit)]
    except UNUSABLE_INPUT as error:
        return [Text(f"No cubic over temperature: {error}", "warning")]


def _shapes(results: "Results") -> list[Chapter]:
    from studies.reports.mode_picture import mode_blocks

    study = results.study
    modal = [one for one in study.asked if "harmonic" in one.options]
    if not modal:
        return []
    n, column = modal[0].options["harmonic"], modal[0].columns[0]
    designs = {"Nominal design": nominal_design(study)}
    y = results.column(column.name)
    if np.isfinite(y).any() and any(name.startswith("resonator.") for name in study.names):
        designs[f"Least {column.label}"] = results.design(int(np.nanargmin(y)))
        designs[f"Greatest {column.label}"] = results.design(int(np.nanargmax(y)))
    blocks: list[Block] = []
    for title, design in designs.items():
        words = ", ".join(f"{name} = {_g(value)}" for name, value in design.items())
        blocks.append(Text(f"{title}: {words or 'the card'}."))
        blocks += mode_blocks(set_parameters(study.instrument, design), (n,))
    return [Chapter("Mode shapes", blocks)]


def _provenance(results: "Results") -> list[Block]:
    about, identity = results.about, results.about["identity"]
    rows = [
        [run["started_utc"], run["finished_utc"] or "", run["outcome"] or "killed", *_environment(run["provenance"])]
        for run in results.store.runs()
    ]
    facts = [
        ["study made", about["created_utc"]],
        ["physics version", identity["physics_version"]],
        ["hash of card, material, quantities and physics", identity["base"]],
        ["hash of the designs", identity["design"]],
        ["seed", str(results.study.sampling.seed)],
        ["card", results.study.instrument.path],
        *([f"user function {name}", source] for name, source in identity["functions"].items()),
    ]
    heads = ["Started", "Ended", "Outcome", "Commit", "Versions", "Lock file", "Machine"]
    blocks: list[Block] = [Table("Identity", ["What", "Value"], facts), Table("Runs", heads, rows)]
    return [*blocks, Text(about["spec_text"], "source")] if about["spec_text"] else blocks


def _environment(found: Mapping[str, Any]) -> list[str]:
    versions = ", ".join(f"{name} {text}" for name, text in found["packages"].items())
    return [
        found.get("commit", "none"),
        f"Python {found['python']}, {versions}",
        found.get("lock_sha256", "none")[:12],
        found["platform"],
    ]


def _main(results: "Results") -> "list[Column]":
    """Return the first column of every quantity: those that are drawn."""
    return [asked.columns[0] for asked in results.study.asked]


def _limits(results: "Results") -> list[Any]:
    try:
        return [resolve_limits(results, requirement) for requirement in results.study.requirements]
    except InputError:
        return []


def _range(parameter: "Parameter") -> str:
    if parameter.values:
        words = ", ".join(_g(value) for value in parameter.values[:8])
        return words + (f", … ({len(parameter.values)})" if len(parameter.values) > 8 else "")
    return f"{_g(parameter.low)} … {_g(parameter.high)}"


def _distribution(parameter: "Parameter") -> str:
    if parameter.values:
        return "values"
    if parameter.distribution == "normal":
        return f"normal, standard deviation {_g(parameter.standard_deviation)}" + (
            "" if parameter.bounded else ", no ends"
        )
    return parameter.distribution + (f", {parameter.count} points" if parameter.count else "")


def _g(value: Any) -> str:
    if isinstance(value, str):
        return value
    return "" if value is None or np.isnan(value) else f"{value:.8g}"


def _short_g(value: float | None) -> str:
    return "" if value is None or np.isnan(value) else f"{value:.6g}"


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.2f} %"
