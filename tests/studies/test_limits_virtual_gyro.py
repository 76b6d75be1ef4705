"""The virtual gyro against its parts: shell solver, heat path, bias formula, record contract."""

import datetime
from dataclasses import replace

import allantools
import numpy as np
import pytest

from compensation.noise import Noise
from shell.elastic import VaryingElastic
from shell.modes import solve_modes
from studies.errors import InputError
from studies.instrument.card import load_card, save_card, shipped_cards
from studies.instrument.tables.bias import Bias
from studies.instrument.tables.loss import Loss
from studies.instrument.tables.noise import NoiseKeys
from studies.record import read_record, write_record
from studies.resonator.law import law_of
from studies.simulation.chamber import load_profile
from studies.simulation.drive import drive_by_profile, rows_of
from studies.simulation.heat_path import build_network, build_shell_and_stem, slowest_lag
from studies.simulation.noise import bias_noise, quantise
from studies.simulation.response import cell_weights, to_cells
from studies.simulation.virtual_gyro import simulate_run
from thermal.radiative import simulate
from thermal.relaxation import find_relaxation

CARD = """
schema = "hrg.card/1"
name = "open-dome"
[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.9
pole_angle_deg = 10.0
support = "clamped-pole"
[material]
name = "fused-silica"
"""


@pytest.fixture(scope="module")
def card(tmp_path_factory):
    path = tmp_path_factory.mktemp("cards") / "open-dome.toml"
    path.write_text(CARD, encoding="utf-8")
    return load_card(path)


@pytest.fixture(scope="module")
def law(card):
    return law_of(card, 233.15, 333.15, theory="shell")


def run(card, law, words="step 20 -10 5h", **options):
    return simulate_run(card, load_profile(words), law=law, **options)


def test_the_frequency_model_is_the_solver_between_its_nodes(card, law):
    for T in (240.0, 281.0, 321.0):
        resonator, elastic = card.at(T)
        (mode,) = solve_modes(resonator, elastic, theory="shell")
        assert law.frequency(np.array([T]))[0] == pytest.approx(mode.frequency, rel=2e-9)
    assert law.interpolation_error < 2e-9


def test_the_weights_of_the_cells_add_up_to_the_slope(card, law):
    slope = float(law_of(card, 293.15, 293.15, "shell").parts(293.15).total)
    assert to_cells(card, law, law.sensitivity()).sum() == pytest.approx(slope, rel=1e-12)
    assert cell_weights(card, law).sum() == pytest.approx(1.0, rel=1e-12)
    centre = np.log(law.frequency(np.array([293.1, 293.2])))
    assert np.diff(centre)[0] / 0.1 == pytest.approx(slope, rel=1e-6)


def test_a_field_along_the_meridian_shifts_the_mode_as_its_weights_say(card, law):
    """A field of ±2 K, once through the weights and once through a solve with E, ν, ρ along the meridian.

    The solve leaves the geometry as it is; the expansion, 0.51 of 79 ppm/°C, is added with the elastic energy's shares.
    """
    material, T0 = card.material, 293.15

    def solve(size):
        def field(position):
            return T0 - size * np.cos(np.pi * np.asarray(position))

        elastic = VaryingElastic(
            lambda p: material.value("youngs_modulus", field(p)),
            lambda p: material.value("poisson_ratio", field(p)),
            lambda p: material.value("density", field(p)),
        )
        return np.log(solve_modes(card.resonator, elastic, theory="shell", tolerance=1e-7)[0].frequency)

    (mode,) = solve_modes(card.resonator, material.elastic(T0), theory="shell", tolerance=1e-7)
    alpha = float(material.value("expansion", T0))
    growth = alpha * float(mode.along.elastic @ (-2.0 * np.cos(np.pi * mode.along.position)))
    by_solver = (solve(2.0) - solve(-2.0)) / 2 - growth
    cells = card.heat_path.cells
    field = -2.0 * np.cos(np.pi * cells.middle / cells.edge[-1])
    assert to_cells(card, law, law.sensitivity()) @ field == pytest.approx(by_solver, rel=2e-3)
    assert abs(by_solver) > 5e-5


