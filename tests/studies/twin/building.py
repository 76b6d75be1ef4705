"""Twins compiled for the tests, and their records beside those of the simulation."""

import shutil
import subprocess

import numpy as np
import pytest

from shell.constants import zero_Celsius
from studies.simulation.chamber import load_drive
from studies.simulation.virtual_gyro import simulate_run
from studies.twin.plan import plan_twin
from studies.twin.source import CORE, PROGRAM, sources
from thermal.profile import Profile

STRICT = ("-std=c11", "-Wall", "-Wextra", "-Werror")
OPTIMISED = (*STRICT, "-O2")
SANITIZED = (*STRICT, "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
CC = shutil.which("cc")
needs_compiler = pytest.mark.skipif(CC is None, reason="no C compiler (cc) is on the path")


def compile_twin(instrument, folder, options=STRICT, boundary="chamber", main="main.c", names=PROGRAM):
    folder.mkdir(exist_ok=True)
    for name, text in sources(plan_twin(instrument, boundary), names).items():
        (folder / name).write_text(text)
    program = folder / "twin"
    subprocess.run([CC, *options, "-I.", *CORE, "card.c", main, "-lm", "-o", program], cwd=folder, check=True)
    return program


def write_profile(path, columns):
    names = list(columns)
    rows = zip(*(np.asarray(columns[name], dtype=float).tolist() for name in names), strict=True)
    path.write_text("\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return path


def run_twin(program, profile, row=1.0, seed="noiseless", full=True):
    out = program.parent / "record.csv"
    words = [program, profile, out, repr(row), str(seed), *(["full"] if full else [])]
    subprocess.run(words, check=True, capture_output=True)
    return read_columns(out)


def read_columns(path):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    values = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    return dict(zip(lines[0].split(","), values.T, strict=True))


def simulated(instrument, profile, row=1.0):
    """The run without noise, before its digits are cut, through a profile's file or a profile."""
    driven = profile if isinstance(profile, Profile) else load_drive(str(profile), rate=1 / row)
    run = simulate_run(instrument, driven, 1 / row, noise=False)
    columns = dict(run.prediction.columns)
    if run.prediction.drive.boundary == "chamber":
        columns["housing_temperature_degC"] = run.prediction.housing - zero_Celsius
    return columns


def worst(found, expected):
    """The largest difference of a column, over the largest value of the column."""
    return {name: float(np.abs(found[name] - v).max() / np.abs(v).max()) for name, v in expected.items() if np.any(v)}


def off(found, expected, within=1e-9):
    """The columns that differ by more, with what `worst` says of them."""
    return {name: error for name, error in worst(found, expected).items() if error > within}
