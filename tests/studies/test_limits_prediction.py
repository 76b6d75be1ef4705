"""The one forward model: its derivatives against differences, and its boundaries against each other."""

from dataclasses import replace

import numpy as np
import pytest

from studies.errors import InputError
from studies.instrument.card import load_card
from studies.record import Record
from studies.resonator.law import law_of
from studies.simulation.drive import drive_by_profile, drive_by_record
from studies.simulation.heat_path import build_network
from studies.simulation.prediction import law_for, predict
from studies.simulation.response import lags_of, observed_rows
from studies.simulation.variations import Variations
from studies.simulation.virtual_gyro import simulate_run
from thermal.profile import Profile, parse_profile
from thermal.relaxation import find_relaxation
from thermal.sensitivity import respond

PROFILE = parse_profile("step 20 -10 1h then ramp -10 35 1")
TIME = np.arange(0.0, PROFILE.end, 20.0)
BENT = {
    "thermal.film_housing_share": 0.02,
    "bias.k1_deg_per_h_per_Hz": 0.3,
    "bias.k2_deg_per_h_per_Hz2": 0.01,
    "bias.k4_deg_per_h_s_per_Hz": 50.0,
    "loss.curvature_per_K2": 1e-5,
}
EFFECTS = [
    {"name": "second-lag", "weight": {"value": 0.1, "sd": 0.05}, "second_time_constant_s": 9000.0},
    {"name": "rate-bias", "coefficient_deg_per_h_per_K_per_s": {"value": 30.0, "sd": 10.0}},
]


@pytest.fixture(scope="module")
def card():
    return load_card("hrg-30mm").with_values(BENT).with_table("effect", EFFECTS)


@pytest.fixture(scope="module")
def drive():
    return drive_by_profile(PROFILE, TIME)


@pytest.fixture(scope="module")
def law(card, drive):
    return law_for(card, drive, theory="shell")


