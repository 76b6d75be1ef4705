"""The page of a parametric study: what was asked, what came out, what matters, and where it comes from."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studies.errors import UNUSABLE_INPUT, InputError
from studies.papers.hrg import study_table
from studies.reports import frequency
from studies.reports import sweep_figures as figures
from studies.reports.digits import plain
from studies.reports.page import Block, Chapter, Facts, Table, Text, render_page
from studies.reports.sweep_analysis import influence_chapters, search_chapters, tolerance_chapters
from studies.reports.sweep_cells import main_columns, number, percent, spread, to_error, within
from studies.results.page import make_blocks
from studies.sweeps.definition import StudyParameter
from studies.sweeps.design import nominal_design
from studies.sweeps.parameters import TEMPERATURE, set_parameters
from studies.sweeps.quantity import Column
from studies.sweeps.results import Results
from studies.sweeps.sensitivity import linear_shares, local_slopes, sobol_indices
from studies.sweeps.tolerance import Yield, find_yield, resolve_limits

MOST_ROWS = 300
ENDS = 20  # designs shown from each end when there are more than MOST_ROWS
METHODS = {
    "grid": "all combinations of the values",
    "list": "the combinations listed in the spec",
    "latin-hypercube": "a Latin hypercube",
    "sobol": "a scrambled Sobol sequence",
    "sensitivity": "the Saltelli design for Sobol indices",
    "one-at-a-time": "one parameter at a time about the nominal design",
}


def sweep_page(results: Results) -> str:
    """Return the page of a study as HTML."""
    study = results.study
    done = len(results) if results.done == results.total else f"{results.done} of {results.total}"
    lead = f"{done} designs ({METHODS[study.sampling.method]}) based on the card {study.instrument.name}."
    if study.note:
        lead = f"{study.note} {lead}"
    chapters = [
        Chapter("In short", _short(results)),
        Chapter("Definition", _asked(results)),
        *_failures(results),
        Chapter("Results", [_statistics(results), *_over_temperature(results), *_pictures(results), _designs(results)]),
        *influence_chapters(results),
        *tolerance_chapters(results),
        *search_chapters(results),
        *_shapes(results),
        Chapter("Provenance", _provenance(results)),
    ]
    return render_page(f"Study: {study.name}", lead, chapters)


def summarise(results: Results) -> dict[str, Any]:
    """Return the numbers behind the page (schema hrg.study-report/1)."""
    found: dict[str, Any] = {
        "schema": "hrg.study-report/1",
        "study": results.study.name,
        "cases": len(results),
        "done": results.done,
        "total": results.total,
        "failed": len(results.failed),
        "columns": {c.name: {"unit": c.unit, **_numbers(results, c)} for c in results.study.columns},
        "searches": results.store.findings(),
    }
    for key, analyse in (("sobol", sobol_indices), ("slopes", local_slopes), ("linear", linear_shares)):
        found[key] = {c.name: _data(analyse, results, c.name) for c in results.study.columns}
    whole = _yield(results)
    if whole is not None:
        found["yield"] = {k: v for k, v in vars(whole).items() if k != "limits"} | {"share": whole.share}
    return found


def _data(analyse: Any, results: Results, column: str) -> Any:
    try:
        found = analyse(results, column)
    except InputError:
        return None
    return [vars(one) for one in found] if isinstance(found, list) else None if found is None else vars(found)


def _numbers(results: Results, column: Column) -> dict[str, float | None]:
    y = results.column(column.name)
    y = y[np.isfinite(y)]
    place = [c.name for c in results.study.columns].index(column.name)
    nominal = results.nominal.values[place] if results.nominal is not None else np.nan
    errors = results.error(column.name)
    error = float(np.nanmax(errors)) if np.isfinite(errors).any() else np.nan
    numbers: dict[str, Any] = {"mean": np.mean, "deviation": np.std, "least": np.min, "greatest": np.max}
    over_all = {name: float(function(y)) if y.size else np.nan for name, function in numbers.items()}
    return {"nominal": nominal, **over_all, "error": error}


def _yield(results: Results) -> Yield | None:
    """Return the yield under all requirements; None without any, and where the nominal design that they need is missing."""
    if not results.study.requirements or not len(results):
        return None
    try:
        return find_yield(results, results.study.requirements)
    except InputError:  # the chapter on tolerances says why
        return None


def _short(results: Results) -> list[Block]:
    facts = [("Designs", str(results.done), f"of {results.total}; {len(results.failed)} failed")]
    for column in main_columns(results)[:2]:
        n = _numbers(results, column)
        unit = "" if column.unit == "1" else f" {column.unit}"
        least, greatest, nominal = (within(n[key], n["deviation"]) for key in ("least", "greatest", "nominal"))
        facts.append((column.label, f"{least} … {greatest}{unit}", f"nominal {nominal}{unit}"))
    found = _yield(results)
    if found is not None:
        words = "of the designs" if found.low is None else f"95 % interval {percent(found.low)} … {percent(found.high)}"
        facts.append(("Meet all requirements", percent(found.share), words))
    blocks: list[Block] = [Facts(facts)]
    if results.done < results.total:
        blocks.append(Text("The study is not finished. Run it again to resume, then write this page again.", "warning"))
    return blocks


def _asked(results: Results) -> list[Block]:
    study = results.study
    sampling = study.sampling
    parameters = Table(
        "Parameters",
        ["Parameter", "Nominal", "Range", "Distribution"],
        [[figures.label(p.name, p.unit), number(p.nominal), _range(p), _distribution(p)] for p in study.parameters],
    )
    rows = [
        [
            c.name,
            one.__doc__ or "",
            ", ".join(f"{key} = {value}" for key, value in one.options.items() if value is not None),
        ]
        for one in study.asked
        for c in one.columns[:1]
    ]
    words = f"Sampling: {METHODS[sampling.method]}"
    words += f", seed {sampling.seed}" if sampling.method in ("latin-hypercube", "sobol", "sensitivity") else ""
    full = results.about["identity"]["solver"] == "full"
    solver = (
        "every design solved in full" if full else "interpolated between full solves, with a stated interpolation error"
    )
    return [parameters, Table("Quantities", ["Column", "Quantity", "Options"], rows), Text(f"{words}; {solver}.")]


def _failures(results: Results) -> list[Chapter]:
    if not results.failed.size:
        return []
    rows = [[str(count), reason] for reason, count in results.store.reasons()]
    examples = [
        [*map(number, results.design(place).values()), results.remark(place)]
        for place in results.failed[:MOST_ROWS].tolist()
    ]
    words = "These designs have no result and are excluded from all figures on this page."
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


def _statistics(results: Results) -> Table:
    rows = []
    for column in results.study.columns:
        n = _numbers(results, column)
        rows.append(
            [
                column.label,
                column.unit,
                *(_digits(n, key) for key in ("nominal", "mean")),
                spread(n["deviation"], n["mean"]),
                *(_digits(n, key) for key in ("least", "greatest")),
            ]
        )
        rows[-1].append(plain(n["error"], 2) if n["error"] is not None and np.isfinite(n["error"]) else "")
    heads = ["Quantity", "Unit", "Nominal", "Mean", "Standard deviation", "Minimum", "Maximum", "Numerical error"]
    note = "The numerical error is the largest error estimate of the solver over all designs, relative to the exact solution of its theory."
    return Table("All designs with a result", heads, rows, note)


def _digits(n: Mapping[str, Any], key: str) -> str:
    known = n["error"] is not None and np.isfinite(n["error"])
    return to_error(n[key], n["error"]) if known else within(n[key], n["deviation"])


def _designs(results: Results) -> Table:
    columns = main_columns(results)
    places: Sequence[int] = range(len(results))
    note = "Click a heading to sort."
    if len(places) > MOST_ROWS:
        order = np.argsort(results.column(columns[0].name), kind="stable")
        order = order[np.isfinite(results.column(columns[0].name)[order])]
        places = [*order[:ENDS].tolist(), *order[-ENDS:].tolist()]
        note += f" Of {len(results)} designs, the {ENDS} with the lowest and the {ENDS} with the highest {columns[0].label} are shown; hrg study export writes all."
    rows = []
    for place in places:
        numbers = (results.column(column.name)[place] for column in columns)
        rows.append([str(place), *map(number, results.design(place).values()), *map(number, numbers)])
    heads = [figures.label(p.name, p.unit) for p in results.study.parameters]
    return Table("Designs", ["Case", *heads, *map(figures.column_label, columns)], rows, note, sortable=True)


def _pictures(results: Results) -> list[Block]:
    if results.study.sampling.method == "one-at-a-time":
        return []  # the tornado says it better
    limits = _limits(results)
    blocks: list[Block] = []
    for column in main_columns(results):
        y = results.column(column.name)
        if np.isfinite(y).sum() >= 20 and np.nanmax(y) > np.nanmin(y):
            blocks.append(figures.spread_figure(results, column, limits))
        response = figures.response_figure(results, column)
        blocks += [response] if response else []
    return blocks


def _over_temperature(results: Results) -> list[Block]:
    """Return the HRG paper's Table 1, its cubic and Table 2 where only the temperature was varied."""
    study = results.study
    columns = [column for column in study.columns if column.stem.startswith("frequency")]
    if study.names != (TEMPERATURE,) or not columns or len(results) < 5 or results.failed.size:
        return []
    T, f = results.parameter(TEMPERATURE).astype(float), results.column(columns[0].name)
    try:
        fit = study_table(T, f)
        tables = frequency.coefficients_table(fit), frequency.inverse_table(fit)
        return list(make_blocks(*tables, frequency.fit_figure(fit), frequency.order_table(fit)))
    except UNUSABLE_INPUT as error:
        return [Text(f"No cubic over temperature: {error}", "warning")]


