"""What is told while a command works: percent and the time left, monotonic, from two seconds on."""

import re
from pathlib import Path

import pytest

from studies import progress
from studies.cli import calibrate, calibrate_modes, diagnose
from studies.progress import Progress, Stages, Told, tell

ROOT = Path(progress.__file__).parent


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_percent_and_time_left(clock, capsys):
    """A stage begins where such work usually is by then; words within it bring it nearer to the next; a quick one says nothing."""
    told = Told("work", {"first": 0.1, "second": 0.5})
    words = ["first", "a step", "a step", "second", "a step", "an end"]
    for word in words:
        clock[0] += 3.0
        told(word)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(words)
    parts = [int(re.search(r"(\d+) %", line)[1]) for line in lines]
    assert parts == sorted(parts)
    assert parts[0] == 10
    assert 50 <= parts[3] < parts[-1] < 100
    assert "about 9 s left" not in lines[0]
    assert lines[3] == "work: second, 50 %, about 12 s left"


def test_counted_work(clock, capsys):
    told = Told("files")
    for k in range(4):
        told(f"file {k}", k / 4)
        clock[0] += 2.5
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["files: file 1, 25 %, about 8 s left", "files: file 2, 50 %, about 5 s left",
                     "files: file 3, 75 %, about 2 s left"]  # fmt: skip


def test_cases_of_a_study_that_goes_on(clock, capsys):
    """What an earlier run has done counts for the percent, not for the rate."""
    with Progress(total=10_000, done=250, shown=True) as lines:
        clock[0] += 10.0
        lines.advance(1000, 3)
    assert capsys.readouterr().err == "done: 1250 of 10000, 3 failed, 12 %, about 88 s left\n"


def test_stages_of_a_command(clock, capsys):
    """Each has its own percent and rest; where a work tells of the whole, and outside a command, they are silent."""
    tell("reading a", 0.5)
    with Stages("hrg import"):
        for words, part in (("reading a", 0.25), ("reading a", 0.5), ("writing b", 0.1), ("writing b", 0.2)):
            clock[0] += 3.0
            tell(words, part)
        with Told("work"):
            clock[0] += 30.0
            tell("reading a", 0.5)
    assert capsys.readouterr().err.splitlines() == [
        "hrg import: reading a", "hrg import: reading a, 50 %, about 6 s left",
        "hrg import: writing b", "hrg import: writing b, 20 %, about 24 s left"]  # fmt: skip


def test_nothing_of_what_is_quick(clock, capsys):
    told = Told("work", {"first": 0.1})
    told("first")
    told("first")
    assert capsys.readouterr().err == ""


def test_the_stages_of_commands_are_said_by_their_work():
    """The words by which a stage is known stand in what computes."""
    said = "".join(
        path.read_text() for part in ("calibration", "inference", "inversion") for path in (ROOT / part).rglob("*.py")
    )
    for stages in (calibrate.STAGES, calibrate_modes.STAGES, diagnose.STAGES):
        for words in stages:
            assert re.search(rf'progress\(f?"{re.sub(r" ?1:?$", "", words)}', said), words
