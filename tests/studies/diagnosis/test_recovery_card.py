"""A card's own simulation as the baseline: nothing, a wrong value, and a hidden effect are told apart; what is saved predicts."""

import json
from dataclasses import replace

import numpy as np
import pytest

from compensation.noise import Noise
from studies.calibration.apart import APART
from studies.cli import main
from studies.effects import find_effect
from studies.inference.extension import extend
from studies.instrument.card import load_card
from studies.record import write_record
from studies.simulation.chamber import load_profile
from studies.simulation.drive import drive_by_profile, rows_of
from studies.simulation.virtual_gyro import simulate_run
from studies.workbench import diagnose_records
from tests.studies.diagnosis.unseen import CASES, DEVIATIONS, PROFILES, UNSEEN, recover

ROW = 0.05
SLOPE = "material.deviation.shear_modulus.log_slope_per_K"


def simulated(card, *profiles, seed=0):
    """Return the records of a card's virtual runs through profiles in words."""
    drives = [drive_by_profile(one, rows_of(one, ROW)) for one in map(load_profile, profiles)]
    return [replace(simulate_run(card, d, seed=seed + k).record, path=f"run{k}") for k, d in enumerate(drives)]


def frequencies(runs, *besides):
    """Return runs with frequency, temperatures and commands alone, but for the columns that are left out."""
    left_out = {"bias_deg_per_h", "inverse_q", "quadrature_V", *besides}
    return [replace(run, columns={k: v for k, v in run.columns.items() if k not in left_out}) for run in runs]


pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def few(coarser):
    """Few means, but where a test asks for all (`fine`)."""


@pytest.fixture(scope="module")
def shipped():
    """A shell of ten cells, in what is simulated as in what is fitted."""
    return load_card("hrg-30mm").with_values({"thermal.cells": 10})


def test_a_virtual_record_of_the_card_is_adequate(shipped):
    """With a bias by rate too: a card's own k4 was once left in the record and named rate-bias."""
    stated = shipped.with_table("bias", {"k1_deg_per_h_per_Hz": 0.2, "k4_deg_per_h_s_per_Hz": 300.0})
    verdict = diagnose_records(simulated(stated, *PROFILES), stated).verdict
    assert (verdict.verdict, verdict.causes) == ("adequate", ())
    assert max(abs(shift.shift_sd) for shift in verdict.calibration) < 1.0


def test_a_set_point_that_the_air_follows_late_is_no_second_lag(shipped, only):
    """A minute between set point and housing was read as a slow sensor, carried into the frequency and mended by a second lag."""
    only("second-lag", "thermometer-lag")
    runs = simulated(shipped, PROFILES[1])
    name = "chamber_temperature_degC"
    early = [run.with_columns({name: np.interp(run["time_s"] + 60.0, run["time_s"], run[name])}) for run in runs]
    verdict = diagnose_records(early, shipped).verdict
    assert (verdict.verdict, verdict.causes) == ("adequate", ())
    assert APART in verdict.notes


def test_what_a_loss_peak_does_to_the_bias_is_no_second_cause(only):
    """Anisotropy of damping makes bias of 1/Q (Lynch 1995): a peak of the one was once named cross-damping in the other too."""
    card = load_card("cvg-25mm").with_values({"thermal.cells": 10})
    peak = {"name": "loss-peak", "response": "inverse_q", "temperature_degC": 8.0, "width_K": 6.0, "peak_1": 1e-6}
    only("loss-peak", "cross-damping", "activity-dip", "mounting-stress")
    runs = simulated(card.with_table("effect", [peak]), *PROFILES)
    found = diagnose_records(runs, card)
    assert [cause.effect for cause in found.verdict.causes] == ["loss-peak"], found.verdict.causes
    carried = np.ptp(found.final.terms[0].columns["bias_deg_per_h"] @ found.background.coefficients(0)[0])
    stated = card.content["bias"]["damping_anisotropy"]["value"]
    frequency, law = np.median(runs[0]["frequency_Hz"]), simulate_run(card, load_profile("soak 20 1h")).law
    largest = np.degrees(stated * np.pi * frequency * peak["peak_1"] / (4.0 * law.bryan_factor)) * 3600.0
    assert carried == pytest.approx(largest, rel=0.2)


def test_an_effect_is_not_taken_for_values_far_from_the_card(only):
    """A gradient's dT/dt was once fitted as eleven standard deviations of the housing's lag, with other causes to mend it."""
    card = load_card("bvg-bell").with_values({"thermal.cells": 10})
    slope = {"name": "rate-frequency", "response": "frequency_Hz", "coefficient_Hz_per_K_per_s": 60.0}
    only("rate-frequency", "mounting-stress", "second-lag", "thermometer-scale")
    runs = frequencies(simulated(card.with_table("effect", [slope]), "cycle 20 5 40 1 30min 1", seed=5))
    verdict = diagnose_records(runs, card).verdict
    assert "rate-frequency" in verdict.causes[0].names, verdict.causes
    assert {cause.kind for cause in verdict.causes} == {"physics"}


