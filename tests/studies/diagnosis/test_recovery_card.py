"""A card's own simulation as the baseline: nothing, a wrong value, and a hidden effect are told apart; what is saved predicts."""

import json
from dataclasses import replace

import numpy as np
import pytest

from studies.cli import main
from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.investigate import investigate
from studies.diagnosis.simulated import simulate_baseline
from studies.diagnosis.stated import without_rate_terms
from studies.effects import find_effect
from studies.instrument.card import load_card, save_card
from studies.record import read_record
from studies.simulation.chamber import load_profile
from studies.simulation.drive import drive_by_profile, rows_of
from studies.simulation.prediction import predict
from studies.simulation.virtual_gyro import simulate_run
from tests.benchmarks.diagnosis.unseen import DEVIATIONS, PACKS, TURN_ON, B, lacking, recover

PROFILES = ("cycle 20 -15 40 0.5 30min 1", "step 20 -10 3h then ramp -10 30 1 then soak 30 2h")


def simulated(card, folder, capsys, profiles=PROFILES):
    """Return the records of a card's virtual runs through the profiles."""
    path = folder / "card.toml"
    save_card(card, path)
    records = []
    for k, words in enumerate(profiles):
        out = folder / f"run{k}.csv"
        assert main(["simulate", str(path), words, "--out", str(out), "--row", "20", "--seed", str(k)]) == 0
        records.append(read_record(str(out)))
    capsys.readouterr()
    return records


@pytest.fixture(scope="module")
def shipped():
    return load_card("hrg-30mm")


def test_derivatives_serve_as_far_as_a_straight_line_foretells(shipped, tmp_path, capsys):
    records = simulated(shipped, tmp_path, capsys, ("step 20 -10 1h",))
    here = simulate_baseline(load_campaign(records, 20.0), shipped, 1e-3)
    names = [value.name for value in here.values]
    place, still = names.index("thermal.film_emissivity"), dict.fromkeys(names, 0.0)
    still |= {"initial.base@0": 0.0, "initial.resonator@0": 0.0}
    for z, anew in ((0.02, False), (1.0, True)):
        moved = here.moved(still | {names[place]: z}, None)
        there = replace(here, z=tuple(z if n == place else 0.0 for n in range(len(names))))
        found, _ = there.predicted(0)
        kept = found.derivatives is here.predicted(0)[0].derivatives
        exact = predict(there.instrument, there.drive(0)[0], (), there.law).columns["frequency_Hz"]
        np.testing.assert_allclose(found.columns["frequency_Hz"], exact, atol=1e-9)
        assert kept is not anew
        assert (moved.z[place] == 0.0) is not anew


@pytest.mark.slow
def test_a_virtual_record_of_the_card_is_adequate(shipped, tmp_path, capsys):
    verdict = investigate(load_campaign(simulated(shipped, tmp_path, capsys), 20.0), card=shipped, advise=False).verdict
    assert verdict.verdict == "adequate", verdict.causes
    assert max(abs(shift.shift_sd) for shift in verdict.calibration) < 1.0


def test_what_the_card_says_of_the_bias_by_rate_is_not_found_as_an_effect(shipped, tmp_path, capsys):
    """The free terms of a bias are static; a card's own k4 was once left in the record and named rate-bias."""
    stated = shipped.with_table("bias", {"k1_deg_per_h_per_Hz": 0.2, "k4_deg_per_h_s_per_Hz": 300.0})
    static = shipped.with_table("bias", {"k1_deg_per_h_per_Hz": 0.2})
    both = []
    for card in (stated, static):
        save_card(card, tmp_path / "card.toml")
        words = ["simulate", str(tmp_path / "card.toml"), PROFILES[1], "--row", "20", "--noiseless"]
        assert main([*words, "--out", str(tmp_path / "run.csv")]) == 0
        both.append(load_campaign([read_record(str(tmp_path / "run.csv"))], 20.0))
    capsys.readouterr()
    left = without_rate_terms(both[0], simulate_baseline(both[0], stated, 1e-3))
    (with_rate,), (cleaned,), (without,) = (campaign.runs for campaign in (both[0], left, both[1]))
    by_rate = with_rate.responses["bias_deg_per_h"] - without.responses["bias_deg_per_h"]
    size = np.nanmax(by_rate) - np.nanmin(by_rate)
    assert size > 0.5
    rest = cleaned.responses["bias_deg_per_h"] - without.responses["bias_deg_per_h"]
    assert np.nanmax(np.abs(rest)) < 0.05 * size
    own = cleaned.row_responses["bias_deg_per_h"] - without.row_responses["bias_deg_per_h"]
    assert np.nanmax(np.abs(own)) < 0.1 * size
    assert left.runs[0].responses["frequency_Hz"] is with_rate.responses["frequency_Hz"]


@pytest.mark.slow
def test_what_a_loss_peak_does_to_the_bias_is_no_second_cause():
    """Anisotropy of damping makes bias of 1/Q (Lynch 1995): a peak of the one was once named cross-damping in the other too."""
    card = load_card("cvg-25mm")
    peak = {"name": "loss-peak", "response": "inverse_q", "temperature_degC": 8.0, "width_K": 6.0, "peak_1": 1e-6}
    device = card.with_table("effect", [peak])
    drives = [drive_by_profile(profile, rows_of(profile, 0.05)) for profile in map(load_profile, PROFILES)]
    runs = [simulate_run(device, drive, seed=k).record for k, drive in enumerate(drives)]
    few = [find_effect(name) for name in ("loss-peak", "cross-damping", "activity-dip", "mounting-stress")]
    found = investigate(load_campaign(runs, 20.0), few, card=card, advise=False)
    assert [cause.effect for cause in found.verdict.causes] == ["loss-peak"], found.verdict.causes
    carried = np.ptp(np.concatenate(found.inquiries["bias_deg_per_h"].final.baseline.carried))
    stated = card.content["bias"]["damping_anisotropy"]["value"]
    frequency, bryan = np.median(runs[0]["frequency_Hz"]), simulate_run(card, drives[0], noise=False).law.bryan_factor
    largest = np.degrees(stated * np.pi * frequency * peak["peak_1"] / (4.0 * bryan)) * 3600.0
    assert carried == pytest.approx(largest, rel=0.2)


