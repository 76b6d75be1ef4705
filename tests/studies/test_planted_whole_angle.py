"""`hrg loop` makes a whole-angle run of a card, `hrg fit whole-angle` finds the card's values in it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.calibration.calibrate import calibrate
from studies.cli import main
from studies.instrument.card import load_card, shipped_cards
from studies.record import Record, read_record, write_record

INPUTS = Path(__file__).parents[1] / "golden" / "inputs"
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


def test_card_values_are_found_again(tmp_path, capsys, ask):
    card, run = str(tmp_path / "card.toml"), str(tmp_path / "run.csv")
    text = shipped_cards()["free-dome"].read_text() + LOOP
    (tmp_path / "card.toml").write_text(text + "self_precession_deg_per_s = 0.5\npickoff_gain_ratio = 0.008\n")
    assert main(["loop", card, "--out", run, "--hours", "1", "--row", "2", "--both-ways"]) == 0
    capsys.readouterr()
    (tmp_path / "card.toml").write_text(text)
    saved = str(tmp_path / "found.toml")
    found = ask(["fit", "whole-angle", run, "--card", card, "--save", saved])
    assert found["schema"] == "hrg.fit-whole-angle/1"
    assert found["undetermined"] == []
    truth = {
        "bias.damping_anisotropy": 0.03, "loop.frequency_split_mHz": 5.0, "loop.pickoff_gain_ratio": 0.008,
        "loop.pickoff_phase_deg": 0.6, "loss.inverse_q": 1e-6, "bias.damping_axis_deg": 10.0,
        "loop.frequency_axis_deg": -6.0,
    }  # fmt: skip
    for key, value in truth.items():
        assert found["estimates"][key]["value"] == pytest.approx(value, rel=0.02), key
        assert list(found["estimates"][key]) == ["value", "sd", "low", "high"]
    again = load_card(saved)
    assert again.bias.damping_anisotropy == pytest.approx(0.03, rel=0.02)
    stated = {value.name: value.sd for value in again.uncertain}
    assert stated["loop.frequency_split_mHz"] == pytest.approx(found["estimates"]["loop.frequency_split_mHz"]["sd"])


@pytest.mark.parametrize("row", [5.0, 30.0])
def test_a_rate_that_steps_within_rows_moves_no_estimate(tmp_path, ask, row):
    """A rate table holds rates of −15 to 15 °/s for about 2 min: with rows of 30 s the damping was 10 deviations off, with 5 s its axis."""
    text = shipped_cards()["free-dome"].read_text() + LOOP
    card = tmp_path / "card.toml"
    card.write_text(text + "self_precession_deg_per_s = 0.5\npickoff_gain_ratio = 0.008\n")
    draw, t, rows = np.random.default_rng(50), 0.0, ["time_s,chamber_temperature_degC,rate_deg_per_s", "0,20,0"]
    for rate in (5, 0, -5, 10, -10, 2, -2, 0, 15, -15, 7, -7, 0, 3, -3, 0, 12, -12, 0, 4, -4, 0):
        rows += [f"{t + 130.0:.1f},20,{rows[-1].rpartition(',')[2]}", f"{t + 132.0:.1f},20,{rate}"]
        t += 132.0 + draw.uniform(0, 9)
    (tmp_path / "rates.csv").write_text("\n".join(rows) + "\n")
    run = tmp_path / "run.csv"
    assert (
        main(["simulate", str(card), str(tmp_path / "rates.csv"), "--row", str(row), "--seed", "3", "--out", str(run)])
        == 0
    )
    found = ask(["fit", "whole-angle", str(run), "--card", str(card)])["estimates"]
    truth = {"bias.damping_anisotropy": 0.03, "loop.frequency_split_mHz": 5.0, "loop.pickoff_gain_ratio": 0.008,
             "loop.pickoff_phase_deg": 0.6, "bias.damping_axis_deg": 10.0, "loop.frequency_axis_deg": -6.0}  # fmt: skip
    for key, value in truth.items():
        assert found[key]["value"] == pytest.approx(value, abs=3 * found[key]["sd"]), key
        assert found[key]["sd"] < 0.04 * abs(value), key


def test_what_is_missing_is_said(tmp_path, refuse):
    path = str(tmp_path / "run.csv")
    time = np.arange(0.0, 400.0)
    write_record(Record({"time_s": time, "pattern_angle_deg": 0.5 * time, "bias_deg_per_h": 0 * time}), path)
    assert "give --bryan-factor" in refuse(["fit", "whole-angle", path])
    write_record(Record({"time_s": time, "pattern_angle_deg": 0.01 * time, "bias_deg_per_h": 0 * time}), path)
    assert "the fit needs more than 90°" in refuse(["fit", "whole-angle", path, "--bryan-factor", "0.277"])


def test_an_applied_rate_is_no_bias(tmp_path, ask):
    """bias_deg_per_h is free of the applied rate, as measured_rate_deg_per_s is not."""
    record = read_record(INPUTS / "wave.csv")
    path, found = str(tmp_path / "run.csv"), []
    still = {"rate_deg_per_s": np.full(len(record), 1e-3)}
    for columns in ({}, still, still | {"measured_rate_deg_per_s": 1e-3 + record["bias_deg_per_h"] / 3600}):
        write_record(record.with_columns(columns), path)
        estimates = ask(["fit", "whole-angle", path, "--card", str(INPUTS / "wave.toml")])["estimates"]
        found.append(estimates["bias.offset_deg_per_h"]["value"])
    assert found == pytest.approx(found[:1] * 3, abs=1e-3)


def test_columns_that_contradict_each_other_are_named_and_no_card_is_saved(tmp_path, capsys):
    record = read_record(INPUTS / "wave.csv")
    path, saved = str(tmp_path / "run.csv"), tmp_path / "card.toml"
    write_record(record.with_columns({"quadrature_V": -record["quadrature_V"]}), path)
    words = ["fit", "whole-angle", path, "--card", str(INPUTS / "wave.toml"), "--save", str(saved)]
    assert main([*words, "--json"]) == 2
    told = capsys.readouterr()
    assert "not saved: its columns contradict each other" in told.err
    assert not saved.exists()
    found = json.loads(told.out)
    assert found["contradictions"] == [
        "frequency_Hz and quadrature_V contradict each other about the frequency split, which is not estimated."
        " They would agree: reverse the sign of quadrature_V."
    ]
    assert "loop.frequency_split_mHz" not in found["estimates"]
    assert found["alone"]["frequency_Hz"]["loop.frequency_axis_deg"]["value"] == pytest.approx(-6.0, abs=0.02)


def test_where_the_moment_of_the_angle_matters_it_is_said(tmp_path, capsys):
    """The run of the loops, its source unknown: gains of 0.008 at 0.5 °/s make a damping of ½ δ ẋ² s of half a row s."""
    record = read_record(INPUTS / "wave.csv")
    path = str(tmp_path / "run.csv")
    write_record(replace(record, source=""), path)
    words = ["fit", "whole-angle", path, "--card", str(INPUTS / "wave.toml")]
    for more, said in (([], True), (["--angle-at", "start"], False)):
        assert main([*words, *more]) == 0
        assert ("give --angle-at middle" in " ".join(capsys.readouterr().out.split())) == said


@pytest.mark.slow
def test_calibrate_finds_splits_axes_gains_and_phase_in_a_whole_angle_run(tmp_path, capsys):
    """A run through the loops, turned both ways; gains and phases of pick-offs and drives are told by their sums alone."""
    text = shipped_cards()["free-dome"].read_text() + LOOP + "self_precession_deg_per_s = 0.5\n"
    truth, card, run = tmp_path / "truth.toml", tmp_path / "card.toml", str(tmp_path / "run.csv")
    truth.write_text(text + "pickoff_gain_ratio = 0.008\n")
    card.write_text(text.replace("= 0.03", "= 0.02").replace("= 10.0", "= 5.0").replace("= 5.0\nf", "= 4.0\nf"))
    assert "damping_axis_deg = 5.0" in card.read_text()
    assert main(["loop", str(truth), "--out", run, "--hours", "0.4", "--row", "1", "--both-ways", "--seed", "3"]) == 0
    instrument = load_card(card)
    open_ = ("loss.", "bias.damping", "loop.", "bias.offset")
    exact = [one.name for one in instrument.uncertain if not one.name.startswith(open_)]
    found = calibrate(instrument, [read_record(run)], exact=exact, profile=False)
    values = {one.parameter: one.value for one in found.estimates}
    assert values["loss.inverse_q"] == pytest.approx(1e-6, rel=1e-3)
    assert values["bias.damping_anisotropy"] == pytest.approx(0.03, rel=0.02)
    assert values["bias.damping_axis_deg"] == pytest.approx(10.0, abs=0.02 * 14.3)
    assert values["loop.frequency_split_mHz"] == pytest.approx(5.0, rel=0.02)
    assert values["loop.frequency_axis_deg"] == pytest.approx(-6.0, abs=0.02 * 14.3)
    for key, total in (("gain_ratio", 0.008), ("phase_deg", 0.6)):
        pair = f"loop.pickoff_{key}", f"loop.drive_{key}"
        assert values[pair[0]] + values[pair[1]] == pytest.approx(total, rel=0.02)
        assert any(set(pair) <= set(group) for group in found.groups)
