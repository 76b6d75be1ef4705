"""`hrg study`: run, status, report and export of parametric studies."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from studies.cli.arguments import COUNT, Folder, Quiet, Workers
from studies.cli.output import answers, check_ending, resumable, say
from studies.errors import InputError
from studies.files.writing import write_text
from studies.reports.sweep_analysis import tolerance_table
from studies.results import Result, Table, row_of
from studies.sweeps.export import UNITS, export_results
from studies.sweeps.opening import is_running
from studies.sweeps.results import Results, open_results
from studies.sweeps.run import Effort, check_functions, estimate_study, run_study
from studies.sweeps.spec import read_study
from studies.sweeps.validity import find_invalid

SOLVERS = {"full": "each solved in full", "family": "interpolated between full solves"}
STATUS = ("state", "cases", "done", "failed", "seconds_each", "runs")


@answers("hrg.study-status/1, with --dry-run hrg.study-estimate/1")
def run(
    spec: str,
    *,
    out: str | None = None,
    workers: Workers = None,
    scheduler: str | None = None,
    card: str | None = None,
    allow_python: bool = False,
    retry_failed: bool = False,
    dry_run: bool = False,
    quiet: Quiet = False,
) -> Result:
    """Run or resume a parametric study. Finished cases are kept and never computed again.

    Exit status 4: the study is finished but some cases failed; the results give the reasons.

    Args:
        spec: Path of a spec, or the name of a built-in one: frequency-over-temperature, dimension-tolerance,
            dimension-influence, split-tolerance. A spec is a TOML file. At its top: schema = "hrg.study/1", name, card
            (a built-in one, or a path relative to the spec). [sampling]: method = grid, list, latin-hypercube, sobol,
            sensitivity or one-at-a-time; cases, seed, batch, solver. [[parameter]]: name (a key of the card such as
            resonator.thickness_mm, or temperature_degC, or user.NAME for your own function) with tolerance, or low and
            high, or values; nominal, count, distribution = uniform, normal (with standard_deviation), triangular or
            log-uniform. [[quantity]]: name = bryan-factor, compensation-residual, frequency, loads, loop-drift, loss,
            mass, mode-separation, python, q, split, split-per-wave, tcf or thermal-time-constants, with harmonic,
            index, theory, temperature_degC, label and its own keys. [[requirement]]: column with within (of target), or
            low, high. [[search]]: kind = worst-case with column, or tolerance with share (the
            tolerances with which that share of designs meets the requirements); hrg optimise finds designs with wanted
            values. Example: hrg study new spec.toml.
        out: Folder for the results; required except with --dry-run. Run again with the same folder to resume.
        scheduler: Address of a Dask scheduler (tcp://HOST:8786) whose workers compute the study. Use only one that you
            trust: the scheduler and its workers can run code on this machine. A public address needs tls:// and
            certificates in Dask's configuration.
        card: Card to use instead of the one in the spec.
        allow_python: Allow the Python functions named in the spec to run. Read them first.
        retry_failed: Compute failed cases again; cases whose worker was lost are always repeated.
        dry_run: Estimate the number of cases, time and memory; save nothing.
    """
    if workers is not None and scheduler is not None:
        raise InputError("--workers and --scheduler cannot be combined: give one of them.")
    if out is None and not dry_run:
        raise InputError("--out is missing: name the folder for the study.")
    study = read_study(spec, card)
    if dry_run:
        check_functions(study, allow_python)
    for problem in find_invalid(study):
        say(f"note: {problem} Such designs fail; the others are computed.")
    if out is None or dry_run:
        estimate = estimate_study(study, workers)
        payload = {"schema": "hrg.study-estimate/1", **vars(estimate)}
        fails = f"The nominal design fails: {estimate.nominal_fails}" if estimate.nominal_fails else None
        return Result(payload, f"Estimate of {study.name}", "", [_estimate_words(estimate), fails])
    with resumable(out, "cases"):
        results = run_study(
            spec, out, card=card, workers=workers, scheduler=scheduler, allow_python=allow_python,
            retry_failed=retry_failed, show_progress=not quiet,
        )  # fmt: skip
    found = _status(results, out, running=False)
    failed = found["failed"]
    done = f"{results.total} cases computed, {failed} failed. Next: hrg study report {out}, hrg study export {out}."
    searches = [one for one in results.store.findings.values() if one.get("kind") == "tolerance"]
    tolerances = [
        f"No tolerances were found: {one['failed']}" if "failed" in one else tolerance_table(results, one)
        for one in searches
    ]
    parts, title = [done, _reasons(results), *tolerances], f"Study {study.name}"
    return Result(found, title, "What was computed.", parts, 4 if failed else 0, page=lambda: _found(results))


@answers("hrg.study-status/1")
def status(folder: Folder) -> Result:
    """Show the progress of a study and the failed cases with their reasons, also while it runs."""
    results = open_results(folder)
    found = _status(results, folder, is_running(folder))
    if found["state"] == "unfinished":
        _say_unfinished(results, folder)
    rows = [(key.replace("_", " "), found[key]) for key in STATUS]
    table = Table(results.study.name, rows, "0: item | 1: value .3", results.study.note)
    return Result(found, f"Study {results.study.name}", "Its progress.", [table, _reasons(results)])


@answers("hrg.study-report/1", page=False)
def report(folder: Folder, *, report: Annotated[str | None, Parameter(name=("--report", "--out"))] = None) -> Result:
    """Write a self-contained HTML page: definition, results, figures, sensitivities, yield and provenance.

    Args:
        report: The page; default: report.html in the folder.
    """
    from studies.results.page import render_result

    results, page = open_results(folder), str(report or Path(folder) / "report.html")
    check_ending("--report", page, "a report is an HTML page", ".html", ".htm")
    found = _found(results)
    write_text(page, render_result(found))
    _say_unfinished(results, folder)
    told = f"report on {_done(results)} cases: {page}\n"
    return replace(found, payload={**found.payload, "report": page}, printed=told)


@answers("hrg.study-export/1", page=False, out=(UNITS,))
def export(folder: Folder, *, out: str | None = None, part_rows: Annotated[int, COUNT] = 1_000_000) -> Result:
    """Write the results as CSV or Parquet, and the unit of every column to a JSON file.

    Args:
        out: A .csv or .parquet file, or without an ending a folder of Parquet files; default: results.csv in the
            folder.
        part_rows: Designs in each file of a data set.
    """
    results = open_results(folder)
    if out is not None and Path(out).suffix:
        check_ending("--out", out, "an export is a CSV or Parquet file, or a folder", ".csv", ".parquet")
    path = Path(out) if out else Path(folder) / "results.csv"
    if path.resolve() == Path(folder).resolve():
        raise InputError(f"--out {out}: this is the folder of the study; name another one, such as {path / 'table'}.")
    units = export_results(results, path, part_rows)
    payload = {"table": str(path), "units_file": str(units), "rows": len(results)}
    payload |= row_of(results, "done", cases="total", columns="units")
    _say_unfinished(results, folder)
    return Result(payload, "Export", "", [f"{_done(results)} cases: {path}; units: {units}"])


def _found(results: Results) -> Result:
    from studies.reports.sweep import study_result

    say("writing the page, with mode shapes if the study has modes ...")
    return study_result(results)


def _done(results: Results) -> str:
    return str(len(results)) if results.done == results.total else f"{results.done} of {results.total}"


def _say_unfinished(results: Results, folder: str) -> None:
    if results.done < results.total:
        if not is_running(folder) and results.store.runs and results.store.runs[-1]["outcome"] is None:
            say(f"warning: the end of the last run is missing in {results.store.path}: it was killed, or the file was truncated.")  # fmt: skip
        counts = f"{results.done} of {results.total} cases are done"
        say(f"note: the study is not finished: {counts}. Run it again to resume.")


def _status(results: Results, folder: str, running: bool) -> dict[str, Any]:
    counts = results.store.counts()
    done = sum(counts.values())
    finished = done == results.total
    return {
        "schema": "hrg.study-status/1",
        "study": results.study.name,
        "folder": folder,
        "state": "running" if running else "finished" if finished else "unfinished",
        "cases": results.total,
        "done": done,
        "failed": done - counts.get("ok", 0),
        "lost": counts.get("lost", 0),
        "reasons": [{"reason": reason, "cases": count} for reason, count in results.store.reasons()],
        "seconds_each": results.store.seconds / done if done else None,
        "runs": len(results.store.runs),
    }


def _reasons(results: Results) -> Table:
    return Table("Failed cases", results.store.reasons(8), "1: cases | 0: reason")


def _estimate_words(estimate: Effort) -> str:
    why = f" ({estimate.why_full})" if estimate.why_full else ""
    return (
        f"{estimate.cases} cases in {estimate.batches} batch{'es' * (estimate.batches != 1)}, {SOLVERS[estimate.solver]}{why};"
        f" {estimate.seconds_each:.3g} s per case, about {_duration(estimate.seconds)} in total; memory about {estimate.memory_MB:.0f} MB. Nothing was saved."
    )


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.3g} s"
    return f"{seconds / 60:.3g} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"
