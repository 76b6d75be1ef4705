"""The shipped examples run as scripts of their own, and what they print is what was put in or published."""

import os
import re
import subprocess
import sys
from pathlib import Path
from pkgutil import iter_modules

import pytest

from studies import examples

ROOT = Path(__file__).parents[2]


def run_example(name, folder):
    """Return what an example prints; it leaves no files."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", f"studies.examples.{name}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, timeout=600)
    assert done.returncode == 0, done.stderr
    assert list(folder.iterdir()) == []
    return done.stdout


def numbers(pattern, text):
    found = re.search(pattern, text)
    assert found, text
    return [float(value) for value in found.groups()]


def test_there_is_one_for_each_part_of_the_workbench():
    names = sorted(module.name for module in iter_modules(examples.__path__))
    assert names == ["chamber_run", "compensate_run", "design_code", "diagnose_run", "tolerance_study"]


@pytest.mark.slow
def test_design_by_formula_is_far_off_and_by_solver_is_not(tmp_path):
    text = run_example("design_code", tmp_path)
    formula, truly = numbers(r"formula: ([\d.]+) mm, which truly gives ([\d.]+) Hz", text)
    (solver,) = numbers(r"solver:  ([\d.]+) mm", text)
    # the excess of Rayleigh's mode over the solid at h/R = 0.06 is 11.3 %, and f grows a little faster than h
    assert 5000 / truly == pytest.approx(1.112, abs=0.003)
    assert 1.11 < solver / formula < 1.14


@pytest.mark.slow
def test_the_tolerance_study(tmp_path):
    text = run_example("tolerance_study", tmp_path)
    assert "64 designs, 0 failed" in text
    mean, low, high = numbers(r"([\d.]+) Hz on average, from ([\d.]+) to ([\d.]+) Hz", text)
    # f goes nearly as h/R²: ± 5 µm of 0.9 mm and ± 5 µm of 15 mm move it by at most ± (0.56 + 0.07) %
    assert low < mean < high
    assert 0.8 * 0.0125 < (high - low) / mean < 0.0125
    assert "within limits" in text


@pytest.mark.slow
def test_the_chamber_run_settles_as_the_paper_describes(tmp_path):
    """HRG paper, figure 3: fast until about 9000 s, settled at about 15 000 s."""
    text = run_example("chamber_run", tmp_path)
    (fast,), (settled,) = (numbers(rf"within {share} % of the change after (\d+) min", text) for share in (5, 1))
    assert 6000 < 60 * fast < 12000
    assert 9000 < 60 * settled < 17000


@pytest.mark.slow
def test_the_compensation_leaves_only_the_lag(tmp_path):
    before, after = numbers(
        r"changes by ([\d.]+) Hz, compensated by ([\d.]+) Hz", run_example("compensate_run", tmp_path)
    )
    # the ramp's lag: 0.05 K/min for some 30 to 60 min of delay, at 0.37 Hz/K
    assert 0.3 < after < 1.5
    assert before > 15 * after


@pytest.mark.slow
def test_the_diagnosis_names_what_was_planted(tmp_path):
    text = run_example("diagnose_run", tmp_path)
    assert text.splitlines()[0] == "explained"
    value, low, high = numbers(r"rate-bias in bias_deg_per_h.*value=([\d.]+), low=([\d.]+), high=([\d.]+)", text)
    assert low < 900 < high
    assert value == pytest.approx(900, rel=0.01)
    assert "frequency_Hz: adequate" in text