@pytest.mark.slow
def test_an_elinvar_whose_slope_vanishes_keeps_a_sound_resonator_temperature():
    """The cylinder of 3J53: the slope is a small difference, and the mean temperature must not be divided by it."""
    made = simulate_run(load_card("cvg-25mm"), load_profile("step 20 0 2h"), 0.1, noise=False, theory="shell")
    T = made.record["resonator_temperature_degC"]
    assert T.min() >= 0.0
    assert T.max() <= 20.0
    assert np.diff(T).max() < 1e-6
    settled = made.law.frequency(T + 273.15)
    assert made.record["frequency_Hz"] == pytest.approx(settled, rel=2e-6)


def test_the_papers_terms_add_up():
    bias = Bias(damping_anisotropy=0.0, offset_deg_per_h=1.0, k2_deg_per_h_per_Hz2=0.5, k7_deg_per_h_s_per_Hz2=4.0)
    change, rate = np.array([2.0, -2.0]), np.array([0.25, 0.25])
    found = bias.at(change, rate, np.full(2, 4432.0), np.full(2, 1e-7), 0.277)
    assert found == pytest.approx([1 + 2 + 2, 1 + 2 - 2])


def test_the_change_of_frequency_counts_from_the_reference_temperature_even_when_it_is_never_reached(card):
    polynomial = card.with_table("bias", {"damping_anisotropy": 0.0, "k1_deg_per_h_per_Hz": 2.0})
    record = simulate_run(polynomial, load_profile("soak -40 1h"), noise=False, theory="shell").record
    f20 = solve_modes(*card.at(293.15), theory="shell")[0].frequency
    assert record["bias_deg_per_h"] == pytest.approx(2 * (record["frequency_Hz"] - f20), abs=1e-4)


def test_loss_is_quadratic_in_the_excess():
    loss = Loss(inverse_q=2e-7, slope_per_K=0.01, curvature_per_K2=1e-4)
    assert loss.at(np.array([-10.0, 0.0, 10.0])) == pytest.approx([2e-7 * 0.91, 2e-7, 2e-7 * 1.11])


@pytest.mark.slow
def test_after_a_long_soak_the_frequency_is_that_of_the_chamber(card, law):
    record = run(card, law, "step 20 -10 20h", rate=0.1, noise=False).record
    assert record["frequency_Hz"][-1] == pytest.approx(law.frequency(np.array([263.15]))[0], abs=1e-5)
    assert record["chamber_temperature_degC"][0] == -10.0
    assert record["resonator_temperature_degC"][0] == pytest.approx(20.0, abs=1e-5)


def test_the_record_keeps_the_contract_and_is_read_back(card, law, tmp_path):
    made = run(card.with_table("noise", {"frequency_resolution_Hz": 0.01}), law, rate=0.5).record
    write_record(made, tmp_path / "run.csv")
    read = read_record(tmp_path / "run.csv")
    assert list(read.columns) == [
        "time_s", "chamber_temperature_degC", "housing_temperature_degC", "resonator_temperature_degC",
        "frequency_Hz", "bias_deg_per_h", "inverse_q",
    ]  # fmt: skip
    assert len(read) == 9001
    assert read.instrument == "open-dome"
    assert read.resolution == {"frequency_Hz": 0.01}
    assert read["frequency_Hz"] == pytest.approx(made["frequency_Hz"], abs=1e-9)
    assert read["frequency_Hz"] * 100 == pytest.approx(np.round(read["frequency_Hz"] * 100), abs=1e-6)


def test_a_measured_profile_of_many_rows_is_the_same_as_its_corners(card, law, tmp_path):
    t = np.arange(0.0, 4801.0, 5.0)
    T = np.interp(t, [0.0, 1200.0, 4800.0], [20.0, 40.0, 40.0])
    rows = "".join(f"{a:g},{b:.10g}\n" for a, b in zip(t, T, strict=True))
    path = tmp_path / "chamber.csv"
    path.write_text("time_s,chamber_temperature_degC\n" + rows, encoding="utf-8")
    many = run(card, law, str(path), noise=False).record
    few = run(card, law, "ramp 20 40 1 then soak 40 1h", noise=False).record
    assert many["resonator_temperature_degC"] == pytest.approx(few["resonator_temperature_degC"], abs=1e-5)


