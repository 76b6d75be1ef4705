"""Soaks found in a record against the law of the device that made it."""

import numpy as np
import pytest

from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.models import read_model
from studies.record import Record, read_record, write_record
from studies.record.settled import find_soaks
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run


@pytest.fixture(scope="module")
def run():
    return simulate_run(load_card("hrg-30mm"), load_profile("staircase -20 40 20 6h"), 1 / 60, 3)


@pytest.mark.slow
def test_what_has_not_settled_is_no_soak(run):
    # The gyro has settled where the run begins, and nowhere after it.
    slow = find_soaks([run.record], time_constant=1e6)
    assert {round(soak.temperature_degC) for soak in slow} <= {-20}
    short = simulate_run(load_card("hrg-30mm"), load_profile("ramp 20 -20 0.5"), 1 / 30, 1).record
    assert find_soaks([short]) == ()
    with pytest.raises(InputError, match="must be positive"):
        find_soaks([short], tolerance=0.0)
    with pytest.raises(InputError, match="frequency_Hz' is missing"):
        find_soaks([Record({"time_s": np.arange(100.0), "housing_temperature_degC": np.ones(100)})])


@pytest.mark.slow
def test_holds_that_end_before_they_have_settled_are_extrapolated_onto_the_law():
    """Nine soaks of 4 h, of which the last readings are 20 to 70 mK short of the law; the extrapolated ones lie on it."""
    run = simulate_run(load_card("hrg-30mm"), load_profile("staircase -20 60 10 4h"), 1 / 60, 3)
    soaks = find_soaks([run.record])
    assert [round(soak.temperature_degC) for soak in soaks] == list(range(-20, 61, 10))
    extrapolated = [soak for soak in soaks if soak.extrapolated_K]
    assert len(extrapolated) >= len(soaks) - 2
    for soak in soaks:
        slope = float(run.law.slope(293.15) * run.law.frequency(293.15))
        exact = float(run.law.frequency(soak.temperature_degC + 273.15))
        assert abs(soak.frequency_Hz - exact) < 2 * soak.error_Hz
        assert soak.error_Hz < 0.05 * slope
    for soak in extrapolated:
        end = float(np.interp(soak.end, run.record["time_s"], run.record["resonator_temperature_degC"]))
        assert soak.extrapolated_K == pytest.approx(abs(soak.temperature_degC - end), rel=0.35)


def test_a_hold_far_from_settled_is_not_extrapolated():
    record = simulate_run(load_card("hrg-30mm"), load_profile("staircase -20 40 20 2h"), 1 / 60, 3).record
    assert [round(soak.temperature_degC) for soak in find_soaks([record])] == [-20]


def test_two_temperatures_are_no_polynomial(tmp_path, capsys):
    """Readings of two soaks, scattered by millikelvins, are two temperatures however many they are."""
    path = tmp_path / "two.csv"
    noise = np.random.default_rng(1).normal(scale=2e-3, size=10)
    T = np.repeat([-10.0, 40.0], 5) + noise
    path.write_text("temperature_degC,frequency_Hz\n" + "".join(f"{t:.4f},{4424 + 0.37 * t:.4f}\n" for t in T))
    assert main(["fit", "frequency", str(path)]) == 2
    assert "not 2 and 10" in capsys.readouterr().err
    assert main(["fit", "frequency", str(path), "--order", "2"]) == 2


@pytest.mark.slow
def test_the_command_takes_a_record(run, tmp_path, ask, refuse):
    path = tmp_path / "run.csv"
    write_record(run.record, path)
    answer = ask(["fit", "frequency", str(path), "--order", "2"])
    assert answer["schema"] == "hrg.fit-frequency/1"
    assert set(answer["soaks"][0]) == {
        "record", "start_s", "end_s", "temperature_degC", "frequency_Hz", "error_Hz", "left_K", "extrapolated_K",
    }  # fmt: skip
    slope = float(run.law.slope(273.15) * run.law.frequency(273.15))
    assert answer["coefficients"][1] == pytest.approx(slope, rel=2e-3)
    assert "a fit over temperature needs at least two temperatures" in refuse(
        ["fit", "frequency", str(path), "--time-constant", "1e7"]
    )


def _staircase(path, *levels):
    """Write holds of six hours, at once settled, with a frequency of 0.37 Hz/°C."""
    t = np.arange(0.0, 6 * 3600.0 * len(levels), 60.0)
    T = np.repeat(levels, t.size // len(levels)).astype(float)
    noise = np.random.default_rng(len(levels)).normal(scale=1e-3, size=t.size)
    path.parent.mkdir(exist_ok=True)
    columns = {"time_s": t, "housing_temperature_degC": T, "frequency_Hz": 4424 + 0.37 * T - 3e-4 * T**2 + noise}
    write_record(Record(columns), path)


def test_a_model_of_several_records_names_them_all(tmp_path, capsys):
    """Of one name in two folders; χ² is said to be by the error of the settled parts, not by the last digit."""
    first, second = tmp_path / "a" / "run.csv", tmp_path / "b" / "run.csv"
    _staircase(first, 20, -20, 0)
    _staircase(second, 10, 40, 30)
    assert main(["fit", "frequency", str(first), str(second), "--save", str(tmp_path / "m.toml")]) == 0
    said = capsys.readouterr().out
    assert "so bounds rather than scatter" in " ".join(said.split())  # 5.5 times the scatter
    assert "every settled part is uncertain by" in said
    assert "last digit" not in said
    sources = read_model(tmp_path / "m.toml").sources
    assert [source.sha256 for source in sources] == [read_record(path).sha256 for path in (first, second)]
    assert sum(source.rows for source in sources) == 6


def test_too_few_settled_parts_of_several_records_are_said(tmp_path, capsys):
    paths = [tmp_path / name / "run.csv" for name in "ab"]
    for path, levels in zip(paths, ((20,), (40, 40)), strict=True):
        _staircase(path, *levels)
    assert main(["fit", "frequency", *map(str, paths)]) == 2
    said = capsys.readouterr().err
    assert all(str(path) in said for path in paths)
    assert "found 2 settled parts; order 3 needs 5" in said
