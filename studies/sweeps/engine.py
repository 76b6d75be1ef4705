"""The engine: evaluate the designs that a store lacks, batch by batch, on any workers, in any order.

The spec fixes the batches. How many of them travel as one task is decided by how long they take, and changes no result.
A task that comes back is committed whole. When a worker is lost, what it had is tried again, alone and in pieces, so
that a design that kills its worker is found and does not stop the rest. The loss of a worker is no result: such a case
is noted as lost and tried again by the next run. Workers that end before any of them has computed anything stop the run.
"""

from collections import deque
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING, Any, NamedTuple

from studies.errors import MissingEnvironment
from studies.sweeps.canonical import case_key, spell
from studies.sweeps.design import decode_row
from studies.sweeps.evaluate import WorkPlan, evaluate_task, failed_row
from studies.sweeps.row import Row

if TYPE_CHECKING:
    from studies.sweeps.definition import Study
    from studies.sweeps.design import Design
    from studies.sweeps.progress import Progress
    from studies.sweeps.store import Store
    from studies.sweeps.workers import Workers

TASK_SECONDS = 1.0  # a task should last so long: long against its cost, short against what kill -9 may lose
BATCH, BATCH_VECTORISED = 8, 1024  # cases, where the spec says nothing
TRIES_ALONE = 2  # of a case whose worker is lost
STILLBORN = 3  # losses before anything was computed, after which the workers cannot be started
LOOK_EVERY = 2.0  # s without an answer, after which the workers are looked after
MOST_TASKS = 2  # queued for each worker, so that millions of cases do not swamp a scheduler


class Item(NamedTuple):
    """One design to compute: its position among the unique designs, its key, its parameters as data and spelled."""

    position: int | None
    key: bytes
    parameters: dict[str, Any]
    spelled: str


Batch = Sequence[Item]


@dataclass
class _Task:
    batches: list[Batch]
    alone: bool = False  # after a worker was lost: nothing else runs beside it
    tries: int = 0  # that were alone and lost their worker


def make_item(base: str, position: int | None, parameters: dict[str, Any]) -> Item:
    """Return the design with these parameters and its key."""
    spelled = spell(parameters)
    return Item(position, case_key(base, spelled), parameters, spelled)


@dataclass
class Batches:
    """Batches still to be computed, made when they are taken: `places` of the unique designs in each."""

    study: "Study"
    design: "Design"
    base: str
    places: deque[list[int]]

    def __len__(self) -> int:
        return len(self.places)

    def take(self) -> Batch:
        """Return the next batch."""
        places = self.places.popleft()
        rows = self.design.values[self.design.unique[places]].tolist()
        named = (decode_row(self.study, row) for row in rows)
        return [make_item(self.base, place, values) for place, values in zip(places, named, strict=True)]


def missing_batches(study: "Study", design: "Design", base: str, store: "Store", vectorised: bool) -> Batches:
    """Return, in order, the cases that the store lacks, in the batches that the spec fixes."""
    done = store.done()
    size = study.sampling.batch or (BATCH_VECTORISED if vectorised else BATCH)
    places: deque[list[int]] = deque()
    for first in range(0, len(design.unique), size):
        batch = list(range(first, min(first + size, len(design.unique))))
        lacking = [place for place in batch if place not in done]
        if lacking:
            places.append(lacking)
    return Batches(study, design, base, places)


def compute(
    plan: WorkPlan, batches: "Batches | deque[Batch]", workers: "Workers", store: "Store", progress: "Progress"
) -> None:
    """Evaluate all batches and keep their rows; returns when every case is in the store.

    Raises
    ------
    MissingEnvironment
        The store cannot be written, or all workers are gone for good; what was computed before is kept.
    """
    take = batches.take if isinstance(batches, Batches) else batches.popleft
    suspects: deque[_Task] = deque()
    running: dict[Future[Any], _Task] = {}
    size, losses, computed = 1, 0, False
    while batches or suspects or running:
        if suspects and not running:
            _submit(suspects.popleft(), plan, workers, running)
        while batches and not suspects and len(running) < MOST_TASKS * workers.count and not _any_alone(running):
            _submit(_Task([take() for _ in range(min(size, len(batches)))]), plan, workers, running)
        finished = wait(running, LOOK_EVERY, FIRST_COMPLETED).done
        if not finished:
            workers.check()
        for future in finished:
            task = running.pop(future, None)
            if task is None:
                continue
            try:
                rows: list[list[Row]] = future.result()
            except workers.lost as error:
                losses += 1
                if losses >= STILLBORN and not computed:
                    raise MissingEnvironment(
                        "the worker processes end before they compute anything. In a script, call run_study under"
                        " 'if __name__ == \"__main__\":' or with workers=1; else look for what ends them (memory?)."
                    ) from error
                _divide(task, plan, suspects, store, progress)
                if workers.restart():
                    for other in running.values():
                        _divide(_Task(other.batches), plan, suspects, store, progress)
                    running.clear()
                continue
            except workers.gone as error:
                raise MissingEnvironment(
                    f"the workers are gone ({error}); everything computed before is kept. Run the same command again to resume."
                ) from error
            _keep(task, rows, store, progress)
            computed = True
            each = sum(row.seconds for batch in rows for row in batch) / len(rows)
            size = max(1, min(int(TASK_SECONDS / max(each, 1e-9)), ceil(len(batches) / (8 * workers.count))))


def _any_alone(running: dict[Future[Any], _Task]) -> bool:
    return any(task.alone for task in running.values())


def _submit(task: _Task, plan: WorkPlan, workers: "Workers", running: dict[Future[Any], _Task]) -> None:
    batches = [[item.parameters for item in batch] for batch in task.batches]
    running[workers.submit(evaluate_task, plan, batches)] = task


def _keep(task: _Task, rows: list[list[Row]], store: "Store", progress: "Progress") -> None:
    pairs = [
        (item, row)
        for batch, found in zip(task.batches, rows, strict=True)
        for item, row in zip(batch, found, strict=True)
    ]
    store.add((item.key, item.position, item.spelled, row) for item, row in pairs)
    progress.advance(len(pairs), sum(row.status != "ok" for _, row in pairs))


def _divide(task: _Task, plan: WorkPlan, suspects: deque[_Task], store: "Store", progress: "Progress") -> None:
    """Put what a lost worker had into the queue of suspects; a case alone that loses it again and again is noted as lost."""
    if not task.alone:
        suspects.extend(_Task([batch], alone=True) for batch in task.batches)
    elif len(task.batches[0]) > 1:
        suspects.extendleft(_Task([[item]], alone=True) for item in reversed(task.batches[0]))
    elif task.tries + 1 < TRIES_ALONE:
        suspects.appendleft(_Task(task.batches, alone=True, tries=task.tries + 1))
    else:
        reason = "the worker process ended each time it computed this case alone (killed or crashed); the next run tries again."
        _keep(task, [[failed_row(plan, "lost", reason)]], store, progress)
