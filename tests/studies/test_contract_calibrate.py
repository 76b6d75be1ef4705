"""`hrg calibrate`: its JSON, its files and what it refuses."""

import json
from pathlib import Path

import pytest

from studies.calibration.observed import UNITS
from studies.cli import main
from studies.reports.calibration import NAMES, SHOWN


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
def test_tables_are_for_people_and_a_saved_card_keeps_what_was_found_of_intervals(tmp_path, capsys, ask, hear, refuse):
    """The residual is that of `hrg diagnose`, a scatter of rows no Allan deviation; intervals need not be symmetric, as value ± sd is."""
    page, card, table = tmp_path / "page.html", tmp_path / "calibrated.toml", "studies/papers/hrg_table1.csv"
    found, out = hear(["calibrate", "hrg-30mm", table, "--save", card, "--report", page])
    assert "Values, best known first" in out
    assert "Settled frequency" in out
    text = page.read_text(encoding="utf-8")
    assert "26 stay at their prior; none moved" in text
    assert "Allan" not in text
    assert "block averages" not in text
    assert "Values that the data do not depend on <small>(21 rows)" in text
    left = ask(["diagnose", table, "--card", "hrg-30mm"])["responses"]["frequency_Hz"]["shipped_rms"]
    assert f"{1e3 * left:.0f} mHz as given" in text
    told = {one["parameter"]: one for one in found["values"]}
    kept = {one["name"]: one for one in ask(["cards", card])["values"]}
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
