"""Workers on a Dask cluster: the same interface as the pool of processes, for when one machine is not enough.

Start `dask scheduler` on one machine and `dask worker tcp://HOST:8786 --nworkers N --nthreads 1` on each, in the same
environment with the same version of the workbench.
"""

from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from importlib import import_module
from typing import Any

from studies.errors import MissingEnvironment

PATIENCE = 20.0  # s to find the scheduler, and its first worker


class Cluster:
    """The workers of a Dask scheduler; they belong to whoever started them and go on when the study ends."""

    def __init__(self, address: str) -> None:
        try:
            dask: Any = import_module("dask")
            distributed: Any = import_module("distributed")
        except ImportError:
            raise MissingEnvironment(
                "--scheduler needs Dask, which is not installed; install it with pip install 'hrg-workbench[cluster]'."
            ) from None
        self.address = address
        try:
            with dask.config.set({"distributed.comm.timeouts.connect": f"{PATIENCE} s"}):
                self.client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
                self.client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, TimeoutError, ValueError) as error:
            raise MissingEnvironment(
                f"{address}: no scheduler with a worker answers ({error}); start both, or correct --scheduler."
            ) from error
        self._check_versions()
        self.executor = self.client.get_executor(pure=False, retries=0)
        self.count = sum(self.client.nthreads().values())
        self.lost: tuple[type[BaseException], ...] = (distributed.scheduler.KilledWorker,)
        self.gone: tuple[type[BaseException], ...] = (
            CancelledError,
            distributed.client.FutureCancelledError,
            OSError,
        )

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Queue a call on the cluster."""
        future: Future[Any] = self.executor.submit(call_if_same, self.code, function, *arguments)
        return future

    def restart(self) -> bool:
        """The scheduler has replaced the lost worker; other tasks go on."""
        return False

    def close(self) -> None:
        """Take back what is queued and leave the cluster."""
        self.executor.shutdown(wait=False)
        self.client.close(timeout=5)

    def _check_versions(self) -> None:
        ours = self.code = describe_code()
        theirs = self.client.run(describe_code)
        others = {address: text for address, text in theirs.items() if text != ours}
        if others:
            address, text = next(iter(others.items()))
            self.client.close(timeout=5)
            raise MissingEnvironment(
                f"worker {address} has {text}, here is {ours}; install the same versions on every machine."
            )


def call_if_same(code: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function on a worker; one that joined later with another version refuses.

    Raises
    ------
    MissingEnvironment
        The worker's versions differ from those of the study.
    """
    here = describe_code()
    if here != code:
        raise MissingEnvironment(
            f"a worker that joined later has {here}, the study has {code}; install the same versions."
        )
    return function(*arguments)


def describe_code() -> str:
    """Return the versions that results depend on, of the process that runs this."""
    from importlib.metadata import version

    from studies.cli.guard import find_name_clash
    from studies.sweeps.canonical import PHYSICS_VERSION

    words = ", ".join(f"{name} {version(name)}" for name in ("hrg-workbench", "numpy", "scipy"))
    return find_name_clash() or f"{words}, physics {PHYSICS_VERSION}"
