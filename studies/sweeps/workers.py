"""Who evaluates the batches of a study: this process, a pool of processes, or a Dask cluster, behind one interface."""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from studies.errors import MissingEnvironment
from studies.threads import ONE_THREAD

# One thread each, and no module of the working directory: a signal.py there must not be run by a worker.
# glibc keeps the memory of one solve for the next: fresh pages cost a sixth of a design
KEPT = {"MALLOC_MMAP_THRESHOLD_": "1073741824", "MALLOC_TRIM_THRESHOLD_": "1073741824", "MALLOC_TOP_PAD_": "67108864"}
ENVIRONMENT = {**ONE_THREAD, **KEPT, "PYTHONSAFEPATH": "1"}
PR_SET_PDEATHSIG = 1


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


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def say_gone(error: BaseException) -> MissingEnvironment:
    """Return the error that tells that all workers are gone."""
    return MissingEnvironment(f"the workers are gone ({str(error) or 'connection lost'}); everything computed before is kept. Run the same command again to resume.")  # fmt: skip


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
        import threading

        threading.Thread(target=_watch_parent, args=(parent,), daemon=True).start()
    if os.getppid() != parent:  # it ended before we asked
        os._exit(1)


def _watch_parent(parent: int) -> None:
    import time

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
