"""Who evaluates the batches of a study: this process, a pool of processes, or a Dask cluster, behind one interface."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, TypeVar

from studies.errors import MissingEnvironment
from studies.threads import ONE_THREAD

Part = TypeVar("Part")
Found = TypeVar("Found")
# One thread each, and no module of the working directory: a signal.py there must not be run by a worker.
# glibc keeps the memory of one solve for the next: fresh pages cost a sixth of a design
KEPT = {"MALLOC_MMAP_THRESHOLD_": "1073741824", "MALLOC_TRIM_THRESHOLD_": "1073741824", "MALLOC_TOP_PAD_": "67108864"}
ENVIRONMENT = {**ONE_THREAD, **KEPT, "PYTHONSAFEPATH": "1"}
PR_SET_PDEATHSIG = 1
TRIES_ALONE = 2  # of a part whose worker is lost
STILLBORN = 3  # losses before anything was computed, after which the workers cannot be started
LOOK_EVERY = 2.0  # s without an answer, after which the workers are looked after
MOST_TASKS = 2  # queued for each worker, so that millions of cases do not swamp a scheduler


class Workers:
    """What the engine needs of workers; `lost`: errors of a task whose worker was lost; `gone`: that all are gone for good."""

    count = 1
    lost: tuple[type[BaseException], ...] = ()
    gone: tuple[type[BaseException], ...] = ()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Start a call somewhere."""
        raise NotImplementedError

    def restart(self) -> bool:
        """Be usable again after a worker was lost; True when every other running task was lost with it."""
        return False

    def check(self) -> None:
        """Look after the workers while nothing comes back; MissingEnvironment when none is left."""

    def close(self) -> None:
        """End every worker at once; what they were doing is lost."""


class Here(Workers):
    """The process itself: for vectorised quantities, where starting others would take longer than the work."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Call now."""
        done: Future[Any] = Future()
        done.set_result(function(*arguments))
        return done


class Pool(Workers):
    """Processes on this machine, each with one thread; they end when this process ends, however it ends."""

    lost = (BrokenProcessPool,)

    def __init__(self, count: int) -> None:
        self.count = count
        self._start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Queue a call; processes start as calls need them."""
        before = set(multiprocessing.active_children())
        with _environment(ENVIRONMENT):  # must stand before numpy is imported in a new process
            future = self._executor.submit(function, *arguments)
        self._processes |= set(multiprocessing.active_children()) - before
        return future

    def restart(self) -> bool:
        """End what is left and start anew: one lost process breaks the whole pool."""
        self.close()
        self._start()
        return True

    def close(self) -> None:
        """Kill the processes and wait for the executor's thread: left alive it races with the end of the interpreter."""
        for process in self._processes:
            process.kill()
        self._executor.shutdown(cancel_futures=True)
        for process in self._processes:
            process.join()

    def _start(self) -> None:
        self._processes: set[Any] = set()
        context = multiprocessing.get_context("spawn")
        with _environment(ENVIRONMENT):  # the pool's semaphores start a process that tracks them
            self._executor: Executor = ProcessPoolExecutor(
                self.count, mp_context=context, initializer=become_worker, initargs=(os.getpid(),)
            )


@dataclass
class _Task:
    parts: list[Any]
    alone: bool = False  # after a worker was lost: nothing else runs beside it
    tries: int = 0  # that were alone and lost their worker


def run_tasks(
    workers: Workers, take: Callable[[], list[Part]], function: Callable[[list[Part]], Found],
    split: Callable[[Part], list[Part]] = lambda part: [part], tries: int = TRIES_ALONE,
) -> Iterator[tuple[list[Part], Found | None]]:  # fmt: skip
    """Yield parts with what the function makes of them, as it comes; `take` gives the next ones, none at the end.

    What a lost worker had is tried again, alone and `split`, to find the part that kills it: of that comes None.
    """
    suspects, running = deque[_Task](), dict[Future[Any], _Task]()
    losses, computed = 0, False
    while True:
        if suspects and not running:
            task = suspects.popleft()
            running[workers.submit(function, task.parts)] = task
        usable = not suspects and not any(task.alone for task in running.values())
        while usable and len(running) < MOST_TASKS * workers.count and (parts := take()):
            running[workers.submit(function, parts)] = _Task(parts)
        if not running:
            return
        finished = wait(running, LOOK_EVERY, FIRST_COMPLETED).done
        if not finished:
            workers.check()
        for future in finished:
            if (done := running.pop(future, None)) is None:
                continue
            try:
                found = future.result()
            except workers.lost as error:
                losses += 1
                if losses >= STILLBORN and not computed:
                    raise MissingEnvironment(
                        "the worker processes end before they compute anything. In a script, call run_study under"
                        " 'if __name__ == \"__main__\":' or with workers=1; otherwise check what ends them (memory?)."
                    ) from error
                lost = [done]
                if workers.restart():
                    lost += [_Task(task.parts) for task in running.values()]
                    running.clear()
                for task in lost:
                    if not task.alone:
                        suspects.extend(_Task([part], alone=True) for part in task.parts)
                    elif len(pieces := split(task.parts[0])) > 1:
                        suspects.extendleft(_Task([piece], alone=True) for piece in reversed(pieces))
                    elif task.tries + 1 < tries:
                        suspects.appendleft(_Task(task.parts, alone=True, tries=task.tries + 1))
                    else:
                        computed = True
                        yield task.parts, None
            except workers.gone as error:
                raise MissingEnvironment(f"the workers are gone ({str(error) or 'connection lost'}); everything computed before is kept. Run the same command again to resume.") from error  # fmt: skip
            else:
                computed = True
                yield done.parts, found


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def become_worker(parent: int) -> None:
    """Prepare a pool process: it ends with its parent, and leaves Ctrl-C to it."""
    die_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def die_with_parent(parent: int) -> None:
    """Ask the system to kill this process when its parent ends, even by kill -9."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_watch_parent, args=(parent,), daemon=True).start()
    if os.getppid() != parent:  # it ended before we asked
        os._exit(1)


def _watch_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


@contextlib.contextmanager
def _environment(changes: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