def test_what_leads_in_straight_lines_is_not_taken_before_its_rivals_are_followed(only):
    """A gradient's dT/dt of a device far from its card, its housing not measured: two values of the card were named, and the rest was unexplained."""
    card = load_card("cvg-25mm").with_values({"thermal.cells": 10})
    own = {"mount_conductance_W_per_K": 0.2, "film_emissivity": 0.34, "chamber_conductance_W_per_K": 0.055}
    slope = {"name": "rate-frequency", "response": "frequency_Hz", "coefficient_Hz_per_K_per_s": -100.0}
    only("rate-frequency", "mounting-stress", "second-lag", "thermometer-scale")
    device = card.with_table("thermal", card.content["thermal"] | own).with_table("effect", [slope])
    runs = simulated(device, "cycle 22 -12 38 2 40min 1", seed=3)
    causes = diagnose_records(frequencies(runs, "housing_temperature_degC"), card).verdict.causes
    assert [(cause.kind, cause.effect) for cause in causes] == [("physics", "rate-frequency")]


WAYS = ("cycle 20 -10 40 1 30min 1", "step 20 35 2h then ramp 35 0 1 then soak 0 90min")


def test_a_dip_is_one_cause_in_frequency_and_loss(shipped, only):
    """In drawn devices a dip of 1/Q far above its noise spared ever more rows of 1/Q once that of the frequency was left out, which then seemed idle.

    So it was in six of six; with this one, three or four of the six are right.
    """
    only("activity-dip", "loss-peak", "jump", "hysteresis")
    rng = np.random.default_rng(0)
    known = [one for one in shipped.uncertain if one.name.startswith(("thermal.", "material.")) and one.value]
    drawn = {one.name: one.draw(rng) for one in known}
    dip = {"name": "activity-dip", "temperature_degC": 14.0, "width_K": 0.7}
    dips = [{**dip, "response": "frequency_Hz", "pull_Hz": 0.0126}, {**dip, "response": "inverse_q", "pull_1": 1e-6}]
    runs = simulated(shipped.with_values(drawn).with_table("effect", dips), *WAYS)
    left_out = {"bias_deg_per_h", "quadrature_V", "chamber_temperature_degC"}
    runs = [replace(run, columns={k: v for k, v in run.columns.items() if k not in left_out}) for run in runs]
    verdict = diagnose_records(runs, shipped).verdict
    assert {name: result.verdict for name, result in verdict.responses.items()} == dict.fromkeys(
        ("frequency_Hz", "inverse_q"), "explained"
    )
    assert [cause.effect for cause in verdict.causes if cause.kind == "physics"] == ["activity-dip"]


def driven(card, seed=0):
    """Return two runs whose frequency follows steps of the amplitude."""
    effect = {"name": "amplitude-frequency", "response": "frequency_Hz", "slope_Hz_per_V2": 0.03}
    runs = []
    for k, words in enumerate(("cycle 20 5 40 1 30min 1", "step 20 35 2h then ramp 35 0 1 then soak 0 90min")):
        rng = np.random.default_rng(100 * seed + k + 3)
        drive = drive_by_profile(one := load_profile(words), rows_of(one, ROW))
        held = rng.uniform(0.5, 2.0, 40)[np.searchsorted(np.cumsum(rng.uniform(1200.0, 4000.0, 40)), drive.time)]
        drive = replace(drive, commands={"amplitude_squared": held})
        runs.append(simulate_run(card.with_table("effect", [effect]), drive, seed=10 * seed + k).record)
    return frequencies(runs)


def test_a_strong_effect_leaves_the_values_alone(only):
    """Beside an amplitude-frequency effect of a hundred times the noise, priors of the first fit's scale let three values go far."""
    card = load_card("bvg-bell").with_values({"thermal.cells": 10})
    only("amplitude-frequency", "mounting-stress", "second-lag", "thermometer-scale")
    verdict = diagnose_records(driven(card), card).verdict
    assert [(cause.kind, cause.effect) for cause in verdict.causes] == [("physics", "amplitude-frequency")]
    assert max(abs(shift.shift_sd) for shift in verdict.calibration) < 2.0


def test_bursts_of_outliers_beside_an_effect_are_no_jump(only):
    """What stood out was settled before the effect was known: bursts that hid beside it were then named as jumps and dips."""
    card = load_card("bvg-bell").with_values({"thermal.cells": 10})
    only("amplitude-frequency", "jump", "activity-dip", "ageing")
    rng, runs = np.random.default_rng(2), []
    for run in driven(card, 2):
        f = run["frequency_Hz"].copy()
        for at in rng.integers(20, len(f) - 20, 2):
            f[at : at + rng.integers(2, 9)] += rng.choice([-0.02, 0.02])
        runs.append(run.with_columns({"frequency_Hz": f}))
    causes = diagnose_records(runs, card).verdict.causes
    assert [(cause.kind, cause.effect) for cause in causes] == [("physics", "amplitude-frequency")]


