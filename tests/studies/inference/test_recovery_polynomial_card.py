"""A card of a polynomial law: simulated, made from records alone, calibrated, written and read."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from compensation.noise import white_rms
from studies.calibration.calibrate import calibrate
from studies.calibration.observed import observe
from studies.cli import main
from studies.errors import InputError
from studies.inference.heat_path import with_lags, with_late_sensor
from studies.inference.polynomial_card import _likeliest_lag, polynomial_card
from studies.instrument.card import build_instrument, load_card, save_card
from studies.planning.plan import simulate_plan
from studies.record import Record, read_record
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run
from studies.workbench import simulate
from thermal.lag import lag

TRUE = {
    "schema": "hrg.card/1",
    "name": "truth",
    "law": {"f0_Hz": 4432.07, "a1_per_K": 8.1e-5, "a2_per_K2": -7e-8, "lag_s": 2000.0, "delay_s": 5.0},
    "bias": {"damping_anisotropy": 0.0, "k1_deg_per_h_per_Hz": 0.4, "k3_deg_per_h_per_Hz3": 0.003},
    "noise": {"housing_lag_s": 0.0},
}  # fmt: skip


def test_limits_one_lag_behind_the_housing() -> None:
    card = build_instrument(TRUE)
    run = simulate_run(card, load_profile("step 20 -10 4h"), 0.1, noise=False)
    t, housing, resonator = (
        run.record[name] for name in ("time_s", "housing_temperature_degC", "resonator_temperature_degC")
    )
    follows = lag(t, housing, 2000.0)
    assert np.abs(resonator - follows + 5.0 * np.gradient(follows, t)).max() < 2e-3
    x = resonator - 20.0
    assert run.record["frequency_Hz"] == pytest.approx(
        4432.07 * (1 + 8.1e-5 * x - 7e-8 * x**2), abs=3e-7
    )  # six digits of a temperature


@pytest.mark.parametrize("law", [{}, {"a3_per_K3": {"value": 2e-10, "sd": 1e-12}}])
def test_contract_a_longer_heat_path_keeps_what_a_card_of_bare_numbers_says(law) -> None:
    own = {"f0_Hz": 4432.07, "a1_per_K": {"value": 8.1e-5, "sd": 1e-5}, **law}
    card = build_instrument({"schema": "hrg.card/1", "name": "bare", "law": own})
    longer = with_late_sensor(with_lags(card, [1000.0, 500.0], True))
    assert longer.polynomial.lags == (1000.0, 500.0)
    assert longer.polynomial.coefficients == (8.1e-5, 0.0, law.get("a3_per_K3", {"value": 0.0})["value"])


@pytest.mark.slow
def test_recovery_of_the_law_from_records_alone(tmp_path) -> None:
    card = build_instrument(TRUE)
    words = ("step 20 -10 4h", "step -10 50 4h")
    records = [simulate_run(card, load_profile(w), 0.1, k).record for k, w in enumerate(words)]
    found = calibrate(polynomial_card(records), records, profile=False, keep=False)
    save_card(found.instrument, tmp_path / "found.toml")
    again = load_card(tmp_path / "found.toml")
    assert again.part("posterior").covered_degC == pytest.approx((-10.0, 50.0), abs=1.0)
    T = np.linspace(265.0, 320.0, 7)
    away = again.polynomial.frequency(T) - card.polynomial.frequency(T)
    assert np.abs(away).max() < 1e-6 * 4432.07
    for key, true in (("lag_s", 2000.0), ("chamber_lag_s", 600.0)):
        value = next(one for one in again.uncertain if one.name == f"law.{key}")
        assert abs(value.value - true) < 4 * value.sd + 1e-3 * true


@pytest.mark.parametrize(("words", "by"), [("step 20 -10 2h", None), ("soak -80 1h", 70), ("step 20 155 9h", 105)])
def test_contract_a_run_beyond_the_records_of_a_polynomial_card_says_so_once(tmp_path, ask, capsys, words, by) -> None:
    """A saved card went 105 K beyond the records that it stands on without a word."""
    card = build_instrument({**TRUE, "posterior": {"covered_degC": [-10.0, 50.0]}})
    run = simulate_run(card, load_profile(words), 0.1, noise=False)
    said = [one for one in run.warnings if "records behind" in one]
    assert len(said) == (by is not None)
    assert all(f"from -10 to 50 °C, and this run goes {by} K beyond" in one for one in said)
    path = str(tmp_path / "own.toml")
    save_card(card, path)
    told = ask(["simulate", path, words, "--row", "60", "--out", str(tmp_path / "run.csv")])
    assert [one for one in told["warnings"] if "records behind" in one] == said
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        simulate(path, words, row=60)
        simulate_plan(card, [words])
    assert [str(one.message) for one in heard] == 2 * said
    assert main(["twin", path, "--c", str(tmp_path / "twin")]) == 0
    assert "this twin goes 120 K beyond" in capsys.readouterr().out


def test_recovery_of_the_lag_where_one_response_leaks() -> None:
    """Without a frequency the lag is that of bias and 1/Q together: a leak that doubles 1/Q alone made it 2.5 times as long."""
    card, runs = build_instrument(TRUE | {"loss": {"inverse_q": 1e-7, "slope_per_K": 4e-3}}), []
    for k, words in enumerate(("step 20 -10 3h", "step -10 40 3h", "step 40 10 3h")):
        record = simulate_run(card, load_profile(words), 0.05, k).record
        leaks = record["inverse_q"] * (1 + 0.4 * (record["time_s"] / 10800 + k))
        kept = {name: record[name] for name in ("time_s", "housing_temperature_degC", "bias_deg_per_h")}
        runs += observe([Record(kept | {"inverse_q": leaks})], blocks=120)
    assert _likeliest_lag(runs, ["inverse_q"], 288.15) > 4000.0
    assert _likeliest_lag(runs, ["inverse_q", "bias_deg_per_h"], 288.15) == pytest.approx(2000.0, rel=0.3)


def test_contract_a_card_says_nothing_of_a_response_that_no_record_had(tmp_path) -> None:
    """Records of the bias alone make a card that simulates neither frequency nor 1/Q, until it is calibrated with records that have it."""
    card = build_instrument(TRUE)
    words = ("step 20 -10 3h", "step -10 40 3h")
    whole = [simulate_run(card, load_profile(w), 0.05, k).record for k, w in enumerate(words)]
    kept = ("time_s", "housing_temperature_degC", "bias_deg_per_h")
    alone = [Record({name: one[name] for name in kept}) for one in whole]
    saved = tmp_path / "saved.toml"
    save_card(calibrate(polynomial_card(alone), alone, profile=False, keep=False).instrument, saved)
    with pytest.warns(UserWarning, match="frequency_Hz or inverse_q: it says nothing of them"):
        columns = simulate(saved, "step 20 0 1h", row=60).columns
    assert "bias_deg_per_h" in columns
    assert not {"frequency_Hz", "inverse_q"} & set(columns)
    more = [Record({name: one[name] for name in (*kept, "inverse_q")}) for one in whole]
    again = calibrate(load_card(saved), more, profile=False, keep=False).instrument
    assert again.part("posterior").unseen == ("frequency_Hz",)


def test_contract_a_card_has_one_law() -> None:
    with pytest.raises(InputError, match=r"either \[law\] or \[thermal\]"):
        build_instrument({**TRUE, "thermal": {"cells": 1}})
    with pytest.raises(InputError, match="f0_Hz"):
        build_instrument({**TRUE, "law": {"lag_s": 100.0}})
    with pytest.raises(InputError, match="needs a card with"):
        _ = build_instrument(TRUE).resonator


@pytest.mark.slow
@pytest.mark.usefixtures("fine")
def test_recovery_of_a_hidden_effect_without_a_card_and_of_an_unseen_run(tmp_path, capsys, ask) -> None:
    hidden = {"name": "rate-bias", "response": "bias_deg_per_h", "coefficient_deg_per_h_per_K_per_s": 600.0}
    device = build_instrument({**TRUE, "effect": [hidden]})
    save_card(device, tmp_path / "device.toml")
    words = ("step 20 -10 3h then ramp -10 30 1 then soak 30 2h", "cycle 20 -15 40 0.5 30min 1")
    runs = []
    for k, profile in enumerate(words):
        runs.append(str(tmp_path / f"run{k}.csv"))
        simulate = ["simulate", str(tmp_path / "device.toml"), profile, "--row", "60", "--seed", str(k)]
        assert main([*simulate, "--out", runs[-1]]) == 0
    capsys.readouterr()
    saved = tmp_path / "saved.toml"
    verdict = ask(["diagnose", *runs, "--save", str(saved)])
    (cause,) = verdict["causes"]
    assert "rate-bias" in (cause["effect"], *cause["equivalent"])
    read, again = read_record(runs[0]), simulate_run(load_card(saved), load_profile(words[0]), 1 / 60, 9).record
    for column in ("frequency_Hz", "bias_deg_per_h", "inverse_q"):  # the saved noise was up to 18 times too much
        assert white_rms(again[column]) == pytest.approx(white_rms(read[column]), rel=0.2), column
    unseen = load_profile("ramp 25 -5 1 then soak -5 1h then ramp -5 35 2 then soak 35 2h")
    true, own = (simulate_run(card, unseen, 0.05, noise=False).record for card in (device, load_card(saved)))
    noise = verdict["responses"]["bias_deg_per_h"]["noise"]
    for column, size in (("frequency_Hz", 2e-3), ("bias_deg_per_h", noise)):
        rest = true[column] - own[column]
        assert np.std(rest) < size, column


def test_the_deeper_of_two_valleys_is_the_lag_where_the_grid_stands_on_the_wall_of_a_narrow_one(monkeypatch):
    """An independent simulator's record had a broad valley at 2550 s, and at its lag of 1139 s a deeper one that the grid misses."""

    def left(runs, column, tau, x0, apart):
        narrow, broad = 1500.0 * np.log(tau / 1139.0) ** 2, 5.0 + 30.0 * np.log(tau / 2550.0) ** 2
        return np.zeros(1), min(narrow, broad)

    monkeypatch.setattr("studies.inference.polynomial_card._fit", left)
    monkeypatch.setattr("studies.inference.polynomial_card.USUAL_SPREAD", 1e6)
    run = SimpleNamespace(inner=SimpleNamespace(time=np.array([0.0, 3e4])))
    assert _likeliest_lag([run], ["frequency_Hz"], 283.15) == pytest.approx(1139.0, rel=1e-3)