def _shapes(results: Results) -> list[Chapter]:
    from studies.reports.mode_picture import mode_blocks

    study = results.study
    modal = [one for one in study.asked if "harmonic" in one.options]
    if not modal:
        return []
    n, column = modal[0].options["harmonic"], modal[0].columns[0]
    designs = {"Nominal design": nominal_design(study)}
    y = results.column(column.name)
    if np.isfinite(y).any() and any(name.startswith("resonator.") for name in study.names):
        designs[f"Minimum {column.label}"] = results.design(int(np.nanargmin(y)))
        designs[f"Maximum {column.label}"] = results.design(int(np.nanargmax(y)))
    blocks: list[Block] = []
    for title, design in designs.items():
        words = ", ".join(f"{name} = {number(value)}" for name, value in design.items())
        blocks.append(Text(f"{title}: {words or 'as in the card'}."))
        blocks += mode_blocks(set_parameters(study.instrument, design, study.derived), (n,))
    return [Chapter("Mode shapes", blocks)]


def _provenance(results: Results) -> list[Block]:
    about, identity = results.about, results.about["identity"]
    rows: list[list[str]] = []
    environments: dict[str, list[str]] = {}
    for count, run in enumerate(results.store.runs(), 1):
        commit, versions, lock, machine = _environment(run["provenance"])
        ended, outcome = run["finished_utc"] or "", run["outcome"] or "killed"
        rows.append([str(count), run["started_utc"], ended, outcome, commit[:12], lock])
        environments.setdefault(f"{versions}; {machine}", []).append(str(count))
    facts = [
        ["study created", about["created_utc"]],
        ["physics version", identity["physics_version"]],
        ["hash of card, material, quantities and physics", identity["base"]],
        ["hash of the designs", identity["design"]],
        ["seed", str(results.study.sampling.seed)],
        ["card", results.study.instrument.path],
        *([f"user function {name}", source] for name, source in identity["functions"].items()),
    ]
    heads = ["Run", "Started", "Ended", "Outcome", "Commit", "Lock file"]
    blocks: list[Block] = [Table("Identity", ["Item", "Value"], facts), Table("Runs", heads, rows)]
    blocks += [Text(f"Run {', '.join(runs)}: {versions}.") for versions, runs in environments.items()]
    return [*blocks, Text(about["spec_text"], "source")] if about["spec_text"] else blocks


def _environment(found: Mapping[str, Any]) -> list[str]:
    versions = ", ".join(f"{name} {text}" for name, text in found["packages"].items())
    return [
        found.get("commit", "none"),
        f"Python {found['python']}, {versions}",
        found.get("lock_sha256", "none")[:12],
        found["platform"],
    ]


def _limits(results: Results) -> list[Any]:
    try:
        return [resolve_limits(results, requirement) for requirement in results.study.requirements]
    except InputError:
        return []


def _range(parameter: StudyParameter) -> str:
    if parameter.values:
        words = ", ".join(number(value) for value in parameter.values[:8])
        return words + (f", … ({len(parameter.values)})" if len(parameter.values) > 8 else "")
    return f"{number(parameter.low)} … {number(parameter.high)}"


def _distribution(parameter: StudyParameter) -> str:
    if parameter.values:
        return "values"
    if parameter.distribution == "normal":
        return f"normal, standard deviation {number(parameter.standard_deviation)}" + (
            "" if parameter.bounded else ", unbounded"
        )
    return parameter.distribution + (f", {parameter.count} points" if parameter.count else "")
