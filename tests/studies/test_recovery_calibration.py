"""A calibration against devices that were drawn from their priors: values, noise, unseen runs, and what cannot be known."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import binom, chi2, norm, t

from compensation.noise import Noise
from compensation.noise_rows import NoiseRows
from studies.calibration.ahead import spread_of_prediction
from studies.calibration.calibrate import calibrate
from studies.calibration.estimates import over_the_wave
from studies.calibration.levels import level_of_further_run
from studies.calibration.observed import HOUSING, SETTLED, read_settled
from studies.calibration.priors import gather_priors, to_standard
from studies.errors import InputError
from studies.instrument.card import load_card, save_card
from studies.record import Record
from studies.simulation.chamber import load_profile
from studies.simulation.drive import drive_by_profile, rows_of
from studies.simulation.prediction import predict
from studies.simulation.virtual_gyro import simulate_run

PROFILES = ("staircase 20 -10 15 75min", "ramp -10 35 0.5 then soak 35 90min")
UNSEEN = "cycle 20 -5 30 1 40min 1"


SETTLED_BY_CARD = ("thermal.film_housing_share", "thermal.base_capacity_slope_per_K")


def draw(card, seed):
    """A device of the card, its film and the material of its base the card's: rows of 120 s resolve its housing."""
    priors = dataclasses.replace(gather_priors(card, SETTLED_BY_CARD), wave=None)
    u = priors.inside(np.random.default_rng(seed).standard_normal(len(priors.values)))
    return card.with_values(priors.at(u))


def measure(card, words, seed, rate=1 / 120, **options):
    return simulate_run(card, load_profile(words), rate, seed, **options).record


@pytest.fixture(scope="module")
def card():
    """A shell of ten cells, in what is simulated as in what is fitted."""
    return load_card("hrg-30mm").with_values({"thermal.cells": 10})


@pytest.fixture(scope="module")
def device(card):
    return draw(card, 4)


@pytest.fixture(scope="module")
def records(device):
    return [measure(device, words, seed) for seed, words in enumerate(PROFILES, 1)]


@pytest.fixture(scope="module")
def found(card, records):
    return calibrate(card, records, hold_out=1, profile=False)


@pytest.mark.slow
def test_a_saved_card_states_of_a_run_what_the_fit_knows(found, tmp_path):
    """1 − ρ² of two values that only their sum tells was once lost in the digits of a card, and what offset and anisotropy have in common wholly."""
    save_card(found.instrument, tmp_path / "card.toml")
    saved = load_card(str(tmp_path / "card.toml"))
    profile = load_profile(UNSEEN)
    drive = drive_by_profile(profile, rows_of(profile, 1 / 300))
    priors = found.fit.problem.priors
    _, best, _, C = over_the_wave(priors, found.fit.point, found.fit.covariance)
    predicted, spread = predict(found.instrument, drive, priors.names), spread_of_prediction(saved, drive)
    told = saved.part("posterior")
    for name, turn_on in (("frequency_Hz", told.frequency_level_Hz), ("bias_deg_per_h", told.bias_level_deg_per_h)):
        J = np.column_stack([predicted.derivatives[one][name] for one in priors.names]) @ priors.slopes(best)
        known = np.hypot(np.sqrt(np.einsum("ij,jk,ik->i", J, C, J)), turn_on)
        np.testing.assert_allclose(spread[name], known, rtol=0.02)


@pytest.mark.slow
def test_set_points_that_jump_at_their_row_leave_the_lag_of_the_sensor_unbiased(found, device):
    """Where a jump is moved past its row the model has a kink; differences across it once moved the lag by three deviations."""
    lag = next(one for one in found.estimates if one.parameter == "noise.housing_lag_s")
    assert found.fit.converged
    assert lag.told_by == "data"
    assert abs(lag.value - device.noise.housing_lag_s) < 2 * lag.sd


@pytest.mark.slow
def test_the_residual_is_the_noise_and_the_card_was_far_from_it(found):
    assert found.fit.converged
    for name in ("frequency_Hz", "bias_deg_per_h", "inverse_q", HOUSING):
        rung = found.ladder[name]
        white = found.fit.rows[name].whiten(found.fit.state.residual[name], found.fit.noise[name])
        assert float(np.sqrt(np.mean(white**2))) == pytest.approx(1.0, abs=0.1)
        assert rung.calibrated < 1.2 * rung.noise
        assert rung.as_shipped > 10 * rung.noise


