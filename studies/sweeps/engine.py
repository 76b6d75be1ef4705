"""The engine: evaluate the designs that a store lacks, batch by batch, on any workers, in any order.

How many of the spec's batches travel as one task changes no result. What a lost worker had is tried again, alone and in
pieces, to find a design that kills it; such a case is noted as lost and tried by the next run.
"""

from collections import deque
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.errors import MissingEnvironment
from studies.sweeps.block import Batch, Cases, join
from studies.sweeps.evaluate import WorkPlan, evaluate_task, failed_cases
from studies.sweeps.workers import Here, Pool, Workers, cores, say_gone

if TYPE_CHECKING:
    from studies.progress import Progress
    from studies.sweeps.definition import Study
    from studies.sweeps.store import Store

TASK_SECONDS = 1.0  # a task should last so long: long against its cost, short against what kill -9 may lose
BATCH, BATCH_VECTORISED = 8, 16384  # cases, where the spec says nothing
BLOCK = 65536  # cases that are kept together, and read together
TRIES_ALONE = 2  # of a case whose worker is lost
STILLBORN = 3  # losses before anything was computed, after which the workers cannot be started
LOOK_EVERY = 2.0  # s without an answer, after which the workers are looked after
MOST_TASKS = 2  # queued for each worker, so that millions of cases do not swamp a scheduler


@dataclass
class _Task:
    batches: list[Batch]
    alone: bool = False  # after a worker was lost: nothing else runs beside it
    tries: int = 0  # that were alone and lost their worker


@dataclass
class Batches:
    """Batches still to be computed, made when they are taken: `places` of the designs in each."""

    designs: Array  # (cases, parameters)
    places: deque[NDArray[np.intp]]

    def __len__(self) -> int:
        return len(self.places)

    def popleft(self) -> Batch:
        """Return the next batch."""
        places = self.places.popleft()
        return Batch(places, self.designs[places])


def missing_batches(study: "Study", designs: Array, store: "Store", vectorised: bool) -> Batches:
    """Return, in order, the cases that the store lacks, in the batches that the spec fixes."""
    count, done = len(designs), store.done
    lacking = np.ones(count, dtype=bool)
    lacking[: len(done)] = ~done[:count]
    places = np.flatnonzero(lacking)
    parts = np.split(places, np.searchsorted(places, range(0, count, batch_size(study, vectorised))))
    return Batches(designs, deque(part for part in parts if len(part)))


def batch_size(study: "Study", vectorised: bool) -> int:
    """Return the number of cases that are computed and kept together."""
    return study.sampling.batch or (BATCH_VECTORISED if vectorised else BATCH)


def hire(workers: int | None, scheduler: str | None = None) -> Workers:
    """Return the workers of a Dask scheduler, or so many here, one for every core unless given."""
    if scheduler is not None:
        from studies.sweeps.cluster import Cluster

        return Cluster(scheduler)
    count = workers or cores()
    return Here() if count == 1 else Pool(count)


def compute(
    plan: WorkPlan, batches: Batches | deque[Batch], workers: Workers, store: "Store", progress: "Progress"
) -> None:
    """Evaluate all batches and keep their rows; returns when every case is in the store."""
    suspects: deque[_Task] = deque()
    running: dict[Future[Any], _Task] = {}
    size, losses, computed = 1, 0, False
    while batches or suspects or running:
        if suspects and not running:
            _submit(suspects.popleft(), plan, workers, running)
        while (
            batches
            and not suspects
            and len(running) < MOST_TASKS * workers.count
            and not any(task.alone for task in running.values())
        ):
            _submit(_Task([batches.popleft() for _ in range(min(size, len(batches)))]), plan, workers, running)
        finished = wait(running, LOOK_EVERY, FIRST_COMPLETED).done
        if not finished:
            workers.check()
        for future in finished:
            task = running.pop(future, None)
            if task is None:
                continue
            try:
                found: list[Cases] = future.result()
            except workers.lost as error:
                losses += 1
                if losses >= STILLBORN and not computed:
                    raise MissingEnvironment(
                        "the worker processes end before they compute anything. In a script, call run_study under"
                        " 'if __name__ == \"__main__\":' or with workers=1; otherwise check what ends them (memory?)."
                    ) from error
                _divide(task, plan, suspects, store, progress)
                if workers.restart():
                    for other in running.values():
                        _divide(_Task(other.batches), plan, suspects, store, progress)
                    running.clear()
                continue
            except workers.gone as error:
                raise say_gone(error) from error
            _keep(found, store, progress)
            computed = True
            each = sum(cases.seconds for cases in found) / len(found)
            size = max(1, min(int(TASK_SECONDS / max(each, 1e-9)), ceil(len(batches) / (8 * workers.count))))


def _submit(task: _Task, plan: WorkPlan, workers: Workers, running: dict[Future[Any], _Task]) -> None:
    running[workers.submit(evaluate_task, plan, task.batches)] = task


def _keep(found: Sequence[Cases], store: "Store", progress: "Progress") -> None:
    together = max(1, BLOCK // max(len(cases.batch) for cases in found))
    for first in range(0, len(found), together):
        cases = join(found[first : first + together])
        store.add(cases)
        progress.advance(len(cases.batch), cases.failed)


def _divide(task: _Task, plan: WorkPlan, suspects: deque[_Task], store: "Store", progress: "Progress") -> None:
    """Put what a lost worker had into the queue of suspects; a case alone that loses it again and again is noted as lost."""
    if not task.alone:
        suspects.extend(_Task([batch], alone=True) for batch in task.batches)
    elif len(task.batches[0]) > 1:
        batch = task.batches[0]
        suspects.extendleft(_Task([batch.part(k, k + 1)], alone=True) for k in reversed(range(len(batch))))
    elif task.tries + 1 < TRIES_ALONE:
        suspects.appendleft(_Task(task.batches, alone=True, tries=task.tries + 1))
    else:
        reason = "the worker process ended each time it computed this case alone (killed or crashed); the next run tries again."
        _keep([failed_cases(plan, task.batches[0], "lost", reason)], store, progress)