def test_a_wrong_value_is_named_as_one(shipped, only):
    """The glass stiffens with temperature by four standard deviations of its law more than the card says; what could look like it contends."""
    only("curvature", "thermometer-scale", "mounting-stress", "second-lag", "radiation")
    sd = next(v.sd for v in shipped.uncertain if v.name == SLOPE)
    verdict = diagnose_records(
        frequencies(simulated(shipped.with_values({SLOPE: 4.0 * sd}), PROFILES[1])), shipped
    ).verdict
    assert [(cause.kind, cause.effect) for cause in verdict.causes] == [("value", SLOPE)], verdict.causes
    found = next(shift for shift in verdict.calibration if shift.parameter == SLOPE)
    assert found.low <= 4.0 * sd <= found.high or abs(found.shift_sd - 4.0) < 0.2
    frequency = verdict.as_dict()["responses"]["frequency_Hz"]
    assert frequency["verdict"] == "explained"
    assert frequency["shipped_rms"] > 20.0 * frequency["baseline"]["residual_rms"]


def test_hidden_effects_are_named_saved_and_predict_an_unseen_chamber_profile():
    """Within 10 % of the noise, or of what 95 % of draws leave, as the saved card states it."""
    found = recover(CASES)
    assert {name for name, _, _ in CASES} <= set(found.names)
    assert all(found.before[response] > 5.0 for name, response, _ in CASES if not find_effect(name).once)
    for response, left in found.after.items():
        assert left < 1.1 or found.errors[response] < DEVIATIONS, (response, found.after, found.stated)


def test_a_second_mass_on_the_base_is_named_with_its_size_and_predicts_an_unseen_run(shipped):
    """Six joules per kelvin beside the base were told as mounting stress and five wrong values, or with heat values out by a factor of two:
    they left no slow noise that asked for another lag, and no form of one lag more is exact behind a shell."""
    mass = {"second_mass_J_per_K": 6.0, "second_mass_conductance_W_per_K": 0.004}
    heavier = shipped.with_table("thermal", {**shipped.content["thermal"], **mass})
    found = diagnose_records(frequencies(simulated(heavier, *WAYS)), shipped)
    (cause,) = found.verdict.causes
    named = (cause.kind, cause.effect, cause.equivalent, found.verdict.verdict)
    assert named == ("physics", "second-lag", (), "explained")
    for name, truth in {**mass, "second_time_constant_s": 1500.0}.items():
        assert abs(cause.parameters[name].value - truth) < 3.0 * cause.parameters[name].sd, name
    assert max(abs(shift.shift_sd) for shift in found.verdict.calibration) < 1.0
    cards, noise = (heavier, extend(found).instrument), found.verdict.responses["frequency_Hz"].noise
    truth, told = (simulate_run(card, load_profile(UNSEEN), ROW, noise=False).record["frequency_Hz"] for card in cards)
    assert np.hypot(np.sqrt(np.mean((truth - told) ** 2)), noise) < 1.1 * noise


def test_what_has_not_converged_is_no_card(shipped, tmp_path, capsys, monkeypatch, only):
    """Two steps do not reach what the records say: the answer is given, the card is not written."""
    only("rate-bias")
    (run,) = simulated(shipped.with_table("bias", {"k1_deg_per_h_per_Hz": 0.2}), "step 20 -10 1h")
    write_record(run, tmp_path / "run.csv")
    words = ["diagnose", str(tmp_path / "run.csv"), "--card", "hrg-30mm", "--save", str(tmp_path / "out.toml")]
    monkeypatch.setattr("studies.calibration.fit.MOST_STEPS", 2)
    assert main([*words, "--json"]) == 2
    out, err = capsys.readouterr()
    assert json.loads(out)["extended_model"] is None
    assert "not saved" in err
    assert not (tmp_path / "out.toml").exists()


def test_slow_noise_of_a_loss_of_which_the_card_states_none_is_noise():
    """A card has no key for it: a walk of 1/Q of three times its white noise left a healthy gyro unexplained."""
    card, random = load_card("hrg-30mm").with_values({"thermal.cells": 10}), np.random.default_rng(1)
    records = []
    for k, words in enumerate(("staircase 20 -10 15 75min", "soak 20 12h")):
        record = simulate_run(card, load_profile(words), 1 / 60, 10 + k).record
        wander = 1.0 + Noise(walk=1e-4).draw(len(record), 1 / 60, random)
        records.append(replace(record.with_columns({"inverse_q": record["inverse_q"] * wander}), path=f"{k}.csv"))
    found = diagnose_records(records, card).verdict
    assert found.responses["inverse_q"].verdict == "adequate"
    assert not [cause for cause in found.causes if cause.response == "inverse_q"]


def test_the_likeliest_of_many_forms_is_no_doubt():
    """Of 40 healthy gyros this one left the most, an evidence of 9.8: the likeliest of ten forms in noise alone."""
    card = load_card("bvg-bell")
    record = simulate_run(card, load_profile("staircase 20 -10 15 75min"), ROW, 12600).record
    assert diagnose_records([record], card).verdict.verdict == "adequate"
