"""A material given at one temperature: its slope is not known, and no command prints it as 0."""

import math

import pytest

from studies.cli import main

CARD = """schema = "hrg.card/1"
name = "hand"
[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.9
[material]
name = "my-steel"
youngs_modulus_GPa = 190.0
poisson_ratio = 0.3
density_kg_m3 = 8000.0
"""
E_SLOPE, EXPANSION = -2.4e-4, 12e-6  # 1/K
KNOWN = f"[material.deviation]\nyoungs_modulus.log_slope_per_K = {E_SLOPE}\nexpansion.value = {EXPANSION}\n"


@pytest.fixture
def card(tmp_path):
    path = tmp_path / "hand.toml"
    path.write_text(CARD)
    return path


def test_slope_is_refused_with_the_keys_that_would_tell_it(card, refuse):
    said = refuse(["tcf", str(card)])
    assert "not known" in said
    assert str(card) in said
    assert "[material.deviation.youngs_modulus] log_slope_per_K" in said
    assert "[material.deviation.expansion] value" in said


def test_one_missing_half_is_named_alone(card, refuse):
    card.write_text(CARD + f"[material.deviation]\nyoungs_modulus.log_slope_per_K = {E_SLOPE}\n")
    said = refuse(["tcf", str(card)])
    assert "expansion" in said
    assert "log_slope_per_K" not in said


def test_given_slopes_are_those_of_the_free_shell(card, ask):
    """Free expansion without a change of ν: d ln f/dT = ½ (E′/E + α), since f ∝ √(E/ρ)/R and ρ ∝ R⁻³."""
    card.write_text(CARD + KNOWN)
    (point,) = ask(["tcf", str(card), "--from", "20", "--to", "20"])["points"]
    assert point["slope_ppm_per_degC"] == pytest.approx(1e6 * (E_SLOPE + EXPANSION) / 2, rel=1e-6)


def test_comparison_and_modes_leave_open_what_is_not_known(card, ask):
    slope = next(one for one in ask(["compare", card, "free-dome"])["figures"] if one["name"] == "slope")
    assert slope["values"][0] is None
    assert slope["uncertainties"][0] is None
    assert slope["values"][1] > 0
    assert ask(["modes", card])["modes"][0]["material_uncertainty_Hz"] is None


@pytest.mark.parametrize("words", [["calibrate", "CARD", "TABLE"], ["diagnose", "TABLE", "--card", "CARD"]])
def test_readings_over_temperature_are_not_compared_with_a_slope_of_0(card, refuse, words):
    named = {"CARD": str(card), "TABLE": "studies/papers/hrg_table1.csv"}
    said = refuse([named.get(word, word) for word in words])
    assert "the slope of the frequency is not known" in said
    assert f"({card}:7)" in said  # the line of [material]


@pytest.mark.parametrize(
    ("more", "line"),
    [
        ("radius = 1\n", 12),
        ("[[imperfection.mass]]\nmass_ug = 5.0\nazimuth_deg = 0.0\n[[imperfection.mass]]\nmass = 5.0\n", 16),
        ("[loop]\n# range\nadc_step_uV = 'x'\n", 14),
        ("[resonator.stem]\nradius_mm = 2.5\nend_mm = -5.0\nside = 'inside'\n", 15),
    ],
)
def test_a_wrong_key_is_shown_with_its_line(card, capsys, more, line):
    card.write_text(CARD + more)
    assert main(["cards", str(card)]) == 2
    assert capsys.readouterr().err.endswith(f" ({card}:{line})\n")


@pytest.mark.parametrize("name", ["my-steel", "fused-silica"])  # the law of silica states shear modulus and ratio
def test_given_values_make_every_mode_as_uncertain_as_they_say(card, ask, name):
    """f ∝ √(E/ρ); by Poisson's ratio each mode has its own slope, here from two solves."""
    text = CARD.replace("my-steel", name).replace("190.0", "{ value = 190.0, sd = 19.0 }")

    def modes(ratio):
        card.write_text(text.replace("8000.0", "{ value = 8000.0, relative_sd = 0.02 }").replace("0.3\n", ratio))
        return ask(["modes", card, "--harmonic", "1", "2", "3"])["modes"]

    found, below, above = modes("{ value = 0.3, sd = 0.05 }\n"), modes("0.29\n"), modes("0.31\n")
    for mode, low, high in zip(found, below, above, strict=True):
        by_nu = 0.05 * math.log(high["frequency_Hz"] / low["frequency_Hz"]) / 0.02
        expected = mode["frequency_Hz"] * math.hypot(0.5 * 0.1, 0.5 * 0.02, by_nu)
        assert mode["material_uncertainty_Hz"] == pytest.approx(expected, rel=1e-3)


def test_stated_slopes_make_that_of_the_frequency_as_uncertain_as_they_say(card, ask):
    """d ln f/dT = ½ (E′/E + α) of a free shell."""
    card.write_text(
        f"{CARD}[material.deviation]\nyoungs_modulus.log_slope_per_K = {{ value = {E_SLOPE}, sd = 4e-6 }}\n"
        f"expansion.value = {{ value = {EXPANSION}, sd = 3e-6 }}\n"
    )
    for point in ask(["tcf", card, "--from", "0", "--to", "40"])["points"]:
        assert point["uncertainty_ppm_per_degC"] == pytest.approx(2.5, rel=1e-6)