def test_an_ageing_with_a_date_goes_on_from_it(card, law, tmp_path):
    """Once every run began as new: a leak was wrong by 89 times the noise three days later."""
    aged = card.with_table("effect", [{"name": "clock-drift", "drift_Hz_per_day": 0.5, "since": "2026-03-01T12:00:00"}])
    save_card(aged, tmp_path / "card.toml")
    aged = load_card(str(tmp_path / "card.toml"))
    plain = run(card, law, "soak 20 1h", noise=False)
    for start, days in (
        (None, 0.0),
        ("2026-03-01T12:00:00", 0.0),
        ("2026-03-05T18:00:00", 4.25),
        ("2026-02-28T12:00:00", 0.0),
    ):
        moment = None if start is None else datetime.datetime.fromisoformat(start).timestamp()
        later = simulate_run(aged, replace(plain.prediction.drive, moment=moment), noise=False, law=law)
        grown = later.record["frequency_Hz"] - plain.record["frequency_Hz"]
        assert grown == pytest.approx(0.5 * (days + later.record["time_s"] / 86400), abs=2e-6)
        assert (later.record.moment or None) == moment
        assert len(later.warnings) == (start is None or start.startswith("2026-02"))
    with pytest.raises(InputError, match=r"since must be an ISO 8601 time such as 2026-01-31T12:00:00, not 'today'"):
        card.with_table("effect", [{"name": "clock-drift", "drift_Hz_per_day": 0.5, "since": "today"}])


def test_an_effect_whose_drive_stays_is_named(card, law):
    softened = card.with_table("effect", [{"name": "electrostatic-softening", "softening_Hz_per_V2": 1e-4}])
    made = run(softened, law, "soak 20 1h", noise=False)
    assert made.record["frequency_Hz"] == pytest.approx(
        run(card, law, "soak 20 1h", noise=False).record["frequency_Hz"]
    )
    assert made.warnings == (
        "the effect 'electrostatic-softening' does not act in this run, which lacks its drive (voltage_squared).",
    )


def test_a_run_that_no_command_could_read_is_not_made(card, law):
    """Once a softening in the wrong unit made a record of −876 kHz, which every other command refused."""
    falling = card.with_table("effect", [{"name": "clock-drift", "drift_Hz_per_day": -1e6}])
    with pytest.raises(InputError, match=r"open-dome at \d+ s: frequency_Hz = -\S+ is not a possible reading"):
        run(falling, law, "soak 20 1h", noise=False)


def test_drive_power_warms_the_shell(card):
    heated = build_network(card.with_table("thermal", {"drive_power_mW": 1.0}), radiation=False)
    resistance = find_relaxation(heated, 293.15)
    assert len(heated.sources) == 24
    assert sum(source.power for source in heated.sources) == pytest.approx(1e-3)
    assert slowest_lag(build_network(card), 293.15) < resistance.time_constants[0] * 1.01
    hot = card.with_table("thermal", {"drive_power_mW": 20.0})
    made = simulate_run(hot, load_profile("soak 20 1h"), 1 / 600, noise=False, theory="shell")
    assert made.record["resonator_temperature_degC"].min() > 31.0  # its frequency was known up to 30 °C only


def test_the_heat_path_follows_geometry_material_and_table(card):
    path = card.heat_path
    ring = 2 * np.pi * 0.015**2 * np.cos(np.radians(10.0))
    assert path.cells.area.sum() == pytest.approx(ring, rel=1e-5)
    assert path.volumetric_capacity == pytest.approx(2203 * 740.0, rel=1e-4)
    film, bare = (
        find_relaxation(build_shell_and_stem(card.with_table("thermal", {"film_emissivity": e})), 293.15)
        for e in (0.03, 0.8)
    )
    assert film.time_constants[0] > 5 * bare.time_constants[0]
    one, many = (slowest_lag(build_network(c), 293.15) for c in (card.with_values({"thermal.cells": 1}), card))
    assert one == pytest.approx(many, rel=0.01)


def test_every_shipped_shape_has_a_heat_path(card):
    for name in shipped_cards():
        network = build_network(load_card(name))
        assert 10 < find_relaxation(network, 293.15).time_constants[0] < 1e5
    rim = card.content["resonator"] | {"support": "clamped-rim"}
    turned = card.with_table("resonator", rim).heat_path.cells
    assert turned.volume[0] == pytest.approx(card.heat_path.cells.volume[-1], rel=1e-3)


