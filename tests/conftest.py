"""What holds for every test: one thread for linear algebra, a heap that is swept once, figures that are only sketched; how commands are asked."""

import gc
import json
import os

import pytest

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # the solver's matrices are small


def pytest_collection_finish() -> None:
    """All modules and tests are loaded for good: later sweeps of the collector leave them out."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def whole_figures():
    """Figures of pages are drawn without layout, file and curves, once of each kind: what cannot be drawn fails so too."""
    from studies.results import page

    known = set()

    def sketch(figure, caption, alt):
        kind = tuple(caption.split()[:4])
        if kind not in known:
            known.add(kind)
            figure.set_layout_engine("none")
            figure.draw_without_rendering()
        return page.Picture("data:image/svg+xml;base64,", caption, alt)

    whole = page.draw
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "draw", sketch)
        yield whole


@pytest.fixture
def drawn(monkeypatch, whole_figures):
    """Pages with their figures whole, where these are the subject."""
    monkeypatch.setattr("studies.results.page.draw", whole_figures)


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
