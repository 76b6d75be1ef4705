"""Workers on a Dask cluster: the same interface as the pool of processes, for when one machine is not enough.

Start `dask scheduler`, and `dask worker tcp://HOST:8786 --nworkers N --nthreads 1` on each machine, in one environment.
Whoever can reach or imitate them can run code here: an address without encryption must be private, others need `tls://`
with the certificates that Dask's configuration names (`distributed.comm.tls`).
"""

import asyncio
import ipaddress
import logging
import socket
import time
import warnings
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import suppress
from importlib import import_module
from typing import Any

from studies.errors import InputError, MissingEnvironment
from studies.sweeps.workers import Workers

GREETING = 10.0  # s for the scheduler to answer
PATIENCE = 20.0  # s for its first worker, and another after the last one has ended
GLANCE = 3.0  # s for the scheduler to say which workers it has
ENCRYPTED = ("tls", "wss")


class Cluster(Workers):
    """The workers of a Dask scheduler; they belong to whoever started them and go on when the study ends."""

    def __init__(self, address: str) -> None:
        check_private(address)
        try:
            dask: Any = import_module("dask")
            distributed: Any = import_module("distributed")
        except ImportError:
            raise MissingEnvironment("--scheduler needs Dask, which is not installed; install it with pip install 'hrg-workbench[cluster]'.") from None  # fmt: skip
        self.address = address
        self.lonely: float | None = None  # since when no worker is left
        # what is lost is said here, in a sentence, not by the libraries' tracebacks of connections that end
        for name in list(logging.root.manager.loggerDict):
            if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
                logging.getLogger(name).setLevel(logging.CRITICAL)
        greeted = False
        security = distributed.Security(require_encryption=True) if is_encrypted(address) else None

        class Client(distributed.Client):  # type: ignore[misc]
            """One that cannot start is closed at once: collected while another starts, it would block that for ever."""

            def start(self, **given: Any) -> None:
                try:
                    super().start(**given)
                    self.wait_for_workers(1, timeout=PATIENCE)
                except BaseException:
                    leave(self)
                    raise

        try:
            with dask.config.set({"distributed.comm.timeouts.connect": f"{GREETING} s"}):
                with ThreadPoolExecutor(1) as aside:  # a notebook has a loop of its own in this thread
                    aside.submit(asyncio.run, greet(distributed, address, security)).result()
                greeted = True
                self.client = Client(address, timeout=GREETING, set_as_default=False, security=security)
        except (OSError, TimeoutError, ValueError, TypeError, RuntimeError, MemoryError) as error:
            if isinstance(error, TypeError):  # no context of TLS
                raise MissingEnvironment(
                    f"{address}: encryption needs certificates: distributed.comm.tls.ca-file, .client.cert and .client.key in Dask's configuration."
                ) from error
            if not greeted and is_open(address):
                raise MissingEnvironment(f"{address}: this is no Dask scheduler: a server listens there but does not answer as one; correct --scheduler.") from error  # fmt: skip
            raise MissingEnvironment(f"{address}: no scheduler with a worker answers ({str(error) or 'no answer in time'}); start both, or correct --scheduler.") from error  # fmt: skip
        self._check_versions()
        self.count = sum(self.client.nthreads().values())
        self.lost = (distributed.scheduler.KilledWorker,)
        self.gone = (CancelledError, distributed.client.FutureCancelledError, OSError)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Queue a call on the cluster."""
        done: Future[Any] = Future()
        task = self.client.submit(call_if_same, self.code, function, *arguments, pure=False, retries=0)
        self.client.loop.add_callback(pass_on, task, done)
        return done

    def check(self) -> None:
        """Say when the last worker has ended; give up when no other comes."""
        try:
            there = self.client.sync(self.client.scheduler.ncores, callback_timeout=GLANCE)
        except (OSError, TimeoutError):  # a scheduler that is lost ends the tasks itself
            return
        now = time.monotonic()
        if there:
            self.lonely = None
        elif self.lonely is None:
            self.lonely = now
            ended = f"{self.address}: the last worker has ended; waiting {PATIENCE:g} s for another."
            warnings.warn(ended, stacklevel=2)
        elif now - self.lonely > PATIENCE:
            raise MissingEnvironment(f"{self.address}: no worker is left; everything computed before is kept. Start workers, then run the same command again to resume.")  # fmt: skip

    def close(self) -> None:
        """Take back what is queued and leave the cluster."""
        leave(self.client)

    def _check_versions(self) -> None:
        ours = self.code = describe_code()
        theirs = self.client.run(describe_code)
        others = {address: text for address, text in theirs.items() if text != ours}
        if others:
            address, text = next(iter(others.items()))
            leave(self.client)
            raise MissingEnvironment(f"worker {address} has {text}, here is {ours}; install the same versions.")


async def pass_on(task: Any, done: "Future[Any]") -> None:
    """Hand the end of a task on; Dask's own executor takes a result whose worker ends just then for an error and fails."""
    try:
        found = await task
    except BaseException as error:  # cancelled is none of Exception
        done.set_exception(error)
    else:
        done.set_result(found)


