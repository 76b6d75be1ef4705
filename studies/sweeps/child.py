"""A user's Python function in a process of its own (lines of JSON over its pipes), killed with a reason when a case takes too long."""

import atexit
import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from studies.errors import InputError

if TYPE_CHECKING:
    from studies.sweeps.case import Case

MOST_MEMORY = 8 * 1024**3  # bytes of address space of the process
IMPORT_LIMIT = 120.0  # s for the process to start and import the user's module


class FunctionFailed(RuntimeError):
    """The user's function raised, hung, crashed or returned no finite number."""


class FunctionLost(RuntimeError):
    """Somebody else ended the process of the user's function (out of memory, kill): that is no result of the case."""


# signals that a process does not raise by a fault
STOPPED = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)


class Child:
    """One process that holds one user function."""

    def __init__(self, function: str) -> None:
        start = "from studies.sweeps.child import serve; serve()"
        command = [sys.executable, "-P", "-c", start, function, str(os.getpid())]
        path = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])])
        self.function = function
        self.asked = 0
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": path}, bufsize=0
        )
        self.selector = selectors.DefaultSelector()
        assert self.process.stdout is not None
        self.selector.register(self.process.stdout, selectors.EVENT_READ)
        self.received = b""
        greeting = self.read(IMPORT_LIMIT, "its import")
        if "problem" in greeting:
            self.kill()
            raise FunctionFailed(greeting["problem"])
        self.source: str = greeting["source"]

    def ask(self, request: Mapping[str, Any], limit: float) -> float:
        """Send one case and return the number that comes back within `limit` seconds."""
        assert self.process.stdin is not None
        self.asked += 1
        try:
            self.process.stdin.write(json.dumps({**request, "request": self.asked}).encode() + b"\n")
        except OSError:
            self.lose()
        answer = self.read(limit, "one case")
        if answer.get("request") != self.asked:
            self.fail("answered another request than the last")
        if "problem" in answer:
            raise FunctionFailed(answer["problem"])
        return float(answer["value"])

    def read(self, limit: float, what: str) -> dict[str, Any]:
        """Return the next line; kill the process when it does not come in time."""
        assert self.process.stdout is not None
        while b"\n" not in self.received:
            if not self.selector.select(limit):
                self.fail(f"took longer than its time limit of {limit:g} s for {what} and was stopped")
            piece = os.read(self.process.stdout.fileno(), 65536)
            if not piece:
                self.lose()
            self.received += piece
        line, _, self.received = self.received.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def lose(self) -> NoReturn:
        """Say how the process ended: by itself, or stopped from outside."""
        with contextlib.suppress(subprocess.TimeoutExpired):
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
        """End the process and close its pipes."""
        self.process.kill()
        self.process.wait()
        self.selector.close()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()


_children: dict[str, Child] = {}
_lock = threading.Lock()


@atexit.register
def _end_children() -> None:
    for child in _children.values():
        child.kill()
    _children.clear()


def ask(function: str, limit: float, case: "Case") -> float:
    """Return what a user's function says of a case."""
    instrument = case.instrument
    request = {"content": instrument.content, "path": instrument.path, "parameters": dict(case.parameters)}
    try:
        return _ask(function, request, limit)
    except FunctionLost:  # by chance, perhaps; not so the second time
        return _ask(function, request, limit)


def _ask(function: str, request: Mapping[str, Any], limit: float) -> float:
    with _lock:
        child = _children.get(function)
        if child is None or child.process.poll() is not None:
            child = _children[function] = Child(function)
        try:
            return child.ask(request, limit)
        finally:
            if child.process.poll() is not None:
                _children.pop(function).kill()


def check_function(function: str) -> str:
    """Make sure that a function can be imported, and return the hash of its file; InputError says why not."""
    try:
        child = Child(function)
    except FunctionFailed as error:
        raise InputError(f"function = '{function}': {error}") from error
    child.kill()
    return child.source


def serve() -> None:
    """Answer requests until standard input ends (runs in the child process)."""
    from studies.instrument.card import build_instrument
    from studies.sweeps.workers import die_with_parent

    function, parent = sys.argv[1:3]
    die_with_parent(int(parent))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the parent's to tell
    _limit_memory()
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what the function prints must not mix with the answers
    try:
        call = _load(function)
    except BaseException as error:
        answers.write(json.dumps({"problem": _describe(function, error)}).encode() + b"\n")
        return
    answers.write(json.dumps({"source": _hash_source(call)}).encode() + b"\n")
    for line in sys.stdin.buffer:
        asked = json.loads(line)
        number = asked.pop("request")
        answer = _answer(function, call, build_instrument, asked)
        try:
            answers.write(json.dumps({**answer, "request": number}).encode() + b"\n")
        except BrokenPipeError:  # the parent was interrupted and no longer reads
            return


def _limit_memory() -> None:
    """Let a function that asks for too much memory fail by itself, before the machine suffers."""
    try:
        import resource
    except ImportError:  # Windows knows no such limit
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = MOST_MEMORY if hard == resource.RLIM_INFINITY else min(MOST_MEMORY, hard)
    resource.setrlimit(resource.RLIMIT_AS, (most, hard))


def _load(function: str) -> Any:
    import importlib
    import importlib.util

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
    import hashlib
    import inspect

    try:
        content = Path(inspect.getfile(inspect.unwrap(call))).read_bytes()
    except (TypeError, OSError):  # written in C, or an object that can be called
        content = repr(type(call)).encode()
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _answer(function: str, call: Any, build: Any, request: dict[str, Any]) -> dict[str, Any]:
    import math

    parameters = request.pop("parameters")
    try:
        value = call(build(**request), parameters)
        if isinstance(value, bool) or (not isinstance(value, int | float) and not hasattr(value, "__float__")):
            return {"problem": f"{function} returned {value!r:.80}, not a number."}
        value = float(value)
    except Exception as error:
        return {"problem": _describe(function, error)}
    if not math.isfinite(value):
        return {"problem": f"{function} returned {value}, not a finite number."}
    return {"value": value}


def _describe(function: str, error: BaseException) -> str:
    return f"{function} raised {type(error).__name__}: {error}"
