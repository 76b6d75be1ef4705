"""User functions that cost nothing, the specs around them, and how the command line is started as a process."""

import os
import sys
from contextlib import closing
from pathlib import Path

from studies.sweeps.opening import open_store

ROOT = Path(__file__).parents[3]
FUNCTIONS = """
import math, os, time

def ishigami(instrument, parameters):
    x1, x2, x3 = (parameters[f"user.x{k}"] for k in (1, 2, 3))
    return math.sin(x1) + 7 * math.sin(x2) ** 2 + 0.1 * x3**4 * math.sin(x1)

def slow(instrument, parameters):
    while float(os.environ.get("HRG_TEST_UNTIL", "1")) < parameters["user.x"] != 0.5:  # which is the nominal design
        time.sleep(0.1)
    time.sleep(0.01 if "HRG_TEST_UNTIL" in os.environ else 0.0)
    with open(os.environ.get("HRG_TEST_LOG", os.devnull), "a") as log:
        log.write(f"{parameters['user.x']!r}\\n")
    return math.sin(parameters["user.x"])

def square(instrument, parameters):
    return parameters["user.x"] ** 2

def bowl(instrument, parameters):
    return (parameters["user.x"] - 0.3) ** 2 + (parameters["user.y"] + 0.2) ** 2

def tilt(instrument, parameters):
    return 2 * parameters["user.x"] + 3 * parameters["user.y"]

def moody(instrument, parameters):
    x = parameters["user.x"]
    if x == 1:
        raise ValueError("one is not welcome")
    if x == 2:
        time.sleep(600)
    if x == 3:
        os._exit(7)
    if x == 4:
        return float("nan")
    if x == 5:
        return "five"
    return x

def murderer(instrument, parameters):
    if parameters["user.x"] == 3:
        os.kill(os.getppid(), 9)
        time.sleep(600)
    return parameters["user.x"]

def unlucky(instrument, parameters):
    if parameters["user.x"] == 1 and not os.path.exists("killed"):
        open("killed", "w").close()
        os.kill(os.getpid(), 9)
    if parameters["user.x"] == 2:
        os.kill(os.getpid(), 15)
    return parameters["user.x"]

def constant(instrument, parameters):
    return 5.0
"""


def words_of(*words: str) -> list[str]:
    return [sys.executable, "-c", "from studies.cli import run; run()", *words]


def environment(**more: str) -> dict[str, str]:
    quiet = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "COLUMNS": "120"}
    return {**os.environ, "PYTHONPATH": str(ROOT), **quiet, **more}


def rows_of(folder: Path) -> list[tuple[int, str, bytes]]:
    """Return place, status and values of the cases in a store, also while it is written."""
    if not (folder / "study.store").exists():
        return []
    with closing(open_store(folder)) as store:
        if store.study is None:
            return []
        d, w = len(store.study["spec"].get("parameter", [])), len(store.judged)
        remarks = store.remarks
        return [
            (place, remarks.get(place, ("ok", ""))[0], values.tobytes())
            for places, columns in store.read(range(1 + d, 1 + d + w))
            for place, values in zip(places.tolist(), columns.T, strict=True)
        ]


def spec_of(function: str, sampling: str, *parameters: str, more: str = "", limit: float = 30.0) -> str:
    tables = "".join(f"[[parameter]]\n{parameter}\n" for parameter in parameters)
    return (
        f'schema = "hrg.study/1"\nname = "test"\ncard = "hrg-30mm"\n[sampling]\n{sampling}\n{tables}'
        f'[[quantity]]\nname = "python"\nfunction = "functions.py:{function}"\ntime_limit_s = {limit}\n{more}'
    )
