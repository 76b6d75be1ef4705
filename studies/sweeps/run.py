"""Run a study from spec to store: check, resume, compute, search."""

import json
import resource
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError
from studies.instrument.card import Card
from studies.progress import Progress
from studies.sweeps.block import Batch
from studies.sweeps.child import check_function
from studies.sweeps.cluster import check_private
from studies.sweeps.definition import FREE, Study
from studies.sweeps.design import draw, hash_designs, nominal_row
from studies.sweeps.engine import BATCH, BATCH_VECTORISED, compute, hire, missing_batches
from studies.sweeps.evaluate import WorkPlan, evaluate_task
from studies.sweeps.families import Families, choose_solver, why_not
from studies.sweeps.opening import claim_store
from studies.sweeps.provenance import PHYSICS_VERSION, describe_environment, digest, spell, spell_material
from studies.sweeps.results import Results, open_results
from studies.sweeps.search import name_search, run_searches
from studies.sweeps.spec import read_study
from studies.sweeps.store import FILE, Store, memory_store
from studies.sweeps.workers import Here, Workers, cores

INSTRUMENT = ("name", "reference_temperature", "content", "path")  # what a store keeps of it
STORE_SECONDS = 3e-5  # for one case to be hashed, committed and counted


def run_study(
    source: str | Path | Mapping[str, Any], out: str | Path | None = None, *, card: Card | None = None,
    workers: int | None = None, scheduler: str | None = None, allow_python: bool = False, retry_failed: bool = False,
    show_progress: bool = False,
) -> Results:  # fmt: skip
    """Run a study (path, name or mapping), or resume it where an earlier run stopped, and return its results.

    >>> results = run_study("tolerance.toml", "tolerance")          # doctest: +SKIP
    >>> table = results.table()                                     # doctest: +SKIP

    Args:
        out: folder of the store; without it the results live in memory only.
        workers: processes here, one a core unless given; more than one need the guard `if __name__ == "__main__":`.
        scheduler: address of a Dask scheduler instead, whose workers can run code here (`studies.sweeps.cluster`).
        retry_failed: compute failed cases again; those whose worker was lost are always tried again.

    Raises:
        InputError: An unusable spec, another study's store, a damaged store, a second runner.
        MissingEnvironment: The disk is full or cannot be written, the scheduler cannot be reached or was lost.
    """
    if scheduler is not None:
        check_private(scheduler)
    study = read_study(source, card)
    sources = check_functions(study, allow_python)
    design = draw(study)
    fresh = out is None or not (Path(out) / FILE).exists()
    families = choose_solver(study, design) if fresh else None  # before a folder is made for what cannot be computed
    store = memory_store() if out is None else claim_store(out)
    try:
        _tell_other_versions(store)
        store.forget("lost", *(["failed"] if retry_failed else []))
        if fresh or not _is_finished(store, study, design, sources):
            if not fresh:
                families = choose_solver(study, design)
            describe_study(store, study, identify(study, design, sources, _describe_families(families)), design)
            if families and scheduler is not None:
                warnings.warn(f"{scheduler} is not used: the designs are interpolated in this process.", stacklevel=2)
            crew, plan = Here() if families else hire(workers, scheduler), WorkPlan.of(study, families)
            with running(store, crew):
                batches = missing_batches(study, design, store, families is not None)
                done = sum(store.counts().values())
                with Progress(len(design), done, show_progress) as progress:
                    compute(plan, batches, crew, store, progress)
                run_searches(study, plan, crew, store)
    except BaseException:
        store.close()
        raise
    if out is None:
        return Results(study, store)
    store.close()
    return open_results(out)


@dataclass(frozen=True)
class Effort:
    """What a study would take: seconds of one design and of all, memory in MB, how they are solved, `why_full` without interpolation.

    `nominal_fails` says why the nominal design fails, "" where it does not.
    """

    cases: int
    batches: int
    seconds_each: float
    seconds: float
    memory_MB: float
    solver: str
    why_full: str = ""
    nominal_fails: str = ""