@pytest.mark.slow
def test_an_effect_is_not_taken_for_values_far_from_the_card():
    """A gradient's dT/dt was once fitted as eleven standard deviations of the housing's lag, with other causes to mend it."""
    card = load_card("bvg-bell")
    slope = {"name": "rate-frequency", "response": "frequency_Hz", "coefficient_Hz_per_K_per_s": 60.0}
    drive = drive_by_profile(profile := load_profile("cycle 20 5 40 1 30min 1"), rows_of(profile, 0.05))
    run = simulate_run(card.with_table("effect", [slope]), drive, seed=5).record
    few = [find_effect(name) for name in ("rate-frequency", "mounting-stress", "second-lag", "thermometer-scale")]
    verdict = investigate(load_campaign([run], 20.0), few, card=card, advise=False).verdict
    assert "rate-frequency" in verdict.causes[0].names, verdict.causes
    assert {cause.kind for cause in verdict.causes} == {"physics"}


@pytest.mark.slow
def test_a_strong_effect_leaves_the_values_alone():
    """Beside an amplitude-frequency effect of a hundred times the noise, priors of the first fit's scale let three values go far."""
    card, runs = load_card("bvg-bell"), []
    effect = {"name": "amplitude-frequency", "response": "frequency_Hz", "slope_Hz_per_V2": 0.03}
    few = [find_effect(name) for name in ("amplitude-frequency", "mounting-stress", "second-lag", "thermometer-scale")]
    for k, words in enumerate(("cycle 20 5 40 1 30min 1", "step 20 35 2h then ramp 35 0 1 then soak 0 90min")):
        drive, rng = (
            drive_by_profile(profile := load_profile(words), rows_of(profile, 0.05)),
            np.random.default_rng(k + 3),
        )
        held = rng.uniform(0.5, 2.0, 40)[np.searchsorted(np.cumsum(rng.uniform(1200.0, 4000.0, 40)), drive.time)]
        drive = replace(drive, commands={"amplitude_squared": held})
        runs.append(simulate_run(card.with_table("effect", [effect]), drive, seed=k).record)
    verdict = investigate(load_campaign(runs, 20.0), few, card=card, advise=False).verdict
    assert [(cause.kind, cause.effect) for cause in verdict.causes] == [("physics", "amplitude-frequency")]
    assert max(abs(shift.shift_sd) for shift in verdict.calibration) < 2.0


@pytest.mark.slow
def test_a_wrong_value_is_named_as_one(shipped, tmp_path, capsys):
    """The glass stiffens with temperature by four standard deviations of its law more than the card says."""
    name = "material.deviation.shear_modulus.log_slope_per_K"
    value = next(v for v in shipped.uncertain if v.name == name)
    true = shipped.with_values({name: 4.0 * value.sd})
    verdict = investigate(load_campaign(simulated(true, tmp_path, capsys), 20.0), card=shipped, advise=False).verdict
    assert {cause.kind for cause in verdict.causes} == {"value"}
    assert [cause.effect for cause in verdict.causes] == [name], verdict.causes
    found = next(shift for shift in verdict.calibration if shift.parameter == name)
    assert found.low <= 4.0 * value.sd <= found.high or abs(found.shift_sd - 4.0) < 0.2
    frequency = verdict.as_dict()["responses"]["frequency_Hz"]
    assert frequency["verdict"] == "explained"
    assert frequency["shipped_rms"] > 20.0 * frequency["baseline"]["residual_rms"]


TRIED = (*PACKS[2:9], PACKS[10], PACKS[14], PACKS[16])
"""Each kind of effect in one response or more; `bench_recovery` hides every effect in every response."""


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_grid")
@pytest.mark.parametrize("cases", TRIED, ids=lambda cases: ", ".join(f"{name} {column[0]}" for name, column in cases))
def test_hidden_effects_are_named_saved_and_predict_an_unseen_chamber_profile(cases):
    """Within 10 % of the noise, or of what 95 % of draws leave, as the saved card states it."""
    found = recover(*cases, stated=TURN_ON if ("ageing", B) in cases else None)
    assert found.named, found.names
    assert all(found.before[response] > 5.0 for name, response in cases if not find_effect(name).once)
    for response, left in found.after.items():
        assert left < 1.1 or found.errors[response] < DEVIATIONS, (response, found.after, found.stated)


def test_every_effect_is_hidden_in_every_response():
    assert not lacking()


@pytest.mark.slow
def test_what_has_not_converged_is_no_card(shipped, tmp_path, capsys, monkeypatch):
    """Two steps do not reach what the records say: the answer is given, the card is not written."""
    simulated(shipped.with_table("bias", {"k1_deg_per_h_per_Hz": 0.2}), tmp_path, capsys, ("step 20 -10 1h",))
    words = [
        "diagnose",
        str(tmp_path / "run0.csv"),
        "--card",
        "hrg-30mm",
        "--save",
        str(tmp_path / "out.toml"),
        "--json",
    ]
    monkeypatch.setattr("studies.calibration.fit.MOST_STEPS", 2)
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert json.loads(out)["extended_model"] is None
    assert "not saved" in err
    assert not (tmp_path / "out.toml").exists()
