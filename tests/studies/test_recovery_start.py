"""How the gyro of a measured run began: planted departures are found by first readings, and are in the stated width without them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from studies.calibration.start import find_start, misread
from studies.cli import main
from studies.instrument.card import load_card
from studies.record import Record, read_record, write_record
from studies.simulation.drive import drive_by_record
from studies.simulation.prediction import law_for, predict
from studies.simulation.virtual_gyro import simulate_run
from thermal.profile import parse_profile

PLANTED = {"base": -1.5, "stem": -2.0, "resonator": -3.0}


@pytest.fixture(scope="module")
def card():
    return load_card("hrg-30mm")


@pytest.fixture(scope="module")
def run(card):
    """A run of which the parts were colder than the housing when it began: its record, and its columns without noise."""
    settled = simulate_run(card, parse_profile("soak 20 1h then ramp 20 0 0.5 then soak 0 3h"), 0.1, seed=1)
    drive = replace(drive_by_record(settled.record, "housing"), initial=PLANTED)
    noisy, exact = (simulate_run(card, drive, seed=2, noise=noise).record for noise in (True, False))
    return noisy, exact


def test_first_readings_tell_a_planted_start(card, run):
    """Half an hour of readings gives the frequency of five hours within the stated width; a record taken as settled is hundreds of times further off."""
    record, exact = run
    drive = drive_by_record(record)
    start = find_start(card, record, drive, readings=1800.0)
    begun = replace(drive, initial=start.departures)
    law = law_for(card, begun)
    width = np.sqrt(np.mean(start.spread(card, begun, law)["frequency_Hz"] ** 2))
    missed, settled = (
        np.sqrt(np.mean((predict(card, one, law=law).columns["frequency_Hz"] - exact["frequency_Hz"]) ** 2))
        for one in (begun, drive)
    )
    assert missed < 3 * width
    assert settled > 100 * missed


@pytest.mark.parametrize("cut", [200, 360, 420, 500, 700])
def test_without_readings_the_width_holds_what_nobody_knows(card, cut):
    """A record that begins in the midst of a ramp, at its end or in the soak after it: taken as settled, it misses by no more than two widths."""
    whole = simulate_run(card, parse_profile("ramp -10 20 0.5 then soak 20 2h then ramp 20 0 0.5"), 0.1, seed=3).record
    record = Record({name: values[cut:] for name, values in whole.columns.items()})
    drive = drive_by_record(record, "housing")
    start, law = find_start(card, record, drive), law_for(card, drive)
    width = np.sqrt(np.mean(start.spread(card, drive, law)["frequency_Hz"] ** 2))
    missed = np.sqrt(np.mean((predict(card, drive, law=law).columns["frequency_Hz"] - record["frequency_Hz"]) ** 2))
    assert set(start.departures.values()) == {0.0}
    assert missed < 2 * width


def test_the_width_of_one_departure_is_its_slope_times_its_deviation(card, run):
    """Limit: the spread of a start with one uncertain part is |dy/dT| s, by differences of the prediction."""
    drive = drive_by_record(run[0])
    law = law_for(card, drive)
    start = find_start(card, run[0], drive)
    one = type(start)({"resonator": 0.0}, np.array([[0.1]]))
    above, below = (predict(card, replace(drive, initial={"resonator": T}), law=law).columns for T in (0.1, -0.1))
    for column, width in one.spread(card, drive, law).items():
        assert width == pytest.approx(
            np.abs(above[column] - below[column]) / 2, rel=1e-3, abs=1e-4 * width.max() + 1e-20
        )


def test_a_record_of_temperatures_alone_tells_nothing_of_its_start(card, run, tmp_path, refuse):
    record = run[0]
    bare = Record({name: record[name] for name in ("time_s", "housing_temperature_degC")})
    assert {sd for _, _, sd in find_start(card, bare, drive_by_record(bare)).rows} == {10.0}
    write_record(bare, tmp_path / "bare.csv")
    words = ["simulate", "hrg-30mm", str(tmp_path / "bare.csv"), "--out", str(tmp_path / "o.csv"), "--start", "30min"]
    assert "no reading of" in refuse(words)


def test_the_command_says_how_a_run_began(run, tmp_path, capsys, refuse):
    """Whole way by files: record, --start, and the record that is written follows the noiseless one."""
    record, exact = run
    path, out = tmp_path / "run.csv", tmp_path / "o.csv"
    write_record(record, path)
    words = ["simulate", "hrg-30mm", str(path), "--out", str(out), "--noiseless"]
    assert main([*words, "--spread", "--start", "30min", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["start"]["resonator"]["departure_K"] == pytest.approx(-3.0, abs=4 * said["start"]["resonator"]["sd_K"])
    assert np.abs(read_record(out)["frequency_Hz"] - exact["frequency_Hz"]).max() < 0.05
    assert "must be a duration" in refuse([*words, "--start", "soon"])
    assert "fewer than 5 means" in refuse([*words, "--start", "10s"])
    profile = ["simulate", "hrg-30mm", "step 20 0 1h", "--out", str(out), "--start", "30min"]
    assert "begins settled" in refuse(profile)


def test_the_width_holds_what_noise_of_the_housing_makes(card, run):
    """Planted: 20 mK of noise in the housing's readings, another draw; the resonator behind its lag averages it."""
    exact = drive_by_record(run[1], "housing")
    draw = np.append(0.0, np.random.default_rng(5).standard_normal(len(run[1]) - 1))
    noisy = run[1]["housing_temperature_degC"] + 0.02 * draw
    drive = drive_by_record(Record(run[1].columns | {"housing_temperature_degC": noisy}), "housing")
    law = law_for(card, drive)
    true, read = (predict(card, one, law=law) for one in (exact, drive))
    made, nothing = (np.sqrt(np.mean(misread(card, one, law)["frequency_Hz"] ** 2)) for one in (read, true))
    missed = np.sqrt(np.mean((read.columns["frequency_Hz"] - true.columns["frequency_Hz"]) ** 2))
    assert missed == pytest.approx(made, rel=0.5)
    assert nothing < 0.1 * made
