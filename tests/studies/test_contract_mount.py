"""A card with [mount]: what its commands say, what of it is uncertain, and what is refused."""

import numpy as np
import pytest

from studies.instrument.card import load_card, save_card
from studies.simulation.drive import drive_by_profile
from studies.simulation.prediction import predict
from thermal.profile import parse_profile

CUP = """schema = "hrg.card/1"
name = "cup"
[resonator]
shape = "cylinder"
radius_mm = 12.5
thickness_mm = 0.6
height_mm = 18.0
bottom_thickness_mm = 1.0
clamp_radius_mm = 3.0
[material]
name = "3j53"
youngs_modulus_GPa = 190.0
poisson_ratio = 0.3
density_kg_m3 = 8000.0
[thermal]
conductivity_W_per_m_K = 12.0
heat_capacity_J_per_kg_K = 500.0
"""
MOUNT = "[mount]\nexpansion_per_K = 23e-6\njoined_at_degC = 0.0\n"


@pytest.fixture
def cup(tmp_path):
    path = tmp_path / "cup.toml"
    path.write_text(CUP + MOUNT)
    return path


def test_modes_and_tcf_tell_the_same_of_the_base(cup, ask):
    """The alloy expands by 8.5e-6 per kelvin, the base by 23e-6: in 20 K the base gains 290 ppm."""
    axial, pair = ask(["modes", cup, "--harmonic", "0", "2"])["modes"]
    assert "mount" not in axial
    mount = pair["mount"]
    assert mount["strain_ppm"] == pytest.approx(20 * (23 - 8.5), rel=1e-9)
    assert mount["shift_ppm"] == pytest.approx(mount["per_strain"] * mount["strain_ppm"], rel=1e-9)
    point = ask(["tcf", cup, "--from", "20", "--to", "30"])["points"][0]
    assert point["parts_ppm_per_degC"]["base"] == pytest.approx(mount["slope_ppm_per_degC"], rel=1e-9)
    assert sum(point["parts_ppm_per_degC"].values()) == pytest.approx(point["slope_ppm_per_degC"], rel=1e-9)
    assert point["frequency_Hz"] / pair["frequency_Hz"] - 1 == pytest.approx(1e-6 * mount["shift_ppm"], rel=1e-3)


def test_the_expansion_of_the_base_is_uncertain_and_is_saved(cup, tmp_path):
    card = load_card(cup)
    (one,) = [value for value in card.uncertain if value.name.startswith("mount.")]
    assert (one.name, one.sd) == ("mount.expansion_per_K", pytest.approx(2.3e-6))
    save_card(card.with_values({"mount.expansion_per_K": 11e-6}), tmp_path / "moved.toml")
    assert load_card(tmp_path / "moved.toml").part("mount").expansion == 11e-6
    plain = tmp_path / "plain.toml"
    plain.write_text(CUP)
    assert not [value for value in load_card(plain).uncertain if value.name.startswith("mount.")]


@pytest.mark.parametrize(
    ("words", "table", "said"),
    [
        (["modes"], "[mount]\njoined_at_degC = 20.0\n", "expansion_per_K"),
        (["modes"], "[mount]\nexpansion_per_K = 5.1\n", "expansion_per_K"),
        (["tcf", "--theory", "shell"], MOUNT, "[mount]"),
        (["tcf"], "[mount]\nexpansion_per_K = 5e-6\njoined_at_degC = 900.0\n", "[mount]"),
    ],
)
def test_what_a_mount_cannot_say_is_refused(words, table, said, tmp_path, refuse):
    path = tmp_path / "cup.toml"
    path.write_text(CUP + table)
    assert said in refuse([words[0], str(path), *words[1:]])


def test_a_free_resonator_has_no_mount(tmp_path, refuse):
    path = tmp_path / "free.toml"
    path.write_text(CUP.replace("clamp_radius_mm = 3.0\n", "") + MOUNT)
    for command in ("modes", "tcf"):
        assert "free resonator" in refuse([command, str(path)])


def test_a_run_feels_the_base_and_knows_its_derivative(cup):
    """Settled, a run has the law's frequency; the derivative by the expansion is that of two runs."""
    card, profile = load_card(cup), parse_profile("step 20 0 24h")
    drive = drive_by_profile(profile, np.arange(0.0, profile.end, 60.0))
    name = "mount.expansion_per_K"
    here = predict(card, drive, [name])
    assert here.columns["frequency_Hz"][-1] == pytest.approx(float(here.law.frequency(273.15)), rel=1e-8)
    low, high = (predict(card.with_values({name: value}), drive).columns["frequency_Hz"] for value in (22e-6, 24e-6))
    expected = (high - low) / 2e-6
    assert here.derivatives[name]["frequency_Hz"] == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())
    warm = expected[0] / here.columns["frequency_Hz"][0]
    assert warm == pytest.approx(20 * here.law.prestress.by_base, rel=1e-3)