async def greet(distributed: Any, address: str, security: Any) -> None:
    """Shake hands with a server of Dask; its own client would wait for ever for one that is silent."""
    given = security.get_connection_args("client") if security else {}
    comm = await asyncio.wait_for(distributed.core.connect(address, timeout=GREETING, **given), GREETING)
    await comm.close()


def leave(client: Any) -> None:
    """Close a client, also one whose scheduler is lost."""
    with suppress(OSError, TimeoutError, RuntimeError, CancelledError):
        client.close(timeout=5)


def is_encrypted(address: str) -> bool:
    """Return whether an address names a protocol with encryption."""
    return address.partition("://")[0] in ENCRYPTED


def check_private(address: str) -> None:
    """Refuse a public address without encryption: who reaches or imitates the scheduler there could run code here."""
    host = host_of(address)
    try:
        found = socket.getaddrinfo(host, None) if host and not is_encrypted(address) else []
    except OSError:  # the client says that it cannot be found
        found = []
    if any(is_public(str(one[4][0])) for one in found):
        raise InputError(
            f"--scheduler {address}: a public address without encryption; whoever reaches or imitates it can run code here."
            " Use tls:// with certificates (distributed.comm.tls in Dask's configuration), or a private network."
        )


def host_of(address: str) -> str:
    """Return the host of an address [PROTOCOL://][USER@]HOST[:PORT]; an IPv6 address may stand in brackets."""
    place = address.rpartition("://")[2].rpartition("@")[2].partition("/")[0]
    host = place[1:].partition("]")[0] if place.startswith("[") else place.rpartition(":")[0] or place
    return host.rstrip(".")


def is_open(address: str) -> bool:
    """Return whether something listens at an address."""
    port = address.rpartition(":")[2].partition("/")[0]
    try:
        socket.create_connection((host_of(address), int(port)), GLANCE).close()
    except (OSError, ValueError):
        return False
    return True


def is_public(number: str) -> bool:
    """Return whether an IP address is reached from everywhere; ::ffff:8.8.8.8 is 8.8.8.8."""
    one = ipaddress.ip_address(number.partition("%")[0])
    return (getattr(one, "ipv4_mapped", None) or one).is_global


def call_if_same(code: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function on a worker; one that joined later with another version refuses."""
    here = describe_code()
    if here != code:
        raise MissingEnvironment(f"a later worker has {here}, the study has {code}; install the same versions.")
    return function(*arguments)


def describe_code() -> str:
    """Return the versions that results depend on, of the process that runs this."""
    from importlib.metadata import version

    from studies.cli.guard import find_name_clash
    from studies.sweeps.provenance import PHYSICS_VERSION

    words = ", ".join(f"{name} {version(name)}" for name in ("hrg-workbench", "numpy", "scipy"))
    return find_name_clash() or f"{words}, physics {PHYSICS_VERSION}"
