"""The engine: evaluate the designs that a store lacks, batch by batch, on any workers, in any order.

How many of the spec's batches travel as one task changes no result. What a lost worker had is tried again, alone and in
pieces, to find a design that kills it; such a case is noted as lost and tried by the next run.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.progress import Progress
from studies.sweeps.block import Batch, Cases, join
from studies.sweeps.definition import Study
from studies.sweeps.evaluate import WorkPlan, evaluate_task, failed_cases
from studies.sweeps.store import Store
from studies.sweeps.workers import Here, Pool, Workers, cores, run_tasks

TASK_SECONDS = 1.0  # a task should last so long: long against its cost, short against what kill -9 may lose
BATCH, BATCH_VECTORISED = 8, 16384  # cases, where the spec says nothing
BLOCK = 65536  # cases that are kept together, and read together
KILLED = "the worker process ended each time it computed this case alone (killed or crashed); the next run tries again."


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


def missing_batches(study: Study, designs: Array, store: Store, vectorised: bool) -> Batches:
    """Return, in order, the cases that the store lacks, in the batches that the spec fixes."""
    count, done = len(designs), store.done
    lacking = np.ones(count, dtype=bool)
    lacking[: len(done)] = ~done[:count]
    places = np.flatnonzero(lacking)
    size = study.sampling.batch or (BATCH_VECTORISED if vectorised else BATCH)
    parts = np.split(places, np.searchsorted(places, range(0, count, size)))
    return Batches(designs, deque(part for part in parts if len(part)))


def hire(workers: int | None, scheduler: str | None = None) -> Workers:
    """Return the workers of a Dask scheduler, or so many here, one for every core unless given."""
    if scheduler is not None:
        from studies.sweeps.cluster import Cluster

        return Cluster(scheduler)
    count = workers or cores()
    return Here() if count == 1 else Pool(count)


def compute(
    plan: WorkPlan, batches: Batches | deque[Batch], workers: Workers, store: Store, progress: Progress
) -> None:
    """Evaluate all batches and keep their rows; returns when every case is in the store."""
    size = 1

    def take() -> list[Batch]:
        return [batches.popleft() for _ in range(min(size, len(batches)))]

    for tried, found in run_tasks(workers, take, partial(evaluate_task, plan), Batch.cases):
        if found is None:
            _keep([failed_cases(plan, batch, "lost", KILLED) for batch in tried], store, progress)
            continue
        _keep(found, store, progress)
        each = sum(cases.seconds for cases in found) / len(found)
        size = max(1, min(int(TASK_SECONDS / max(each, 1e-9)), ceil(len(batches) / (8 * workers.count))))


def _keep(found: Sequence[Cases], store: Store, progress: Progress) -> None:
    together = max(1, BLOCK // max(len(cases.batch) for cases in found))
    for first in range(0, len(found), together):
        cases = join(found[first : first + together])
        store.add(cases)
        progress.advance(len(cases.batch), cases.failed)
