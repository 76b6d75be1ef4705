"""A user's Python function in a process of its own (JSON over a pipe), killed with a reason when a case takes too long."""

import atexit
import importlib.util
import inspect
import json
import math
import os
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from hashlib import blake2b
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any, NoReturn

from studies.errors import InputError
from studies.instrument.card import build_instrument
from studies.sweeps.case import Case

MOST_MEMORY = 8 * 1024**3  # bytes of address space of the process
IMPORT_LIMIT = 120.0  # s for the process to start and import the user's module
START = "from studies.sweeps.child import serve; serve()"


class FunctionFailed(RuntimeError):
    """The user's function raised, hung, crashed or returned no finite number."""


class FunctionLost(RuntimeError):
    """Somebody else ended the process of the user's function (out of memory, kill): that is no result of the case."""


# signals that a process does not raise by a fault
STOPPED = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)


class Child:
    """One process that holds one user function."""

    def __init__(self, function: str) -> None:
        self.function = function
        self.pipe, theirs = Pipe()
        path = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])])
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-c", START, function, str(os.getpid()), str(theirs.fileno())],
                stdin=subprocess.DEVNULL, stdout=2, pass_fds=[theirs.fileno()], env={**os.environ, "PYTHONPATH": path},
            )  # fmt: skip
        greeting = self.read(IMPORT_LIMIT, "its import")
        if "problem" in greeting:
            self.kill()
            raise FunctionFailed(greeting["problem"])
        self.source: str = greeting["source"]

    def ask(self, request: Mapping[str, Any], limit: float) -> dict[str, Any]:
        """Send one case and return what comes back within `limit` seconds."""
        try:
            self.pipe.send_bytes(json.dumps(request).encode())
        except OSError:
            self.lose()
        return self.read(limit, "one case")

    def read(self, limit: float, what: str) -> dict[str, Any]:
        """Return the next answer; kill the process when it does not come in time."""
        try:
            if not self.pipe.poll(limit):
                self.fail(f"took longer than its time limit of {limit:g} s for {what} and was stopped")
            answer: dict[str, Any] = json.loads(self.pipe.recv_bytes())
        except (EOFError, OSError):
            self.lose()
        return answer

    def lose(self) -> NoReturn:
        """Say how the process ended: by itself, or stopped from outside."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(10.0)  # the pipe closes a moment before the end is known
        stopped = -(self.process.returncode or 0)
        if stopped in STOPPED:
            self.kill()
            raise FunctionLost(f"the process of {self.function} was killed ({signal.Signals(stopped).name})")
        self.fail("ended its process")

    def fail(self, how: str) -> NoReturn:
        """Kill the process and say what the function did."""
        self.kill()
        raise FunctionFailed(f"{self.function} {how}.")

    def kill(self) -> None:
        """End the process and close the pipe."""
        self.process.kill()
        self.process.wait()
        self.pipe.close()


_children: dict[str, Child] = {}
_lock = threading.Lock()


@atexit.register
def _end_children() -> None:
    for child in _children.values():
        child.kill()
    _children.clear()


def ask(function: str, limit: float, case: Case) -> float:
    """Return what a user's function says of a case."""
    instrument = case.instrument
    request = {"content": instrument.content, "path": instrument.path, "parameters": dict(case.parameters)}
    try:
        answer = _ask(function, request, limit)
    except FunctionLost:  # by chance, perhaps; not so the second time
        answer = _ask(function, request, limit)
    if "problem" in answer:
        raise FunctionFailed(answer["problem"])
    return float(answer["value"])


def _ask(function: str, request: Mapping[str, Any], limit: float) -> dict[str, Any]:
    with _lock:
        child = _children.pop(function, None)
        if child is None or child.process.poll() is not None:
            child = Child(function)
        try:
            answer = child.ask(request, limit)
        except BaseException:  # also an interrupt: nobody will read that answer
            child.kill()
            raise
        _children[function] = child
    return answer


def check_function(function: str) -> str:
    """Make sure that a function can be imported, and return the hash of its file; InputError says why not."""
    try:
        child = Child(function)
    except FunctionFailed as error:
        raise InputError(f"function = '{function}': {error}") from error
    child.kill()
    return child.source


def serve() -> None:
    """Answer requests until the parent closes the pipe (runs in the child process)."""
    from studies.sweeps.workers import die_with_parent

    function, parent, place = sys.argv[1:4]
    die_with_parent(int(parent))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the parent's to tell
    _, hard = resource.getrlimit(resource.RLIMIT_AS)  # who asks for more fails by itself, before the machine suffers
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY if hard < 0 else min(MOST_MEMORY, hard), hard))
    pipe = Connection(int(place))
    try:
        call = _load(function)
        greeting = {"source": _hash_source(call)}
    except BaseException as error:
        greeting = {"problem": _describe(function, error)}
    with suppress(EOFError, OSError):
        pipe.send_bytes(json.dumps(greeting).encode())
        while "source" in greeting:
            asked = json.loads(pipe.recv_bytes())
            pipe.send_bytes(json.dumps(_answer(function, call, asked)).encode())


def _load(function: str) -> Any:
    module_name, _, name = function.rpartition(":")
    if module_name.endswith(".py"):
        path = Path(module_name).resolve()
        sys.path.insert(0, str(path.parent))
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None or not path.is_file():
            raise FileNotFoundError(f"there is no file {path}")
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module
        spec.loader.exec_module(module)
    else:
        module = importlib.import_module(module_name)
    call = getattr(module, name)
    if not callable(call):
        raise TypeError(f"{name} is not a function")
    return call


def _hash_source(call: Any) -> str:
    try:
        content = Path(inspect.getfile(inspect.unwrap(call))).read_bytes()
    except (TypeError, OSError):  # written in C, or an object that can be called
        content = repr(type(call)).encode()
    return blake2b(content, digest_size=16).hexdigest()


def _answer(function: str, call: Any, request: dict[str, Any]) -> dict[str, Any]:
    parameters = request.pop("parameters")
    try:
        value = call(build_instrument(**request), parameters)
        if isinstance(value, bool) or not hasattr(value, "__float__"):
            return {"problem": f"{function} returned {value!r:.80}, not a number."}
        value = float(value)
    except Exception as error:
        return {"problem": _describe(function, error)}
    if not math.isfinite(value):
        return {"problem": f"{function} returned {value}, not a finite number."}
    return {"value": value}


def _describe(function: str, error: BaseException) -> str:
    return f"{function} raised {type(error).__name__}: {error}"
