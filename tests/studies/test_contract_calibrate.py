"""`hrg calibrate`: its JSON, its files and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from studies.calibration.observed import UNITS
from studies.cli import main
from studies.instrument.card import load_card
from studies.record import write_record
from studies.reports.calibration import NAMES, SHOWN
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("calibrate") / "run<1>.csv"
    true = load_card("hrg-30mm").with_values({"loss.inverse_q": 2e-7, "thermal.chamber_conductance_W_per_K": 0.2})
    write_record(simulate_run(true, load_profile("ramp 20 0 0.5 then soak 0 1h"), 1 / 60).record, path)
    return path


@pytest.mark.slow
def test_what_has_not_converged_is_no_card(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("studies.calibration.fit.MOST_STEPS", 1)
    card = tmp_path / "calibrated.toml"
    words = ["calibrate", "hrg-30mm", "studies/papers/hrg_table1.csv", "--json"]
    assert main([*words, "--save", str(card)]) == 2
    said = capsys.readouterr()
    answer = json.loads(said.out)
    assert (answer["converged"], answer["calibrated_card"]) == (False, None)
    assert "calibrated.toml not saved" in said.err
    assert not card.exists()
    assert main(words) == 0


@pytest.mark.slow
def test_tables_are_for_people(tmp_path, capsys, ask):
    """The residual is that of `hrg diagnose`: the level is a value of the card; a scatter of rows is no Allan deviation."""
    page = tmp_path / "page.html"
    assert main(["calibrate", "hrg-30mm", "studies/papers/hrg_table1.csv", "--report", str(page)]) == 0
    out = capsys.readouterr().out
    assert "Values, best known first" in out
    assert "Settled frequency" in out
    text = page.read_text(encoding="utf-8")
    assert "24 stay at their prior; none moved" in text
    assert "Allan" not in text
    assert "block averages" not in text
    assert "Values that the data do not depend on <small>(19 rows)" in text
    left = ask(["diagnose", "studies/papers/hrg_table1.csv", "--card", "hrg-30mm"])["responses"]["frequency_Hz"][
        "shipped_rms"
    ]
    assert f"{1e3 * left:.0f} mHz as given" in text


@pytest.mark.slow
def test_a_saved_card_keeps_what_was_found_of_intervals(tmp_path, capsys, refuse):
    """They need not be symmetric about the value, as value ± sd is."""
    card = tmp_path / "calibrated.toml"
    assert main(["calibrate", "hrg-30mm", "studies/papers/hrg_table1.csv", "--save", str(card), "--json"]) == 0
    told = {one["parameter"]: one for one in json.loads(capsys.readouterr().out)["values"]}
    assert main(["cards", str(card), "--json"]) == 0
    kept = {one["name"]: one for one in json.loads(capsys.readouterr().out)["values"]}
    assert {name: kept[name]["interval"] for name in told} == {name: [v["low"], v["high"]] for name, v in told.items()}
    q = kept["loss.inverse_q"]
    assert q["interval"][1] - q["value"] > 1.2 * (q["value"] - q["interval"][0])  # its logarithm is normal
    assert main(["cards", str(card)]) == 0
    assert "90 %" in capsys.readouterr().out
    broken = card.read_text(encoding="utf-8").replace("interval = [", "interval = [[1.0, 0.0],", 1)
    card.write_text(broken, encoding="utf-8")
    assert "interval must be" in refuse(["modes", str(card)])


def test_every_response_has_a_name_and_a_unit_for_people():
    assert set(NAMES) == set(SHOWN) == set(UNITS)
    known = {"Hz": "mHz", "K": "mK", "V": "mV", "1": "ppb", "°/h": "°/h"}
    assert {name: known[unit] for name, unit in UNITS.items()} == {name: unit for name, (unit, _) in SHOWN.items()}


def test_what_cannot_be_calibrated_is_refused(run, tmp_path, capsys):
    bare = tmp_path / "bare.csv"
    t = np.arange(0.0, 3600.0, 60.0)
    bare.write_text("time_s,frequency_Hz\n" + "".join(f"{x:g},4432\n" for x in t), encoding="utf-8")
    for words, message in (
        (["calibrate", "hrg-30mm"], "DATA is missing"),
        (["calibrate", "hrg-30mm", str(bare)], "add the column housing_temperature_degC or chamber_temperature_degC"),
        (["calibrate", "hrg-30mm", str(run), "--hold-out", "3"], "there is 1 record, numbered from 1"),
        (["calibrate", "hrg-30mm", str(run), "--exact", "thermal.film"], "is not an uncertain value of the card"),
    ):
        assert main(words) == 2
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.out == ""


@pytest.mark.slow
def test_a_table_whose_level_is_not_the_cards_says_what_would_bridge_it_and_saves_nothing(tmp_path, capsys):
    """The level once went into 112 Hz of noise, with 0 of 27 values determined and the card saved as if it had succeeded."""
    shipped, card, out = (Path("studies/cards/hrg-30mm.toml"), tmp_path / "thick.toml", tmp_path / "out.toml")
    card.write_text(shipped.read_text(encoding="utf-8").replace("0.8558278", "0.88"), encoding="utf-8")
    assert main(["calibrate", str(card), "studies/papers/hrg_table1.csv", "--save", str(out), "--json"]) == 2
    said = capsys.readouterr()
    answer = json.loads(said.out)
    (level, slope) = (answer["settled"][0][key] for key in ("level_Hz", "slope_ppm_per_degC"))
    assert level["measured"] == pytest.approx(4432.07, abs=0.05)
    assert level["away_sd"] < -7.0
    assert slope["measured"] == pytest.approx(79.2, abs=0.15)
    assert answer["responses"]["settled_frequency_Hz"]["noise"] < 0.2  # Hz; what the readings leave of a parabola
    assert answer["responses"]["settled_frequency_Hz"]["run_offset"] < 0.1
    assert any("shear_modulus.log_value) moved by -" in warning for warning in answer["warnings"])
    assert (
        "out.toml not saved: shear modulus (material.deviation.shear_modulus.log_value) would have to move by more than 6"
        in said.err
    )
    assert not out.exists()
    assert main(["calibrate", str(card), "studies/papers/hrg_table1.csv"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Any one of these would remove the difference in level: thinner walls (-2.7" in text
