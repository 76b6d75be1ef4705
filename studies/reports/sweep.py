"""The page of a parametric study: what was asked, what came out, what matters, and where it comes from."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.errors import UNUSABLE_INPUT, InputError
from studies.papers.hrg import study_table
from studies.reports import frequency, scenes
from studies.reports import sweep_analysis as analysis
from studies.reports import sweep_figures as figures
from studies.results import Blocks, Chapter, Column, Facts, Figure, Part, Result, Sentence, Table
from studies.sweeps.definition import StudyParameter
from studies.sweeps.design import nominal_design
from studies.sweeps.keys import DRAWN
from studies.sweeps.parameters import TEMPERATURE, set_parameters
from studies.sweeps.results import Results
from studies.sweeps.tolerance import resolve_limits

MOST_ROWS = 300
TOGETHER = 65_536  # designs looked at together for those
ENDS = 20  # designs shown from each end when there are more than MOST_ROWS
METHODS = {
    "grid": "all combinations of the values",
    "list": "the combinations listed in the spec",
    "latin-hypercube": "a Latin hypercube",
    "sobol": "a scrambled Sobol sequence",
    "sensitivity": "the Saltelli design for Sobol indices",
    "one-at-a-time": "one parameter at a time about the nominal design",
}
RUNS = (
    "Run | started_utc: Started | finished_utc: Ended",
    Column(lambda run: run["outcome"] or "killed", "Outcome"),
    Column(lambda run: run["provenance"].get("commit", "none")[:12], "Commit"),
    Column(lambda run: run["provenance"].get("lock_sha256", "none")[:12], "Lock file"),
)


def study_result(results: Results) -> Result:
    """Return what a study found: its numbers (schema hrg.study-report/1) and the parts of its page."""
    study = results.study
    done = len(results) if results.done == results.total else f"{results.done} of {results.total}"
    lead = f"{done} designs ({METHODS[study.sampling.method]}) based on the card {study.instrument.name}."
    if study.note:
        lead = f"{study.note} {lead}"
    shown = [analysis.statistics_table(results), *_over_temperature(results), *_pictures(results), _designs(results)]
    return Result(
        analysis.summarise(results),
        f"Study: {study.name}",
        lead,
        [
            Chapter("Summary", _short(results)),
            Chapter("Definition", _asked(results)),
            Chapter("Failed cases", _failures(results)),
            Chapter("Results", shown),
            Chapter("Influence of the parameters", analysis.influence_parts(results)),
            Chapter("Tolerances", analysis.tolerance_parts(results)),
            Chapter("Searches", analysis.search_parts(results, "worst-case")),
            Chapter("Mode shapes", _shapes(results)),
            Chapter("Provenance", _provenance(results)),
        ],
    )


def _short(results: Results) -> list[Part]:
    facts = [("Designs", str(results.done), f"of {results.total}; {len(results.failed)} failed")]
    for column in analysis.main_columns(results)[:2]:
        n = results.numbers[column.name]
        unit = "" if column.unit == "1" else f" {column.unit}"
        least, greatest, nominal = (
            analysis.to_digits(n[key], n["deviation"] / 3) for key in ("least", "greatest", "nominal")
        )
        facts.append((column.label, f"{least} … {greatest}{unit}", f"nominal {nominal}{unit}"))
    found = analysis.yield_of(results)
    if found is not None:
        low, high = found.low, found.high
        words = "of the designs" if low is None or high is None else f"90 % interval {_percent(low)} … {_percent(high)}"
        facts.append(("Meet all requirements", _percent(found.share), words))
    unfinished = "The study is not finished. Run it again to resume, then write this page again."
    return [Facts(facts), Sentence(unfinished, "warning") if results.done < results.total else None]


def _percent(share: float) -> str:
    return f"{100 * share:.2f} %"


def _asked(results: Results) -> list[Part]:
    study, sampling = results.study, results.study.sampling
    parameters = (
        Column(lambda p: figures.label(p.name, p.unit), "Parameter"),
        "nominal: Nominal .8g",
        Column(_range, "Range"),
        Column(_distribution, "Distribution"),
    )
    quantities = (
        "columns.0.name: Column | __doc__: Quantity",
        Column(lambda one: ", ".join(f"{k} = {v}" for k, v in one.options.items() if v is not None), "Options"),
    )
    words = f"Sampling: {METHODS[sampling.method]}"
    words += f", seed {sampling.seed}" if sampling.method in DRAWN else ""
    full = results.about["identity"]["solver"] == "full"
    family = "interpolated between full solves, with a stated interpolation error"
    solver = "every design solved in full" if full else family
    return [
        Table("Parameters", study.parameters, parameters),
        Table("Quantities", study.asked, quantities),
        f"{words}; {solver}.",
    ]


def _failures(results: Results) -> list[Part]:
    if not results.failed.size:
        return []
    places = results.failed[:MOST_ROWS].tolist()
    columns = (*_design_columns(results, places), Column(results.remark, "Reason"))
    return [
        Sentence("These designs have no result and are excluded from all figures on this page.", "warning"),
        Table("Reasons", results.store.reasons(), "1: Cases | 0: Reason"),
        Table("Failed designs", places, columns, sortable=True),
    ]


def _design_columns(results: Results, places: Sequence[int]) -> list[Column]:
    return [
        Column(_at(results.parameter(p.name), places), figures.label(p.name, p.unit), form=".8g")
        for p in results.study.parameters
    ]


def _at(values: NDArray[Any], places: Sequence[int]) -> Callable[[int], Any]:
    """Return what shows the value of a design, whose place is the row; the other designs are not kept."""
    return {place: values[place] for place in places}.__getitem__


def _designs(results: Results) -> Table:
    columns = analysis.main_columns(results)
    places: Sequence[int] = range(len(results))
    note = "Click a heading to sort."
    if len(places) > MOST_ROWS:
        places = _find_ends(results.column(columns[0].name))
        note += f" Of {len(results)} designs, the {ENDS} with the lowest and the {ENDS} with the highest {columns[0].label} are shown; hrg study export writes all."
    shown = [Column(_at(results.column(c.name), places), figures.column_label(c), form=".8g") for c in columns]
    case = Column(lambda place: place, "Case")
    return Table("Designs", places, (case, *_design_columns(results, places), *shown), note, sortable=True)


def _find_ends(y: Array) -> list[int]:
    """Return the places of the lowest and the highest values, in their order; no index of all is made."""
    kept = np.empty(0, dtype=np.intp)
    for first in range(0, len(y), TOGETHER):
        places = np.append(kept, first + np.flatnonzero(np.isfinite(y[first : first + TOGETHER])))
        order = places[np.argsort(y[places], kind="stable")]
        kept = order if len(order) <= 2 * ENDS else np.append(order[:ENDS], order[-ENDS:])
    return [int(place) for place in kept]


def _pictures(results: Results) -> list[Part]:
    if results.study.sampling.method == "one-at-a-time":
        return []  # the tornado says it better
    try:
        limits = [(one.column, resolve_limits(results, one)) for one in results.study.requirements]
    except InputError:
        limits = []
    parts: list[Part] = []
    for column in analysis.main_columns(results):
        n, count = results.numbers[column.name], int(np.isfinite(results.column(column.name)).sum())
        if count >= 20 and n["greatest"] > n["least"]:
            words, alt = f"Distribution of {column.label} over {count} designs.", f"Histogram of {column.label}."
            ends = [end for name, pair in limits if name == column.name for end in pair]
            parts.append(Figure(partial(figures.draw_spread, results, column, ends), words, alt))
        parts += figures.response_figures(results, column)
    return parts


def _over_temperature(results: Results) -> list[Part]:
    """Return the HRG paper's Table 1, its cubic and Table 2 where only the temperature was varied."""
    study = results.study
    columns = [column for column in study.columns if column.stem.startswith("frequency")]
    if study.names != (TEMPERATURE,) or not columns or len(results) < 5 or results.failed.size:
        return []
    T, f = results.parameter(TEMPERATURE).astype(float), results.column(columns[0].name)
    try:
        fit = study_table(T, f)
        tables = frequency.coefficients_table(fit), frequency.inverse_table(fit)
        return [*tables, frequency.fit_figure(fit), frequency.order_table(fit)]
    except UNUSABLE_INPUT as error:
        return [Sentence(f"No cubic over temperature: {error}", "warning")]


