"""A task run or resumed in its folder: the store of all its designs, `best.toml` and `evaluations.csv`."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.design.answer import Answer, answer
from studies.design.task import Task, read_task
from studies.files.writing import write_text
from studies.instrument.card import Instrument, load_card, save_card
from studies.progress import Progress
from studies.sweeps.engine import hire
from studies.sweeps.evaluate import WorkPlan
from studies.sweeps.opening import claim_store
from studies.sweeps.parameters import set_parameters
from studies.sweeps.provenance import digest
from studies.sweeps.run import describe_study, physics_of, running
from studies.sweeps.search import Explorer
from studies.sweeps.store import Store, memory_store

CARD, TABLE = "best.toml", "evaluations.csv"


def optimise(
    source: str | Path, out: str | Path | None = None, *, workers: int | None = None, show_progress: bool = False
) -> Answer:
    """Find the best design of a task, a path or the name of one that ships, or resume where an earlier run stopped.

    More than one of the workers, one a core unless given, need the guard `if __name__ == "__main__":`. Without `out` nothing is kept.
    """
    task = read_task(source)
    study = task.study
    plan = replace(WorkPlan.of(study), start=task.named(task.start))
    store = memory_store() if out is None else claim_store(out)
    try:
        _describe(store, task)
        crew = hire(workers)
        most = task.keys.search.evaluations
        with running(store, crew), Progress(most, shown=show_progress) as progress:
            found = answer(task, Explorer(study, plan, crew, store, progress), plan)
    finally:
        store.close()
    if out is not None:
        path = Path(out) / CARD
        save_card(best_instrument(found), path)
        load_card(path)  # what is handed out can be read
        write_text(Path(out) / TABLE, "\n".join(_table(found)) + "\n")
    return found


def best_instrument(found: Answer) -> Instrument:
    """Return the instrument of the best design, under the task's name."""
    study = found.task.study
    instrument = set_parameters(study.instrument, found.task.named(found.best), study.derived)
    return replace(instrument, name=f"{found.task.name}, best design")


def _describe(store: Store, task: Task) -> None:
    """Say what the designs in a store depend on: neither objectives nor bounds are part of it."""
    study = task.study
    physics = {
        **physics_of(study),
        "parameters": list(study.names),
        "start": task.start.tolist(),
        "derived": study.content["derived"],
    }
    describe_study(store, study, {**physics, "base": digest(physics), "design": ""})


def _table(found: Answer) -> list[str]:
    """Return every design with its columns as lines of CSV."""
    rows = np.hstack([found.designs, found.values])
    head = ",".join([*found.task.study.names, *found.task.columns])
    return [head, *(",".join(f"{value:.15g}" for value in row) for row in rows)]
