"""hrg simulate and hrg thermal as programs see them: exit status, JSON, files."""

import json

import pytest

from studies.cli import main


def test_thermal_prints_time_constants_and_temperatures(capsys):
    assert main(["thermal", "hrg-30mm", "step 20 -10 5h", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["schema"] == "hrg.thermal/1"
    assert set(answer) == {
        "schema", "card", "radiation", "time_constants_s", "shell_and_stem_time_constants_s",
        "slowest_time_constant_sensitivity", "energy_balance_error", "time_s", "chamber_temperature_degC",
        "temperature_degC",
    }  # fmt: skip
    assert answer["energy_balance_error"] < 1e-9
    assert set(answer["temperature_degC"]) == {"housing", "base", "stem", "shell", "rim"}
    assert answer["temperature_degC"]["shell"][-1] == pytest.approx(-10.0, abs=0.1)
    capacities = [v for k, v in answer["slowest_time_constant_sensitivity"].items() if k.startswith("capacity")]
    assert sum(capacities) == pytest.approx(1.0, rel=1e-9)
    assert main(["thermal", "hrg-30mm", "soak 20 1h", "--rows", "3"]) == 0
    assert "whole heat path" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulate", "hrg-30mm", "step 20 -90 5h", "--out", "x.csv"], "reaches -90 °C"),
        (["simulate", "hrg-30mm", "stepp 20 -10 5h", "--out", "x.csv"], "'stepp' is not a kind of profile"),
        (["simulate", "hrg-30mm", "soak 20 1h", "--out", "x.csv", "--row", "-1"], "time between rows must be positive"),
        (["simulate", "hrg-30mm", "soak 20 1h", "--out", "x.csv", "--seed", "-1"], "--seed"),
        (["simulate", "hrg-30", "soak 20 1h", "--out", "x.csv"], "did you mean 'hrg-30mm'"),
        (["thermal", "hrg-30mm", "soak 20 1h", "--rows", "1"], "--rows 1"),
        (["thermal", "hrg-30mm", "nothere.csv"], "there is no such file"),
    ],
)
def test_unusable_input_ends_with_status_2_and_one_sentence(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    answer = capsys.readouterr()
    assert answer.out == ""
    assert words in answer.err
    assert "Traceback" not in answer.err
    assert list(tmp_path.iterdir()) == []


def test_the_card_says_how_well_it_knows_a_run(tmp_path, capsys):
    """Frequency and bias within what the shipped uncertainties leave; the wide mount makes it more than any noise."""
    words = ["simulate", "hrg-30mm", "step 20 0 1h", "--out", str(tmp_path / "run.csv"), "--row", "50"]
    assert main([*words, "--spread", "--json"]) == 0
    spread = json.loads(capsys.readouterr().out)["spread"]
    assert set(spread) >= {"frequency_Hz", "bias_deg_per_h", "inverse_q", "housing_temperature_degC"}
    assert spread["frequency_Hz"] > 0.1
    assert main([*words[:3], "--out", str(tmp_path / "again.csv"), "--row", "50", "--spread"]) == 0
    assert "frequency_Hz" in capsys.readouterr().out