def _shapes(results: Results) -> list[Part]:
    study = results.study
    modal = [one for one in study.asked if "harmonic" in one.options]
    if not modal:
        return []
    n, theory, column = modal[0].options["harmonic"], modal[0].options["theory"], modal[0].columns[0]
    designs = {"Nominal design": nominal_design(study)}
    y = results.column(column.name)
    names = [name for name in study.names if name.startswith("resonator.")]
    if names and np.isfinite(y).any():
        designs[f"Minimum {column.label}"] = results.design(int(np.nanargmin(y)))
        designs[f"Maximum {column.label}"] = results.design(int(np.nanargmax(y)))
    units = {parameter.name: parameter.unit for parameter in study.parameters}
    parts: list[Part] = []
    for title, design in designs.items():
        words = ", ".join(
            f"{figures.label(name, units[name])} = {analysis.number(value)}" for name, value in design.items()
        )
        instrument = set_parameters(study.instrument, design, study.derived)
        parts.append(f"{title}: {words or 'as in the card'}.")
        if len(parts) > 1 or theory == "rayleigh":
            parts.append(Blocks(lambda shown=instrument: scenes.mode_blocks(shown, (n,))))  # type: ignore[misc]
            continue
        parts.append(Blocks(lambda shown=instrument: scenes.moving_mode(shown, n, theory, names, study.derived)))  # type: ignore[misc]
    return parts


