"""Contract of the typed instrument: one parse of the whole card, values with their uncertainties, and new values of it."""

import math
import pickle
import tomllib

import numpy as np
import pytest

from studies.effects import library
from studies.errors import InputError
from studies.instrument.card import build_instrument, load_card, save_card, shipped_cards
from studies.instrument.display import display_name, name_constant
from studies.instrument.units import unit_of
from studies.sweeps.parameters import find_nominal

HRG = tomllib.loads(shipped_cards()["hrg-30mm"].read_text(encoding="utf-8"))
LAG = {"name": "second-lag", "weight": 0.1, "second_time_constant_s": 2000.0}


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"effect": {"name": "second-lag"}}, "effect must be an array of tables ([[effect]])"),
        ({"effect": [{"weight": 1}]}, '[[effect]] number 1: the line name = "..." is missing; add it.'),
        ({"effect": [{k: v for k, v in LAG.items() if k != "weight"}]}, "needs a coefficient; add weight."),
        ({"effect": [LAG | {"wieght": 0.1}]}, "[[effect]] number 1: unknown key 'wieght'; did you mean 'weight'"),
        ({"effect": [LAG, {"name": "second-leg"}]}, "did you mean 'second-lag'"),
        ({"thermal": {"cells": {"value": 3, "relativ_sd": 1}}}, "did you mean 'relative_sd'"),
        ({"effect": [LAG | {"second_time_constant_s": 1.0}]}, "second_time_constant_s must be at least 20, not 1."),
        ({"effect": [LAG | {"response": "bias_deg_per_h"}]}, "response = 'bias_deg_per_h' is unknown"),
        ({"resonator": {"shape": "meridian", "thickness_mm": 1, "segment": [{"kind": "line", "from_mm": [1, 0]}]}},
         "[[resonator.segment]] number 1: the key 'to_mm' is missing; add it."),
        ({"thermal": {"cells": {"value": 3}}}, "cells: its uncertainty is missing; give sd, relative_sd, or low and high."),
        ({"thermal": {"cells": {"sd": 3}}}, "cells: the key 'value' is missing; add it."),
        ({"loss": {"inverse_q": {"value": 1e-7, "sd": 1e-8, "relative_sd": 0.1}}}, "give sd or relative_sd, not both."),
        ({"loss": {"inverse_q": {"value": 1e-7, "low": 2e-7, "high": 1e-8}}}, "low must be below high"),
        ({"loss": {"inverse_q": {"value": 3e-7, "low": 1e-8, "high": 2e-7}}}, "value = 3e-07 lies outside low and high"),
        ({"loss": {"inverse_q": {"value": 1e-7, "low": -1e-7, "high": 2e-7}}}, "low = -1e-07 lies beyond 0"),
        ({"loss": {"curvature_per_K2": {"value": 0, "relative_sd": 0.2}}}, "a relative uncertainty of 0 is 0; give sd"),
    ],
)  # fmt: skip
def test_an_unusable_value_is_named_with_its_mend(table, words):
    with pytest.raises(InputError) as caught:
        build_instrument(HRG | table, "card.toml")
    assert words in str(caught.value)
    assert str(caught.value).startswith("card.toml")


@pytest.mark.parametrize("name", sorted(library()))
def test_every_effect_needs_a_coefficient_and_keeps_its_bounds(name):
    effect = library()[name]
    middle = {
        one.name: math.sqrt(one.low * one.high) if one.low > 0 else (one.low + one.high) / 2 for one in effect.shape
    }
    for response in effect.responses:
        coefficients = effect.coefficient_names(response)
        good = {"name": name, "response": response, coefficients[0]: 0.5, **middle}
        (entry,) = build_instrument(HRG | {"effect": [good]}).effects
        assert (entry.response, dict(entry.parameters)) == (response, {coefficients[0]: 0.5, **middle})
        bare = {key: value for key, value in good.items() if key != coefficients[0]}
        with pytest.raises(InputError, match=f"'{name}' needs a coefficient; add {coefficients[0]}"):
            build_instrument(HRG | {"effect": [bare]})
        for one in effect.shape:
            for bad, word in ((one.low - 1, "at least"), (one.high + 1 + 1e-3 * abs(one.high), "at most")):
                with pytest.raises(InputError, match=f"number 1: {one.name} must be {word}"):
                    build_instrument(HRG | {"effect": [good | {one.name: bad}]})
        if effect.positive:
            with pytest.raises(InputError, match=f"{coefficients[0]} must be at least 0"):
                build_instrument(HRG | {"effect": [good | {coefficients[0]: -0.5}]})