def test_a_material_without_heat_capacity_is_asked_for_by_its_key():
    with pytest.raises(InputError, match="of 3j53; add 'heat_capacity_J_per_kg_K'"):
        build_network(load_card("bvg-bell").with_table("thermal", {}))


def test_an_effect_may_warm_the_resonator_beyond_the_drive():
    """A drive that is doubled heats by 15 K: the frequency is the law's there, far from what the housing goes through."""
    card = load_card("hrg-30mm")
    warm = card.with_table("effect", [{"name": "self-heating", "response": "frequency_Hz", "heating_K_per_V2": 15.0}])
    profile = load_profile("soak 20 10h")
    drive = drive_by_profile(profile, rows_of(profile, 1 / 60))
    drive = replace(drive, commands={"amplitude_squared": np.where(drive.time < 3600.0, 1.0, 2.0)})
    found = simulate_run(warm, drive, noise=False)
    law = law_of(card, 270.0, 330.0)
    start, end = found.record["frequency_Hz"][[0, -1]]
    assert end / start == pytest.approx(float(law.frequency(293.15 + 30.0) / law.frequency(293.15 + 15.0)), rel=1e-7)


def allan(samples, rate, taus):
    found, deviation, _, _ = allantools.oadev(samples, rate=rate, data_type="freq", taus=taus)
    assert len(found) == len(taus)
    return deviation


def test_levels_of_the_rate_output_are_in_the_units_of_gyro_data_sheets():
    """Angle random walk N: N/√τ with τ in h; rate random walk K: K √(τ/3)."""
    levels = NoiseKeys(bias_white_deg_per_rt_h=0.02, bias_flicker_deg_per_h=0.0, bias_walk_deg_per_h_per_rt_h=0.5)
    both = bias_noise(levels)
    rng = np.random.default_rng(3)
    white = Noise(white=both.white).draw(400_000, 1.0, rng)
    assert allan(white, 1.0, [36.0]) == pytest.approx([0.02 / np.sqrt(0.01)], rel=0.05)
    walk = Noise(walk=both.walk).draw(400_000, 1.0, rng)
    assert allan(walk, 1.0, [360.0]) == pytest.approx([0.5 * np.sqrt(0.1 / 3)], rel=0.15)


def test_rounding_rounds():
    assert quantise(np.array([4432.0749, 4432.0751]), 0.01) == pytest.approx([4432.07, 4432.08])
    values = np.array([0.123456789])
    assert quantise(values, 0.0) is values


def test_a_base_whose_capacity_grows_does_so_without_radiation():
    """Limit: where nothing radiates, a run is the same whether radiation is linearised or not."""
    heat = {"film_emissivity": 0.0, "mount_exchange_cm2": 0.0, "base_capacity_slope_per_K": 2e-3, "cells": 4}
    networks = [
        build_network(load_card("hrg-30mm").with_table("thermal", {**heat, "radiation": radiates}))
        for radiates in (True, False)
    ]
    runs = [simulate(one, {"chamber": load_profile("step 20 80 5h")}) for one in networks]
    time = np.linspace(0.0, 18000.0, 50)
    base, same = (run.node("base", time) for run in runs)
    assert base == pytest.approx(same, abs=1e-9)


def test_what_the_shell_radiates_past_its_base_and_a_base_whose_capacity_grows():
    """A share of the same exchange goes to the housing; the base holds e^(slope · 10 K) more heat at 30 °C."""
    plain, own = load_card("hrg-30mm"), {"thermal.film_housing_share": 0.3, "thermal.base_capacity_slope_per_K": 1e-3}
    whole, parted = build_network(plain), build_network(plain.with_values(own))
    area = {
        faced: sum(r.exchange_area for r in parted.radiators if r.one != "housing" and r.other == faced)
        for faced in ("base", "housing")
    }
    total = sum(r.exchange_area for r in whole.radiators if r.other == "base" and r.one != "housing")
    assert [area["base"], area["housing"]] == pytest.approx([0.7 * total, 0.3 * total], rel=1e-12)
    base = parted.nodes[parted.index("base")]
    assert base.capacity_at(293.15) == pytest.approx(25.0, rel=1e-12)
    assert base.capacity_at(303.15) == pytest.approx(25.0 * np.exp(1e-2), rel=1e-12)