@pytest.mark.slow
def test_the_device_is_where_the_calibration_expects_it(found, device, card):
    """Dᵀ C⁻¹ D is chi-squared: capacities and conductances share one scale, so that intervals hit or miss it together."""
    truth = {value.name: value.value for value in device.uncertain}
    priors = {value.name: value for value in card.uncertain}
    known = found.fit.problem.priors
    plain = [k for k in range(len(known.names)) if k not in known.pair]  # a wave's axis is not told its sign
    z = np.array([to_standard(value, truth[value.name]) for value in known.values])
    root, C = known.root, found.fit.covariance[: len(z), : len(z)]
    away = (known.standard(found.fit.point[: len(z)]) - z)[plain]
    square = away @ np.linalg.solve((root @ C @ root.T)[np.ix_(plain, plain)], away)
    assert chi2.cdf(square, len(plain)) == pytest.approx(0.5, abs=0.49)
    for one in found.estimates:
        scale = priors[one.parameter]
        if one.told_by == "data":
            size = np.log(one.value / truth[one.parameter]) if scale.logarithmic else one.value - truth[one.parameter]
            unit = scale.sd / scale.value if scale.logarithmic else scale.sd
            assert abs(size) < 4.5 * one.width * unit, one.parameter


@pytest.mark.slow
def test_what_the_data_does_not_say_stays_at_its_prior(found):
    told = {one.parameter: one for one in found.estimates}
    axis = told["bias.damping_axis_deg"]
    assert axis.told_by != "data"
    assert axis.low == pytest.approx(-axis.high, rel=0.1)  # a pattern that stands does not tell its sign
    assert told["loss.inverse_q"].told_by == "data"
    assert any(
        "thermal.base_heat_capacity_J_per_K" in g and "thermal.mount_conductance_W_per_K" in g for g in found.groups
    )


@pytest.mark.slow
def test_the_saved_card_predicts_the_runs_and_an_unseen_one_from_their_chambers(found, device, records, tmp_path):
    save_card(found.instrument, tmp_path / "calibrated.toml")
    saved = load_card(tmp_path / "calibrated.toml")
    for words, run in zip((*PROFILES, UNSEEN), (*records, measure(device, UNSEEN, 9)), strict=True):
        profile, priors = load_profile(words), gather_priors(saved)
        moved = predict(saved, drive_by_profile(profile, rows_of(profile, 1 / 120)), priors.names).derivatives
        scale = priors.slopes(np.zeros(len(priors.values)))
        J = np.column_stack([moved[one]["frequency_Hz"] for one in priors.names]) @ scale
        # two runs do not tell all of the heat path that a third needs, and least of the level of a run, which is no part of this
        heat_path = np.sqrt(np.mean(np.sum((J - J.mean(axis=0)) ** 2, axis=1)))
        true, again = measure(device, words, 0, noise=False), measure(saved, words, 0, noise=False)
        usual = [measure(device, words, seed) for seed in range(20, 28)]  # one run's wander says little of the next's
        for name in ("frequency_Hz", "bias_deg_per_h", "inverse_q"):
            noise = np.sqrt(np.mean([(one[name] - true[name]) ** 2 for one in usual]))
            wide = heat_path if name == "frequency_Hz" else 0.0
            assert wide < 3 * noise, (words, name)
            assert np.sqrt(np.mean((again[name] - run[name]) ** 2)) < 2 * np.hypot(noise, wide), (words, name)
    widths = {value.name: value.sd for value in saved.uncertain}
    assert all(widths[one.parameter] == pytest.approx(one.sd, rel=1e-6) for one in found.estimates)


@pytest.mark.slow
def test_a_run_that_was_held_out_is_predicted(found):
    held = found.held_out
    assert held is not None
    for name in ("frequency_Hz", "bias_deg_per_h", "inverse_q"):
        assert held.housing[name][1] < 0.1 * held.housing[name][0]
        assert held.chamber[name][1] < 0.1 * held.chamber[name][0]


def started_late(device, words, seed, seconds):
    record = measure(device, words, seed)
    late = record["time_s"] >= seconds
    columns = {name: values[late] for name, values in record.columns.items()}
    return dataclasses.replace(record, columns=columns, path=f"{seed}.csv")


@pytest.mark.slow
def test_a_run_that_began_in_the_midst_of_a_change_is_explained_and_what_its_chamber_cannot_say_is_stated(device):
    """Its past is in the slow modes of the heat path: measured from the housing it is at the noise, from the chamber not."""
    fixed = [value.name for value in device.uncertain if not value.name.startswith("loss.inverse_q")]
    late = started_late(device, "step 20 -10 2h", 3, 2400.0)
    for runs, most in (([measure(device, "step 20 -10 2h", 3)], 0.02), ([late], np.inf)):
        both = [measure(device, PROFILES[1], 2), *runs]
        found = calibrate(device, both, hold_out=1, exact=fixed, profile=False)
        held, rung = found.held_out, found.ladder["frequency_Hz"]
        assert found.fit.converged
        assert rung.calibrated < 1.2 * rung.noise < 2e-3
        assert held.housing["frequency_Hz"][1] < 2 * rung.noise
        expected = np.hypot(held.stated["frequency_Hz"], rung.noise)
        assert held.chamber["frequency_Hz"][1] < 3 * expected
        assert held.stated["frequency_Hz"] < most
        assert any("3.csv: the fit needs a " in one for one in found.warnings) == (runs[0] is late)


