"""`hrg loop` makes a whole-angle run of a card, `hrg fit whole-angle` finds the card's values in it."""

import json

import numpy as np
import pytest

from studies.cli import main
from studies.instrument.card import load_card, shipped_cards
from studies.record import Record, write_record

LOOP = """
[loss]
inverse_q = 1e-6
[bias]
damping_anisotropy = 0.03
damping_axis_deg = 10.0
[loop]
mode = "whole-angle"
frequency_split_mHz = 5.0
frequency_axis_deg = -6.0
pickoff_phase_deg = 0.6
"""


def test_card_values_are_found_again(tmp_path, capsys):
    card, run = str(tmp_path / "card.toml"), str(tmp_path / "run.csv")
    text = shipped_cards()["free-dome"].read_text() + LOOP
    (tmp_path / "card.toml").write_text(text + "self_precession_deg_per_s = 0.5\npickoff_gain_ratio = 0.008\n")
    assert main(["loop", card, "--out", run, "--hours", "1", "--row", "2", "--both-ways"]) == 0
    capsys.readouterr()
    (tmp_path / "card.toml").write_text(text)
    saved = str(tmp_path / "found.toml")
    assert main(["fit", "whole-angle", run, "--card", card, "--json", "--save", saved]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "hrg.fit-whole-angle/1"
    assert found["undetermined"] == []
    truth = {
        "bias.damping_anisotropy": 0.03,
        "loop.frequency_split_mHz": 5.0,
        "loop.pickoff_gain_ratio": 0.008,
        "loop.pickoff_phase_deg": 0.6,
        "loss.inverse_q": 1e-6,
        "bias.damping_axis_deg": 10.0,
        "loop.frequency_axis_deg": -6.0,
    }
    for key, value in truth.items():
        assert found["estimates"][key]["value"] == pytest.approx(value, rel=0.02), key
        assert list(found["estimates"][key]) == ["value", "sd", "low", "high"]
    again = load_card(saved)
    assert again.bias.damping_anisotropy == pytest.approx(0.03, rel=0.02)
    stated = {value.name: value.sd for value in again.uncertain}
    assert stated["loop.frequency_split_mHz"] == pytest.approx(found["estimates"]["loop.frequency_split_mHz"]["sd"])


def test_what_is_missing_is_said(tmp_path, capsys):
    path = str(tmp_path / "run.csv")
    time = np.arange(0.0, 400.0)
    write_record(Record({"time_s": time, "pattern_angle_deg": 0.5 * time, "bias_deg_per_h": 0 * time}), path)
    assert main(["fit", "whole-angle", path]) == 2
    assert "give --bryan-factor" in capsys.readouterr().err
    write_record(Record({"time_s": time, "pattern_angle_deg": 0.01 * time, "bias_deg_per_h": 0 * time}), path)
    assert main(["fit", "whole-angle", path, "--bryan-factor", "0.277"]) == 2
    assert "the fit needs 90°" in capsys.readouterr().err
