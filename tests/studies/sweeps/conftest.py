"""Fixtures of the study tests: user functions in a file, and the command line as a process."""

import signal
import subprocess
from pathlib import Path

import pytest

from tests.studies.sweeps.processes import FUNCTIONS, environment, words_of


@pytest.fixture
def functions(tmp_path: Path) -> Path:
    path = tmp_path / "functions.py"
    path.write_text(FUNCTIONS)
    return path


@pytest.fixture
def hrg():
    def call(*words: object, **more: str) -> subprocess.CompletedProcess[str]:
        command = words_of(*map(str, words))
        return subprocess.run(
            command, capture_output=True, text=True, env=environment(**more), timeout=600, check=False
        )

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