@pytest.mark.slow
def test_where_nothing_is_wrong_the_card_stays_and_an_unseen_bias_is_as_it_was(card):
    """Terms of the bias that followed the noise of one run once made that of another ten times worse."""
    found = calibrate(card, [measure(card, UNSEEN, 3, 1 / 60)], profile=False)
    true, again = (measure(one, PROFILES[0], 0, noise=False) for one in (card, found.instrument))
    assert np.sqrt(np.mean((again["bias_deg_per_h"] - true["bias_deg_per_h"]) ** 2)) < 3e-3
    assert {one.parameter for one in found.estimates if abs(one.shift_sd) > 0.5} == set()
    assert all(one.low <= one.value <= one.high for one in found.estimates)
    assert next(one for one in found.estimates if one.parameter == "loss.inverse_q").told_by == "data"
    assert not found.warnings


@pytest.mark.slow
def test_without_a_housing_the_chamber_drives_and_values_that_stay_are_exact(card, records):
    bare = [
        dataclasses.replace(r, columns={k: v for k, v in r.columns.items() if k in ("time_s", "chamber_temperature_degC", "frequency_Hz")})
        for r in records
    ]  # fmt: skip
    fixed = [value.name for value in card.uncertain if value.name.startswith(("bias.", "loss.", "noise."))]
    found = calibrate(card, bare, exact=fixed, profile=False)
    assert set(found.ladder) == {"frequency_Hz"}
    assert not any(one.parameter.startswith("bias.") for one in found.estimates)
    assert found.ladder["frequency_Hz"].calibrated < 1.3 * found.ladder["frequency_Hz"].noise


LAW = ("material.", "loss.inverse_q")


def law_only(device, records, **changed):
    """Runs with frequency alone, calibrated in the law of a device whose other values are known."""
    fixed = [value.name for value in device.uncertain if not value.name.startswith(LAW)]
    runs = [r.with_columns(changed) if k == 0 else r for k, r in enumerate(records)]
    columns = ("time_s", "housing_temperature_degC", "frequency_Hz")
    bare = [dataclasses.replace(r, columns={name: r.columns[name] for name in columns}) for r in runs]
    return calibrate(device, bare, exact=fixed, profile=False)


SWINGS = ("cycle 20 -10 35 1 40min 1", "cycle 20 35 -10 1 40min 1", "cycle 20 -10 35 1 40min 1")


def calibrated_with_levels(card, seed, *spreads):
    """A device whose law alone is unknown; of each spread the levels of a further run and three (Hz), and the card from those three.

    The shell is one cell: levels have nothing to do with how heat goes through it.
    """
    others = [value for value in card.uncertain if not value.name.startswith("material.")]
    known = card.with_values({value.name: {"value": value.value, "sd": 0.0} for value in others} | {"thermal.cells": 1})
    device, found = draw(known, seed), []
    runs = [measure(device, words, 4 * seed + k, 1 / 300) for k, words in enumerate(SWINGS)]
    for spread in spreads:
        levels, moved = spread * np.random.default_rng(seed).standard_normal(len(SWINGS) + 1), []
        for k, (run, level) in enumerate(zip(runs, levels[1:], strict=True)):
            columns = {name: run[name] for name in ("time_s", "housing_temperature_degC")}
            columns["frequency_Hz"] = run["frequency_Hz"] + level
            moved.append(dataclasses.replace(run, path=f"{k}.csv", columns=columns))
        found.append((levels, calibrate(known, moved, profile=False).instrument))
    return device, found


@pytest.mark.slow
def test_of_unseen_frequencies_no_fewer_than_stated_lie_in_their_spread_whether_runs_differ_in_level_or_not(card):
    """A level (Hz) of three times the noise of a run's mean is the hardest: a few runs often agree by chance."""
    drive, inside = drive_by_profile(load_profile(UNSEEN), rows_of(load_profile(UNSEEN), 1 / 300)), [0, 0]
    for seed in range(108, 114):
        device, found = calibrated_with_levels(card, seed, 0.0, 2e-3)
        true = np.mean(predict(device, drive).columns["frequency_Hz"])
        for k, (levels, saved) in enumerate(found):
            said = np.mean(predict(saved, drive).columns["frequency_Hz"])
            wide = np.sqrt(np.mean(spread_of_prediction(saved, drive)["frequency_Hz"] ** 2))
            inside[k] += abs(said - true - levels[0]) < 1.96 * wide
    assert np.all(binom.cdf(inside, 6, 0.95) > 0.01)  # 5 or more


