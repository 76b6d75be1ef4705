"""Fixtures of the study tests: user functions in a file, and the command line, here or as a process."""

import signal
import subprocess
import warnings
from pathlib import Path

import pytest

from studies.cli import main
from tests.studies.sweeps.processes import FUNCTIONS, environment, words_of


@pytest.fixture
def functions(tmp_path: Path) -> Path:
    path = tmp_path / "functions.py"
    path.write_text(FUNCTIONS)
    return path


@pytest.fixture
def hrg(capfd, monkeypatch):
    """The command line in this process; what it starts are processes."""

    def call(*words: object, **more: str) -> subprocess.CompletedProcess[str]:
        for name, value in more.items():
            monkeypatch.setenv(name, str(value))
        capfd.readouterr()
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("default")
            status = main([str(word) for word in words])
        out, err = capfd.readouterr()
        return subprocess.CompletedProcess(words, status, out, err + "".join(f"{one.message}\n" for one in told))

    return call


def heed_interrupts() -> None:
    """Ctrl-C is ignored by what a background job starts; a test of it must not be."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.fixture
def start():
    started: list[subprocess.Popen[str]] = []

    def call(*words: object, **more: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            words_of(*map(str, words)),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(**more),
            preexec_fn=heed_interrupts,
        )
        started.append(process)
        return process

    yield call
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()
