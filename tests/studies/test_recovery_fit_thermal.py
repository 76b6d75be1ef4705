"""hrg fit thermal finds the lags that a record was made with, and refuses a record that has none."""

import numpy as np
import pytest

from studies.calibration.lags.records import fit_thermal_constants
from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.record import Record, write_record
from studies.resonator.law import law_of
from studies.simulation.virtual_gyro import simulate_run
from thermal.lag import lag
from thermal.profile import parse_profile


def record(words, **columns):
    profile = parse_profile(words)
    t = np.arange(0.0, profile.end, 60.0)
    rng = np.random.default_rng(1)
    before = np.concatenate([[-60.0], t])
    housing = lag(before, np.concatenate([profile.value[:1], profile.at(t)]), 600.0)[1:] - 273.15
    resonator = lag(t, housing, 1800.0)
    f = 4432.0 + 0.37 * (resonator - 20) - 1e-3 * (resonator - 20) ** 2 + 2e-3 * rng.normal(size=t.size)
    return Record({"time_s": t, "housing_temperature_degC": housing, "frequency_Hz": f} | columns, path="run.csv")


def test_one_lag_without_radiation_is_found_with_its_interval(tmp_path, capsys, ask):
    path = tmp_path / "run.csv"
    write_record(record("step 20 -20 4h then step -20 40 4h"), path)
    answer = ask(["fit", "thermal", str(path), "--lags", "1"])
    assert answer["schema"] == "hrg.fit-thermal/1"
    tau, share = answer["estimates"]["time_constant_1"], answer["estimates"]["radiated_share"]
    assert tau["low"] < 1800.0 < tau["high"]
    assert tau["value"] == pytest.approx(1800.0, rel=0.01)
    assert share["low"] < 0.0 < share["high"]
    assert answer["undetermined"] == []
    assert main(["fit", "thermal", str(path), "--lags", "1"]) == 0
    assert "Time constant 1" in capsys.readouterr().out


@pytest.mark.parametrize("row", [0, 1, 200, -1])
@pytest.mark.parametrize("column", ["frequency_Hz", "housing_temperature_degC"])
def test_one_accidental_reading_does_not_move_the_lag(row, column):
    """A start-up accident of a real voltmeter's record made a lag of 1.4e6 s out of 6 649 s."""
    clean = record("step 20 -20 4h then step -20 40 4h")
    spoilt = clean[column].copy()
    spoilt[row] *= 4.7
    found = fit_thermal_constants([clean.with_columns({column: spoilt})], lags=1).estimates["time_constant_1"]
    assert found.value == pytest.approx(1800.0, rel=1e-3)
    assert found.high - found.low < 20.0


def test_unusable_records_are_refused(tmp_path, capsys):
    path = tmp_path / "still.csv"
    write_record(record("soak 20 5h"), path)
    assert main(["fit", "thermal", str(path), "--lags", "1"]) == 2
    answer = capsys.readouterr()
    assert "still.csv: nothing can be identified" in answer.err
    assert answer.out == ""
    with pytest.raises(InputError, match=r"run.csv: thermal constants need frequency_Hz and housing_temperature_degC"):
        fit_thermal_constants([Record({"time_s": np.arange(9.0), "frequency_Hz": np.ones(9)}, path="run.csv")])
    with pytest.raises(InputError, match="--lags 9"):
        fit_thermal_constants([record("soak 20 5h")], lags=9)


@pytest.mark.slow
def test_a_heat_path_of_several_lumps_is_followed_to_its_noise():
    """The virtual gyro's own heat path, several lumps with radiation: residual near the noise, curvature that of the card's law."""
    card = load_card("hrg-30mm")
    runs = [
        simulate_run(card, parse_profile(words), 10.0, seed).record
        for seed, words in enumerate(("step 40 -20 5h", "step -20 40 5h"))
    ]
    estimates = (found := fit_thermal_constants(runs)).estimates
    law, middle = law_of(card, 233.15, 333.15), found.problem.reference_temperature
    f = law.frequency(np.array([middle - 10.0, middle, middle + 10.0]))
    assert estimates["curvature"].value == pytest.approx((f[0] - 2 * f[1] + f[2]) / 200.0, rel=0.3)
    assert found.residual.std() < 5.0 * found.noise.innovation