def estimate_study(study: Study, workers: int | None = None) -> Effort:
    """Evaluate the nominal design here, keep nothing, and say what the whole study would take on these workers."""
    began = time.perf_counter()
    design = draw(study)
    families = choose_solver(study, design)
    plan = WorkPlan.of(study, families)
    if families is None:
        count, size, trials = workers or cores(), BATCH, 1
        evaluate_task(plan, [_nominal(study, 1)])  # the first time imports and builds what later cases share
    else:
        count, size, trials = 1, BATCH_VECTORISED, 1000
    training = time.perf_counter() - began if families else 0.0
    began = time.perf_counter()
    (tried,) = evaluate_task(plan, [_nominal(study, trials)])
    each = (time.perf_counter() - began) / trials + STORE_SECONDS
    cases = len(design)
    resident = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    processes = 1 if families else 1 + count
    row = 16 * (len(study.parameters) + len(study.columns))  # the designs, and what is read back
    return Effort(
        cases=cases, batches=-(-cases // (study.sampling.batch or size)), seconds_each=each,
        seconds=training + each * cases / count, memory_MB=resident * processes + row * cases / 1e6,
        solver="family" if families else "full", why_full="" if families else why_not(study),
        nominal_fails=next((remark.text for remark in tried.remarks if remark.status != "ok"), ""),
    )  # fmt: skip


def _nominal(study: Study, count: int) -> Batch:
    return Batch(np.full(count, -1), np.tile(nominal_row(study), (count, 1)))


def check_functions(study: Study, allowed: bool) -> dict[str, str]:
    """Return the hash of every user function's file; InputError when they are not enabled or cannot be imported."""
    if not study.functions:
        return {}
    if not allowed:
        raise InputError(f"the study runs Python code of its own ({', '.join(Path(f).name for f in study.functions)}); read it, and allow it with --allow-python.")  # fmt: skip
    return {Path(function).name: check_function(function) for function in study.functions}


def identify(study: Study, design: Array, sources: Mapping[str, str], solver: Any) -> dict[str, Any]:
    """Return everything that the results depend on; `base` is the hash of the physics in it."""
    physics = {**physics_of(study), "functions": dict(sources), "solver": solver}
    spec = {key: value for key, value in study.content.items() if key not in (*FREE, "card", "quantity")}
    return {**physics, "base": digest(physics), "spec": spec, "design": hash_designs(design)}


def physics_of(study: Study) -> dict[str, Any]:
    """Return what every design's results depend on."""
    card = study.instrument
    return {
        "card": {key: value for key, value in card.content.items() if key not in ("schema", "name", "note")},
        "reference_temperature": card.reference_temperature,
        "material_laws": digest(spell_material(card.material)),
        "quantity": study.content["quantity"],
        "physics_version": PHYSICS_VERSION,
    }


def describe_study(store: Store, study: Study, identity: Mapping[str, Any], design: Array | None = None) -> None:
    """Note in a store what it is of; InputError where it is of another study."""
    store.check_same(identity)
    instrument = study.instrument
    spec = {"spec": study.content, "spec_text": study.text, "folder": study.folder}
    kept = {name: getattr(instrument, name) for name in INSTRUMENT}
    cases = 0 if design is None else len(design)
    store.describe({"identity": identity, **spec, "instrument": kept, "cases": cases})


def _is_finished(store: Store, study: Study, design: Array, sources: Mapping[str, str]) -> bool:
    """Return whether everything that is asked is in the store; if so its families need not be built again to know it."""
    done = store.study and int(store.done.sum()) == len(design) and store.find(nominal_row(study)) is not None
    if not done or not {name_search(search) for search in study.searches} <= store.findings.keys():
        return False
    solver = store.about()["identity"]["solver"]
    identity = identify(study, design, sources, solver)
    if json.loads(spell(identity)) != store.about()["identity"]:
        return False
    describe_study(store, study, identity, design)
    return True


def _tell_other_versions(store: Store) -> None:
    """Warn when earlier results come from other versions of what computes: digits may differ between them."""
    now = describe_environment()["packages"]
    then = store.runs[-1]["provenance"].get("packages", now) if store.runs else now
    others = [f"{key} {then.get(key)} then, {now[key]} now" for key in ("numpy", "scipy") if then.get(key) != now[key]]
    if others:
        warnings.warn(f"earlier results were computed with {', '.join(others)}; last digits may differ.", stacklevel=3)


def _describe_families(families: Families | None) -> Any:
    if families is None:
        return "full"
    return [
        [*key, [[a.name, a.low, a.high] for a in one.axes], one.nu, one.solver_tolerance, one.solves]
        for key, one in families.members.items()
    ]


@contextmanager
def running(store: Store, crew: Workers) -> Iterator[None]:
    """Note in a store that a run begins, on what, and how it ends; its workers end with it."""
    outcome = "stopped"
    store.begin_run(describe_environment())
    try:
        yield
        outcome = "finished"
    except KeyboardInterrupt:
        outcome = "interrupted"
        raise
    finally:
        crew.close()
        store.end_run(outcome)