@pytest.mark.slow
@pytest.mark.parametrize("spread", [1.0, 1.7, 3.0])
def test_of_further_levels_as_many_as_stated_lie_within_what_three_runs_tell(spread):
    """Levels of runs, in standard deviations of the noise of a run's mean; of stated 95 % once 80 to 89 came on these draws."""
    random, inside, runs = np.random.default_rng(100), 0, 3
    rows = NoiseRows.of([np.arange(20.0)] * runs)
    for _ in range(200):
        levels = spread * random.standard_normal(runs + 1)
        residual = np.repeat(levels[1:], 20) + 20**0.5 * random.standard_normal(rows.count)
        level = level_of_further_run(rows, residual, np.full((rows.count, 1), 1e3), Noise(20**0.5))
        wide = np.sqrt(level**2 + (level**2 + 1) / runs)
        inside += abs(np.mean(residual) - levels[0]) < 1.96 * wide
    assert binom.cdf(inside, 200, 0.95) > 0.01


@pytest.mark.slow
def test_limits_levels_far_above_the_noise_are_stated_as_students_t_has_them(card):
    """Three levels of standard deviation s: a fourth is within t s of their mean, beside that mean's own s/√3."""
    _, ((levels, saved),) = calibrated_with_levels(card, 100, 0.02)
    expected = t.ppf(0.975, 2) * np.std(levels[1:], ddof=1) / norm.ppf(0.975)
    assert saved.part("posterior").frequency_level_Hz == pytest.approx(expected, rel=0.1)


@pytest.fixture(scope="module")
def clean(device, records):
    return law_only(device, records)


@pytest.mark.slow
def test_runs_that_contradict_each_other_are_named(device, records, clean):
    away = law_only(device, records, frequency_Hz=records[0]["frequency_Hz"] + 0.5)
    assert any("the runs disagree in the frequency" in warning for warning in away.warnings)
    assert not clean.warnings


@pytest.mark.slow
def test_outliers_do_not_move_the_values(device, records, clean):
    spoilt = records[0]["frequency_Hz"].copy()
    spoilt[np.random.default_rng(1).choice(len(spoilt), 6, replace=False)] += 0.5
    wrong = law_only(device, records, frequency_Hz=spoilt)
    for one, other in zip(wrong.estimates, clean.estimates, strict=True):
        assert abs(one.shift_sd - other.shift_sd) < other.width + 1e-6, one.parameter


def test_the_papers_table_moves_the_law_by_little_more_than_one_standard_deviation(card):
    """HRG paper, Table 1: a law of slope and curvature within its prior leaves 0.09 Hz, what a parabola cannot follow."""
    found = calibrate(card, [], [read_settled("studies/papers/hrg_table1.csv")], profile=False)
    told = {one.parameter.removeprefix("material.deviation."): one for one in found.estimates}
    assert abs(told["shear_modulus.log_value"].shift_sd) < 0.2  # the thickness was chosen so
    assert told["shear_modulus.log_slope_per_K"].shift_sd == pytest.approx(-1.2, abs=0.3)
    assert found.ladder[SETTLED].calibrated == pytest.approx(0.087, abs=0.01)
    assert "7 data points cannot determine 29 uncertain values." in found.warnings


def test_records_that_say_nothing_are_refused(card):
    t = np.arange(0.0, 3600.0, 30.0)
    with pytest.raises(InputError, match="no data given"):
        calibrate(card, [])
    with pytest.raises(InputError, match="no temperature drives the run"):
        calibrate(card, [Record({"time_s": t, "frequency_Hz": 4432.0 + 0 * t}, path="run.csv")])
    with pytest.raises(InputError, match="there is nothing to calibrate with"):
        calibrate(card, [Record({"time_s": t, "housing_temperature_degC": 20.0 + 0 * t}, path="run.csv")])
    with pytest.raises(InputError, match="has 5 of the 10 rows that a run needs at least"):
        calibrate(
            card, [Record({"time_s": t[:5], "housing_temperature_degC": t[:5], "frequency_Hz": t[:5]}, path="run.csv")]
        )
    good = Record({"time_s": t, "housing_temperature_degC": 20.0 + t / 600, "frequency_Hz": 4432.0 + t / 600})
    with pytest.raises(InputError, match="is not an uncertain value of the card; did you mean"):
        calibrate(card, [good], exact=["thermal.film_emisivity"])