@pytest.mark.parametrize("name", sorted(shipped_cards()))
def test_every_uncertain_value_can_be_set_saved_and_found_again(tmp_path, name):
    """And the card as it is comes back equal, with its uncertainties, from a file and from another process."""
    card = load_card(name)
    save_card(card, tmp_path / "again.toml")
    again = load_card(tmp_path / "again.toml")
    assert (again, again.uncertain) == (card, card.uncertain)
    assert pickle.loads(pickle.dumps(card)) == card
    generator = np.random.default_rng(3)
    drawn = {one.name: one.draw(generator) for one in card.uncertain}
    other = card.with_values({key: {"value": value, "sd": 1e-3 * abs(value) + 1e-9} for key, value in drawn.items()})
    save_card(other, tmp_path / "other.toml")
    found = {one.name: one for one in load_card(tmp_path / "other.toml").uncertain}
    assert {key: one.value for key, one in found.items()} == drawn
    assert all(one.sd == pytest.approx(1e-3 * abs(one.value) + 1e-9) for one in found.values())
    assert other != card


def test_a_stated_uncertainty_replaces_the_documented_one():
    given = {"value": 0.012, "relative_sd": 0.1, "high": 0.02}
    card = build_instrument(HRG | {"thermal": {"mount_conductance_W_per_K": given, "mount_exchange_cm2": 4.0}})
    found = {one.name: one for one in card.uncertain}
    mount = found["thermal.mount_conductance_W_per_K"]
    assert (mount.value, mount.sd, mount.low, mount.high) == (0.012, pytest.approx(0.0012), 0.0, 0.02)
    assert (mount.logarithmic, mount.unit) == (True, "W/K")
    assert found["thermal.mount_exchange_cm2"].sd == 4.0  # documented as a part of the value
    assert card.heat_path.mount_conductance == 0.012
    assert card.heat_path.mount_exchange == pytest.approx(4e-4)
    even = card.with_values({"thermal.mount_conductance_W_per_K": {"value": 0.02, "low": 0.01, "high": 0.04}})
    (mount,) = (one for one in even.uncertain if one.name == mount.name)
    assert mount.sd == pytest.approx(0.03 / math.sqrt(12))
    exact = card.with_values({"thermal.mount_conductance_W_per_K": {"value": 0.02, "sd": 0.0}})
    assert mount.name not in {one.name for one in exact.uncertain}


def test_any_number_of_any_table_may_be_uncertain():
    resonator = HRG["resonator"] | {"thickness_mm": [[0, {"value": 0.86, "sd": 0.002}], [1, 0.85]]}
    resonator["stem"] = HRG["resonator"]["stem"] | {"radius_mm": {"value": 2.5, "relative_sd": 0.01}}
    effect = LAG | {"weight": {"value": 0.1, "sd": 0.02}}
    card = build_instrument(HRG | {"resonator": resonator, "effect": [effect]})
    found = {one.name: one for one in card.uncertain}
    assert found["resonator.thickness_mm.0.1"].sd == 0.002
    assert found["resonator.stem.radius_mm"].unit == "mm"
    assert found["effect.0.weight"].low == -math.inf
    new = card.with_values({"resonator.thickness_mm.0.1": 0.87, "effect.0.weight": 0.3})
    assert new.resonator.thickness[0] == (0.0, pytest.approx(0.87e-3))
    assert new.effects[0].parameters["weight"] == 0.3
    assert {one.name: one.sd for one in new.uncertain}["resonator.thickness_mm.0.1"] == 0.002
    assert card.resonator.thickness[0] == (0.0, pytest.approx(0.86e-3))  # never a mutation


def test_the_deviation_of_the_law_is_a_value_of_the_card():
    """One per cent of E, and a slope of E by 1e-5 1/K more, at 40 °C: f goes as the root of E."""
    card = load_card("cvg-25mm")
    E = card.material.value("youngs_modulus", 313.15)
    law = "material.deviation.youngs_modulus"
    other = card.with_values({f"{law}.log_value": math.log(1.01), f"{law}.log_slope_per_K": 1e-5})
    assert other.material.value("youngs_modulus", 313.15) == pytest.approx(1.01 * math.exp(2e-4) * E, rel=1e-12)
    silica = load_card("hrg-30mm")
    names = {one.name for one in silica.uncertain}
    assert all(name in names for pair in silica.correlation for name in pair)
    prior = silica.material.prior
    assert "material.deviation.poisson_ratio.value" in names
    known = silica.with_values({"material.deviation.poisson_ratio.value": {"value": 1e-3, "sd": 1e-4}})
    (nu,) = (one for one in known.uncertain if one.name == "material.deviation.poisson_ratio.value")
    assert (nu.value, nu.sd) == (1e-3, 1e-4)
    assert not [pair for pair in known.correlation if nu.name in pair]
    assert known.material.value("poisson_ratio", 293.15) == pytest.approx(
        silica.material.value("poisson_ratio", 293.15) + 1e-3
    )
    assert len(prior.names) == len(known.material.prior.names)
    given = silica.with_values({"material.youngs_modulus_GPa": {"value": 73.0, "sd": 0.5}})
    assert "material.deviation.shear_modulus.log_value" not in {one.name for one in given.uncertain}
    with pytest.raises(
        InputError, match=r"\[material\.deviation\.shear_modulus\]: unknown key .* mean 'log_slope_per_K'"
    ):
        silica.with_values({"material.deviation.shear_modulus.log_slop_per_K": 1.0})
    with pytest.raises(InputError, match="coefficients of shear_modulus: must be positive"):
        silica.with_values({"material.deviation.shear_modulus.log_value": 1e4})
    assert find_nominal(silica, "material.deviation.shear_modulus.log_value", "study") == 0.0