def _provenance(results: Results) -> list[Part]:
    about, identity = results.about, results.about["identity"]
    runs = [{**run, "run": count} for count, run in enumerate(results.store.runs, 1)]
    environments: dict[str, list[str]] = {}
    for run in runs:
        of = run["provenance"]
        versions = ", ".join(f"{name} {text}" for name, text in of["packages"].items())
        environments.setdefault(f"Python {of['python']}, {versions}; {of['platform']}", []).append(str(run["run"]))
    facts = {
        "study created": about["created_utc"],
        "physics version": identity["physics_version"],
        "hash of card, material, quantities and physics": identity["base"],
        "hash of the designs": identity["design"],
        "seed": str(results.study.sampling.seed),
        "card": results.study.instrument.path,
        **{f"user function {name}": source for name, source in identity["functions"].items()},
    }
    return [
        Table("Identity", list(facts.items()), "0: Item | 1: Value"),
        Table("Runs", runs, RUNS),
        *(f"Run {', '.join(counts)}: {words}." for words, counts in environments.items()),
        Sentence(about["spec_text"], "source") if about["spec_text"] else None,
    ]


def _range(parameter: StudyParameter) -> str:
    if parameter.values:
        words = ", ".join(analysis.number(value) for value in parameter.values[:8])
        return words + (f", … ({len(parameter.values)})" if len(parameter.values) > 8 else "")
    drawn_beyond = parameter.distribution == "normal" and not parameter.bounded
    return f"{analysis.number(parameter.low)} … {analysis.number(parameter.high)}" + " (± 3 sd)" * drawn_beyond


def _distribution(parameter: StudyParameter) -> str:
    if parameter.values:
        return "values"
    if parameter.distribution == "normal":
        ends = (
            f"cut off at the ends of the range: {parameter.drawn_deviation:.4g} drawn"
            if parameter.bounded
            else "unbounded"
        )
        return f"normal, standard deviation {analysis.number(parameter.standard_deviation)}, {ends}"
    return parameter.distribution + (f", {parameter.count} points" if parameter.count else "")