@pytest.fixture(scope="module")
def measured(card, drive, law):
    """A housing column as its sensor reads it, with noise, on uneven rows."""
    generator = np.random.default_rng(3)
    rows = np.sort(generator.choice(len(TIME), size=len(TIME) // 2, replace=False))
    sensed = predict(card, drive, law=law).columns["housing_temperature_degC"][rows]
    columns = {"time_s": TIME[rows], "housing_temperature_degC": sensed + 1e-3 * generator.standard_normal(len(rows))}
    return drive_by_record(Record(columns))


def test_effects_reach_the_resonator_through_the_modes_of_its_heat_path(law):
    """Against the network itself: a ramp of the housing, and the power of the drive that begins; its base and its shell are about as slow."""
    card = load_card("hrg-30mm").with_table("thermal", {"radiation": False, "drive_power_mW": 2.0})
    network = build_network(card, boundary="housing")
    lags, row = lags_of(card, law, network), observed_rows(card, law, tuple(n.name for n in network.nodes))[1:2]
    assert sum(abs(w) for w in lags.housing) > 3.0  # a single lag would be far off
    time = np.arange(0.0, 8000.0, 5.0)
    ramp = Profile(np.array([0.0, 1500.0, 8000.0]), 293.15 + np.array([0.0, 10.0, 4.0]))
    rest = Profile(np.array([0.0, 8000.0]), np.full(2, 293.15))
    driven, still = (
        respond(replace(network, sources=()), {"housing": one}, time, row).temperature[:, 0] for one in (ramp, rest)
    )
    assert lags.follow(ramp.at(time) - 293.15, 5.0, lags.housing) == pytest.approx(driven - still, abs=0.02)
    settled = np.linalg.solve(find_relaxation(network, 293.15).conductance, network.power(0.0)[: network.count])
    begun = respond(network, {"housing": rest}, time, row, departure=-settled).temperature[:, 0]
    power = np.concatenate([[0.0], np.ones(len(time))])
    assert lags.follow(power, 5.0, lags.heat)[1:] == pytest.approx((begun - still) / (row @ settled), abs=0.01)


def names_of(card, drive):
    return [*(value.name for value in card.uncertain), *(f"initial.{lump}" for lump in drive.lumps)]


@pytest.mark.slow
@pytest.mark.parametrize("boundary", ["chamber", "housing"])
def test_every_derivative_against_central_differences(card, drive, law, measured, boundary):
    drive = drive if boundary == "chamber" else measured
    known = {value.name: value for value in card.uncertain}
    found = predict(card, drive, names_of(card, drive), law)
    for name in names_of(card, drive):

        def moved(step, name=name):
            if name not in known:
                return predict(card, replace(drive, initial={name.removeprefix("initial."): step}), law=law)
            other = card.with_values({name: known[name].value + step})
            own = law.with_material(other.material) if name.startswith("material.") else law
            return predict(other, drive, law=own)

        step = 0.01 * known[name].sd if name in known else 0.1
        above, below = moved(step), moved(-step)
        for column, values in found.derivatives[name].items():
            expected = (above.columns[column] - below.columns[column]) / (2 * step)
            size = np.abs(expected).max()
            floor = 1e-9 * np.abs(found.columns[column]).max() / step
            assert values == pytest.approx(expected, abs=2e-3 * size + floor), (name, column)


def test_the_measured_housing_gives_the_record_that_the_chamber_gives(card, drive, law):
    """The reading of the housing, its sensor's lag taken out, drives the resonator as the housing itself did."""
    whole = predict(card, drive, law=law)
    columns = {"time_s": TIME, "housing_temperature_degC": whole.columns["housing_temperature_degC"]}
    again = predict(card, drive_by_record(Record(columns)), law=law)
    late = TIME > 600.0
    assert (
        np.abs(again.columns["resonator_temperature_degC"] - whole.columns["resonator_temperature_degC"]).max() < 5e-3
    )
    assert again.columns["frequency_Hz"][late] == pytest.approx(whole.columns["frequency_Hz"][late], abs=2e-3)
    assert again.columns["bias_deg_per_h"][late] == pytest.approx(whole.columns["bias_deg_per_h"][late], abs=5e-3)


def test_a_command_is_held_where_its_cell_is_empty():
    """One empty cell does not take the whole column away; the nearest row says what was commanded."""
    time = np.arange(0.0, 100.0, 10.0)
    volts, turned = np.where(time < 50.0, 75.0, 125.0), np.full(10, 2.0)
    columns = {"time_s": time, "housing_temperature_degC": np.full(10, 20.0)}
    holes = {
        "electrode_bias_V": volts.copy(),
        "rate_deg_per_s": turned.copy(),
        "drive_amplitude_V": np.full(10, np.nan),
    }
    holes["electrode_bias_V"][[0, 3, 6, 9]] = np.nan
    holes["rate_deg_per_s"][4] = np.nan
    found = drive_by_record(Record(columns | holes))
    assert found.commands["voltage_squared"] == pytest.approx(volts**2, rel=1e-13)
    assert found.rate.means(time) == pytest.approx(np.radians(turned), rel=1e-13)
    assert set(found.commands) == {"voltage_squared"}
    sparse = drive_by_record(Record(columns | holes), time=np.array([5.0, 30.0, 95.0]))
    assert sparse.commands["voltage_squared"] == pytest.approx([75.0**2, 75.0**2, 125.0**2], rel=1e-13)


def test_the_recorded_chamber_gives_the_record_again_with_its_jumps_and_its_start():
    """The column is sampled, yet a set point that jumps is no ramp, and before the first row the housing says what was."""
    card = load_card("hrg-30mm")
    run = simulate_run(card, parse_profile("staircase 20 0 10 1h then ramp 0 20 1"), 0.1, noise=False, theory="shell")
    found = predict(card, drive_by_record(run.record, "chamber"), law=run.law)
    reading = predict(card, run.prediction.drive, law=run.law).columns["housing_temperature_degC"]
    assert found.columns["housing_temperature_degC"] == pytest.approx(reading, abs=2e-5)
    assert found.columns["frequency_Hz"] == pytest.approx(run.record["frequency_Hz"], abs=2e-5)


def test_a_later_chamber_is_the_same_record_later(drive, law):
    card = load_card("hrg-30mm")
    moved = predict(card, replace(drive, shift=40.0), ["shift"], law)
    here = predict(card, drive, law=law).columns["frequency_Hz"]
    later = TIME > 400.0
    assert moved.columns["frequency_Hz"][later] == pytest.approx(np.interp(TIME[later] - 40.0, TIME, here), abs=2e-4)
    slope = np.gradient(moved.columns["frequency_Hz"], TIME)
    smooth = later & (np.abs(TIME - 3640.0) > 60.0) & (TIME < TIME[-1])
    assert moved.derivatives["shift"]["frequency_Hz"][smooth] == pytest.approx(-slope[smooth], abs=5e-6)


def test_what_is_simulated_is_what_is_predicted(card, drive, law):
    run = simulate_run(card, PROFILE, 0.05, noise=False, law=law)
    found = predict(card, drive_by_profile(PROFILE, run.record["time_s"]), law=law)
    for name in ("frequency_Hz", "bias_deg_per_h", "inverse_q"):
        assert run.record[name] == pytest.approx(found.columns[name], abs=1e-6 if name != "inverse_q" else 1e-15)


def test_the_bias_counts_in_the_frequency_of_the_calibrated_law(card, drive, law):
    """k1 multiplies the change of the same frequency that is recorded, also when the law deviates from the published one."""
    steep = load_card("hrg-30mm").with_values(
        {
            "bias.k1_deg_per_h_per_Hz": 2.0,
            "bias.damping_anisotropy": 0.0,
            "material.deviation.shear_modulus.log_slope_per_K": 5e-5,
        }
    )
    own = law.with_material(steep.material)
    found = predict(steep, drive, law=own).columns
    at_reference = float(own.frequency(steep.reference_temperature))
    assert found["bias_deg_per_h"] == pytest.approx(2.0 * (found["frequency_Hz"] - at_reference), abs=1e-8)
    plain = predict(load_card("hrg-30mm"), drive, law=law).columns
    more = np.ptp(found["frequency_Hz"]) - np.ptp(plain["frequency_Hz"])
    assert more == pytest.approx(0.5 * 5e-5 * 4432.0 * np.ptp(plain["resonator_temperature_degC"]), rel=5e-3)


def test_departures_decay_from_their_start(drive, law):
    bare = load_card("hrg-30mm")
    found = predict(bare, replace(drive, initial={"base": 2.0, "resonator": -1.0}), law=law)
    plain = predict(bare, drive, law=law)
    away = found.columns["resonator_temperature_degC"] - plain.columns["resonator_temperature_degC"]
    # the four slowest modes of the same path with its stem in 100 cells have this: the rest is in fast ones
    assert away[0] == pytest.approx(-0.912, abs=0.01)
    assert away.max() > 0.2  # the base warms it
    assert abs(away[-1]) < 0.5 * away.max()


def test_a_run_without_a_drive_and_an_unknown_start_are_refused(card, drive):
    with pytest.raises(InputError, match="no temperature drives the run; add the column housing_temperature_degC"):
        drive_by_record(Record({"time_s": TIME, "frequency_Hz": TIME}))
    with pytest.raises(InputError, match="chamber_temperature_degC is missing; choose the other boundary"):
        drive_by_record(Record({"time_s": TIME, "housing_temperature_degC": TIME * 0.0}), "chamber")
    with pytest.raises(InputError, match="no 'shell'"):
        replace(drive, initial={"shell": 1.0})
    with pytest.raises(InputError, match="the card has no number"):
        predict(card, drive, ["thermal.mass"])


def test_a_value_beside_a_bound_that_is_none_itself_is_moved_within_it():
    """A conductance of which little is known, close to 0: diagnosis ended as its lower neighbour was 0, which no card may have."""
    thermal = {"second_mass_J_per_K": 5.0, "second_mass_conductance_W_per_K": {"value": 1e-6, "sd": 1e-2}}
    card = load_card("free-dome").with_table("thermal", thermal)
    key = "thermal.second_mass_conductance_W_per_K"
    below, above = Variations(card, law_of(card, theory="rayleigh"), [key]).sides(key)
    assert 0.0 < below.instrument.keys("thermal").second_mass_conductance_W_per_K < 1e-6
    assert above.distance > -below.distance > 0.0