def test_a_value_whose_uncertainty_is_a_part_of_it_may_become_nothing():
    card = load_card("cvg-25mm").with_values({"bias.damping_anisotropy": 0.0})
    assert card.bias.damping_anisotropy == 0.0
    assert "bias.damping_anisotropy" not in {one.name for one in card.uncertain}


@pytest.mark.parametrize(
    "name", ["thermal.film_emisivity", "thermic.cells", "resonator.radius_mm.2", "effect.3.weight"]
)
def test_a_value_that_the_card_cannot_have_is_refused(name):
    with pytest.raises(InputError):
        load_card("hrg-30mm").with_values({name: 1.0})


def test_priors_are_drawn_as_they_are_stated():
    """A logarithmic value has the median `value`; low and high are never passed."""
    generator = np.random.default_rng(5)
    card = build_instrument(HRG | {"thermal": {"film_emissivity": {"value": 0.3, "relative_sd": 0.5, "high": 0.4}}})
    found = {one.name: one for one in card.uncertain}
    drawn = [found["thermal.film_emissivity"].draw(generator) for _ in range(500)]
    assert 0.0 < min(drawn) <= max(drawn) <= 0.4
    q = [found["loss.inverse_q"].draw(generator) for _ in range(2000)]
    assert np.median(q) == pytest.approx(1e-7, rel=0.1)
    assert np.std(np.log(q)) == pytest.approx(1.0, rel=0.1)


def test_a_number_far_more_uncertain_than_itself_is_cut_off_at_0():
    """A pole of 0.01 ± 1000 s of an extended model, log-normal, reached e^100 000 and could not be saved."""
    card = load_card("hrg-30mm").with_values({"noise.housing_lag_s": {"value": 0.01, "sd": 1000.0}})
    (lag,) = (one for one in card.uncertain if one.name == "noise.housing_lag_s")
    drawn = [lag.draw(np.random.default_rng(seed)) for seed in range(200)]
    assert 0.0 <= min(drawn) < max(drawn) < 5000.0
    assert np.median(drawn) == pytest.approx(674.5, rel=0.25)  # of a half normal law


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("thermal.conductivity_W_per_m_K", "W/(m K)"),
        ("material.density_kg_m3", "kg/m³"),
        ("resonator.thickness_mm.1.1", "mm"),
        ("bias.k9_deg_per_h_s2_per_Hz3", "°/h s²/Hz³"),
        ("noise.bias_walk_deg_per_h_per_rt_h", "°/h/√h"),
        ("effect.0.coefficient_deg_per_h_per_K_per_s", "°/h/(K/s)"),
        ("effect.0.leakage_slope_deg_per_h_per_V_per_10K", "°/h/V/(10 K)"),
        ("effect.0.quadratic_K_per_10K2", "K/(10 K)²"),
        ("effect.0.growth_per_day", "1/d"),
        ("material.deviation.expansion.slope_per_K", "1/K²"),
        ("loss.inverse_q", "1"),
        ("imperfection.wall.cosine_1_um", "µm"),
        ("effect.0.drift_1", "1"),
        ("effect.0.loop_1_per_K", "1/K"),
        ("electrodes.resistance_ohm", "Ω"),
        ("bias_trend_deg_per_h_per_year", "°/h/year"),
        ("inverse_q_trend_per_year", "1/year"),
        ("electrodes.gap_wave.0.amplitude_percent", "%"),
    ],
)
def test_a_key_carries_its_unit(key, unit):
    assert unit_of(key) == unit


@pytest.mark.parametrize("card", shipped_cards())
def test_every_uncertain_value_has_a_name_of_its_own(card: str) -> None:
    keys = [one.name for one in load_card(card).uncertain]
    names = [display_name(key) for key in keys]
    assert len(set(names)) == len(keys)
    assert not [name for name in names if "_" in name or "." in name]


def test_names_say_what_the_key_means() -> None:
    assert display_name("material.deviation.shear_modulus.log_slope_per_K") == "temperature slope of the shear modulus"
    assert display_name("loop.pickoff_phase_deg") == "pick-off phase error"
    assert display_name("resonator.thickness_mm.1.1") == "wall thickness at point 2"
    assert display_name("loss.film.1.thickness_nm") == "film 2 thickness"
    assert name_constant("conductance housing-base") == "conductance housing to base"
