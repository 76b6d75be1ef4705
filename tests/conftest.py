"""What holds for every test: one thread for linear algebra, a heap that is swept once, when all is loaded, figures only sketched, diagnoses coarse; how commands are asked."""

import gc
import json
import os
from collections import Counter
from functools import cache, lru_cache

import pytest

from tests.sketches import coarsen, sketch_pages

gc.disable()  # until all modules and tests are loaded: nothing of them is to be freed, and the sweeps take a third of the time

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # the solver's matrices are small


def pytest_collection_modifyitems(items) -> None:
    """Files of many slow tests come first: at the end no process waits for the long last test of another."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -slow[item.path])


def pytest_collection_finish() -> None:
    """All modules and tests are loaded for good: later sweeps of the collector leave them out."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)  # as a command sets it: looking every 700 objects takes 3 % of all
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def whole_pages():
    """Pages are sketched (`tests/sketches.py`); what draws them whole, for those that look at it."""
    with pytest.MonkeyPatch.context() as patch:
        yield sketch_pages(patch)


@pytest.fixture(autouse=True, scope="module")
def coarse(request):
    """Diagnoses take coarse means, but for golden answers."""
    with pytest.MonkeyPatch.context() as patch:
        yield coarsen(patch) if "tests/golden" not in request.node.nodeid else {}


keep = cache(lru_cache(200))


@pytest.fixture(autouse=True, scope="module")
def solved_once(request):
    """The modes of a card's law are solved once in a process, but for the tests of the solver itself."""
    from shell import law

    with pytest.MonkeyPatch.context() as patch:
        if "tests/shell" not in request.node.nodeid:
            patch.setattr(law, "solve_modes", keep(law.solve_modes))
        yield


@pytest.fixture
def fine(monkeypatch, coarse):
    """A diagnosis takes the means that it takes of itself, where coarse ones resolve too little."""
    for name, whole in coarse.items():
        monkeypatch.setattr(name, whole)


@pytest.fixture
def drawn(monkeypatch, whole_pages):
    """Pages with their figures and pictures whole, where these are the subject."""
    for name, whole in whole_pages.items():
        monkeypatch.setattr(name, whole)


@pytest.fixture
def ask(capsys):
    """The JSON object that a command answers."""
    from studies.cli import main

    def answer(words):
        capsys.readouterr()
        assert main([*map(str, words), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return answer


@pytest.fixture
def hear(capsys, monkeypatch):
    """The JSON object of a command and the text that it prints, as one line, both of one run."""
    from studies.cli import main, output

    show, kept = output.print_result, []
    monkeypatch.setattr(output, "print_result", lambda result: (kept.append(result), show(result)))

    def answer(words):
        capsys.readouterr()
        assert main([*map(str, words)]) == 0
        return json.loads(output.dump_json(kept[-1].payload)), " ".join(capsys.readouterr().out.split())

    return answer


@pytest.fixture
def refuse(capsys):
    """What a command says that cannot work: exit status 2, nothing on stdout, nothing like a fault of the program."""
    from studies.cli import main

    def said(words):
        capsys.readouterr()
        assert main([*map(str, words)]) == 2
        out, told = capsys.readouterr()
        assert (out, "Traceback" in told) == ("", False)
        return told

    return said
