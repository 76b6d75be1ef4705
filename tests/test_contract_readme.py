"""The README tells the truth: its two commands are there for scripts, and every other command in it runs."""

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from studies.cli import main
from studies.effects import find_effect
from studies.inference import signatures
from studies.instrument.card import load_card
from studies.results.page import Picture
from tests.compensation.two_oscillators import Gyro, noisy
from tests.golden.answers import CASES

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)
COMMANDS = [line for kind, text in BLOCKS[1:] if kind == "sh" for line in text.splitlines()]
LOGGER = (
    "Date;Time;Frequenz [Hz];T Gehaeuse [°C]\n"
    + "\n".join(f"21.11.2026;10:{m:02d}:{s:02d};4432,{10 + s};20,{m}" for m in range(3) for s in range(0, 60, 5))
    + "\n"
)


def _decay():
    """A lock-in's record of a decay with a split of 0.12 Hz."""
    time = np.arange(0.0, 60.0, 0.2)
    z = noisy(
        Gyro(4599.75, 4599.63, 9e5, 1.1e6, 0.5, 1.2).envelope(time, 4599.7, [1.0, 0.8j]),
        0.003,
        np.random.default_rng(1),
    )
    columns = [time, *(part for channel in z for part in (np.abs(channel), np.degrees(np.angle(channel))))]
    rows = "\n".join(",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))
    return f"# reference_frequency_Hz: 4599.7\ntime_s,amplitude_cos_V,phase_cos_deg,amplitude_sin_V,phase_sin_deg\n{rows}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A working folder as the README's reader has it: the card saved, a logger's file at hand."""
    made = tmp_path_factory.mktemp("first-hour")
    card, steel = (text for kind, text in BLOCKS if kind == "toml")
    (made / "my-gyro.toml").write_text(card, encoding="utf-8")
    (made / "steel.toml").write_text(steel, encoding="utf-8")
    (made / "logger.csv").write_text(LOGGER, encoding="utf-8")
    (made / "decay.csv").write_text(_decay(), encoding="utf-8")
    shutil.copytree(ROOT / "studies" / "papers", made / "studies" / "papers")
    return made


def test_the_material_of_the_readme_is_one_for_a_card(folder):
    named = ('name = "fused-silica"', 'name = "my-steel"\nfile = "steel.toml"')
    (folder / "steel-gyro.toml").write_text((folder / "my-gyro.toml").read_text(encoding="utf-8").replace(*named))
    material = load_card(folder / "steel-gyro.toml").material
    assert material.value("youngs_modulus", 303.15) == pytest.approx(1.9e11 * (1 - 2.5e-3))


def test_the_first_block_holds_the_two_commands():
    kind, text = BLOCKS[0]
    lines = text.splitlines()
    assert kind == "sh"
    assert len(lines) == 2
    assert lines[0].startswith("python -m pip install .")
    assert "hrg reproduce" in lines[0]
    assert lines[1].endswith("python -m pytest -n auto --dist worksteal")


@pytest.mark.slow
def test_commands_of_the_first_hour_run_in_order(folder, monkeypatch, capsys):
    """But for those whose words have a golden answer, or are asked by `test_contract_derive`; sliders have tests of their own.

    A plan is of two effects: that of all is a golden answer.
    """
    monkeypatch.chdir(folder)
    two = {name: find_effect(name) for name in ("second-lag", "jump")}
    monkeypatch.setattr("studies.reports.live.live_blocks", lambda *_: [])
    monkeypatch.setattr("studies.results.page.draw", lambda _, caption, alt: Picture("data:,", caption, alt))
    assert len(COMMANDS) > 20
    known = {case["words"] for case in CASES.values()} | {"derive --code c"}
    for line in COMMANDS:
        program, *words = shlex.split(line, comments=True)
        assert program == "hrg"
        if words[:1] == ["optimise"] or shlex.join(words) in known:
            continue  # tests/studies/design runs this task
        with monkeypatch.context() as patch:
            if "--plan" in words:
                patch.setattr(signatures, "library", lambda: two)
            status = main(words)
        said, told = capsys.readouterr()
        if status == 3 and "OpenGL" in told:
            continue
        assert status == 0, f"{line}: {told}"
        if words[:2] == ["fit", "bias"]:
            assert "Improvement, held-out data" in said, "the example shows what the text beside it promises"
        if words[:1] == ["calibrate"]:
            assert "79.2 ppm/°C. hrg-30mm predicts" in said
            assert "88.7 ± 6.3 ppm/°C" in said
            (slope,) = [line for line in said.splitlines() if "│ temperature slope of the shear modulus" in line]
            assert slope.split("│")[-2].strip() == "data"


@pytest.mark.slow
def test_the_python_blocks_run(capsys):
    found: dict[str, object] = {}
    for code in (text for kind, text in BLOCKS if kind == "python"):
        exec(compile(code, "README.md", "exec"), found)  # the project's own text
    assert "7/24 -37/3 + 20*log(2)" in capsys.readouterr().out
    assert found["mode"].frequency == pytest.approx(4596.39, abs=0.05)  # type: ignore[attr-defined]
