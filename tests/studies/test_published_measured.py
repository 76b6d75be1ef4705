"""Measured data that nobody of this project wrote go through: drafted map, import, fit; bands from what is known of them.

Sources and licences: `tests/reference/measured/SOURCES.md`.
"""

import numpy as np
import pytest

from studies.cli import main
from studies.record import read_record
from tests.measured import DATA, bring_in


@pytest.mark.slow
def test_a_gyro_of_three_axes_in_a_chamber(tmp_path, ask):
    """The clock counts µs without saying so; one file makes three records; axis y gains more than tenfold on unseen blocks.

    A cubic is known to leave 196 °/h of y, white noise 73; the steps of x at 1 021 s keep its gain small.
    """
    bring_in("imu_chamber.txt", tmp_path, ('unit = "deg/s"', 'unit = "rad/s"'), preview=True)
    y = read_record(tmp_path / "run_y.csv")
    assert np.median(np.diff(y["time_s"])) == pytest.approx(1.517, abs=0.01)  # 0.5057 s a row, every third
    assert y.instrument == "axis y"
    assert y["housing_temperature_degC"].min() == pytest.approx(-18, abs=1)
    found = ask(["fit", "bias", tmp_path / "run_y.csv"])
    assert found["over"] == "housing_temperature_degC"
    guarded = found["methods"]["guarded"]
    assert guarded["held_out"]["gain"] > 8
    assert guarded["training"]["after"] * 3600 < 250
    assert ask(["fit", "bias", tmp_path / "run_x.csv"])["methods"]["guarded"]["training"]["gain"] < 5


@pytest.mark.slow
def test_a_gyro_in_bursts_with_raw_temperatures(tmp_path, ask):
    """Of 1 770 °/h in x a law in temperature leaves about 20 (burst means: 19); magnetometers in [T] are no temperatures."""
    scale = ("scale = 1.0 ", "scale = 0.00390625 "), ("offset = 0.0 ", "offset = -231.0 ")
    bring_in("pan_bursts.csv", tmp_path, *scale, preview=True)
    run = tmp_path / "run_x.csv"
    found = ask(["fit", "bias", run, "--save", tmp_path / "m.toml"])
    guarded = found["methods"]["guarded"]
    assert "T" in guarded["terms"]
    assert 400 < guarded["training"]["before"] * 3600 < 700
    assert 12 < guarded["training"]["after"] * 3600 < 35
    assert main(["compensate", str(tmp_path / "m.toml"), str(run), "--out", str(tmp_path / "o.csv")]) == 0
    assert main(["compensate", str(tmp_path / "m.toml"), "--emit", str(tmp_path / "m.c")]) == 0


def test_a_crystal_against_satellites_without_a_header_line(tmp_path):
    """Nanoseconds since 1970, ppm about 25 MHz: the map is drafted from the values, the frequency is named by hand."""
    column = '# unknown column: "column 3"'
    named = '[[file.column]]\nfrom = "column 3"\nto = "frequency_Hz"\nunit = "ppm"\nnominal_Hz = 25e6\n'
    record = read_record(bring_in("dcxo_gps.txt", tmp_path, (column, named), preview=True))
    assert record["frequency_Hz"][0] == pytest.approx(25e6 * (1 - 0.7551e-6), abs=1e-6)
    assert record["time_s"][-1] / 3600 == pytest.approx(61, abs=1)
    assert record.start.year == 2021
    assert "gaps longer than" in " ".join(record.comments) or "no gap longer" in " ".join(record.comments)


def test_a_crystal_in_liquid_without_a_header_line(tmp_path):
    record = read_record(bring_in("qcm_steps.txt", tmp_path, preview=True))
    assert np.ptp(record["time_s"]) / 3600 == pytest.approx(3.4, abs=0.1)
    assert record["frequency_Hz"][0] == pytest.approx(10016223.0)
    assert record["housing_temperature_degC"][0] == pytest.approx(24.1)


@pytest.mark.slow
def test_the_accident_of_a_start_up_does_not_make_a_lag(ask):
    """The first of 2 104 readings is 4.67 times the others; it once made a lag of 1.4e6 s with tight intervals."""
    found = ask(["fit", "thermal", str(DATA / "voltmeter_sweep.csv"), "--lags", "1"])
    tau = found["estimates"]["time_constant_1"]
    assert 1000 < tau["value"] < 20000
    assert found["residual_rms_Hz"] / 1e4 < 0.6e-6  # 0.33 ppm is known for one lag, of averages
