"""Every effect of the library keeps the same contract; that none is missing is seen by the stranger, who hides each by its name."""

import ast
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import fields

import studies.diagnosis
import studies.inference
from studies.cli import main
from studies.effects import Lags, Span, States, apply_effect, apply_effects, find_effect, library
from studies.effects.states import lag
from studies.errors import InputError
from studies.instrument.card import load_card, save_card
from studies.instrument.tables.effect import keys_of


def make_states(run=0):
    time = np.arange(0.0, 20000.0, 60.0)
    housing = 293.15 + 20.0 * np.sin(time / 3000.0) + 5.0 * np.sin(time / 700.0)
    return States(
        run,
        time,
        time + 86400.0 * run,
        housing,
        lag(housing, 60.0, 1500.0),
        Lags.one(1500.0),
        293.15,
        amplitude_squared=1.0 + 0.2 * (time > 9000),
        voltage_squared=6400.0 + 3000.0 * (time > 12000),
        quadrature=np.cos(time / 5000.0),
        pattern_angle=np.full(time.shape, 0.3) + 0.4 * (time > 10000),
    )


SPAN = Span(270.0, 315.0, 20000.0, 106400.0, 60.0, 1500.0, 2, (make_states().time, make_states(1).time), turns=True)


@pytest.mark.parametrize("name", sorted(library()))
def test_every_key_that_a_card_may_give_an_effect_is_listed(name, ask, capsys, monkeypatch):
    """Against what the reader of cards takes, for each response: key, unit, default, bounds, and which responses there are."""
    monkeypatch.setenv("COLUMNS", "300")
    effect = find_effect(name)
    listed = {row["name"]: row for row in ask(["effects", name])["effects"][0]["parameters"]}
    assert main(["effects", name]) == 0
    shown = capsys.readouterr().out
    accepted = [field for r in effect.responses for field in fields(keys_of({"name": name, "response": r}, ""))]
    assert set(listed) == {field.name for field in accepted}
    for field in accepted:
        row = listed[field.name]
        assert f" {field.name} " in shown
        assert row["required"] == field.required
        assert row["default"] == (None if field.required else field.default)
    assert listed["response"]["kind"].split(" | ") == sorted(effect.responses)
    assert all(word in shown for word in effect.responses)
    for one in effect.shape:
        assert listed[one.name]["bounds"] == f"at least {one.low:g}, at most {one.high:g}"
        assert listed[one.name]["meaning"] == one.meaning


@pytest.mark.parametrize("name", sorted(library()))
def test_effect_keeps_the_contract(name):
    effect = find_effect(name)
    assert effect.name == name
    assert effect.acts_on in ("temperature", "response")
    assert all(getattr(effect, words) for words in ("summary", "source", "isolate"))
    assert set(effect.responses) <= {"frequency_Hz", "bias_deg_per_h", "inverse_q"}
    for response in effect.responses:
        shapes = list(effect.grid(SPAN, response))
        assert shapes
        assert effect.sizes[response] > 0
        for shape in shapes[:: max(1, len(shapes) // 7)]:
            assert len(shape) == len(effect.shape)
            for value, parameter in zip(shape, effect.shape, strict=True):
                assert parameter.low <= value <= parameter.high or parameter.name in ("onset_s",)
            columns = effect.columns(make_states(), shape, response)
            assert columns.shape == (make_states().time.size, effect.spread.size)
            assert np.isfinite(columns).all()
            for other in effect.responses if effect.alike else ():
                assert np.array_equal(effect.columns(make_states(), shape, other), columns)
        for other in effect.equivalents.get(response, ()):
            assert other in library()


@pytest.mark.parametrize("name", sorted(library()))
def test_forward_run_is_linear_in_its_coefficients(name):
    effect = find_effect(name)
    response = effect.responses[0]
    shape = next(iter(effect.grid(SPAN, response)), ())
    parameters = {p.name: v for p, v in zip(effect.shape, shape, strict=True)}
    for key in effect.coefficient_names(response):
        target, once = apply_effect(name, {**parameters, key: 0.5}, make_states(), response)
        _, twice = apply_effect(name, {**parameters, key: 1.0}, make_states(), response)
        assert target == ("resonator_temperature" if effect.acts_on == "temperature" else response)
        assert np.allclose(twice, 2.0 * once)
        assert np.isfinite(once).all()


def test_no_list_of_a_card_is_longer_than_its_family():
    loop = {"name": "hysteresis", "half_width_K": 1.0, "loop_deg_per_h_per_K": [1.0] * 6}
    with pytest.raises(InputError, match="a list of 1 to 5 numbers"):
        load_card("free-dome").with_table("effect", [loop])


def test_a_number_is_the_first_member_of_a_list():
    states = make_states()
    key = "loop_deg_per_h_per_K"
    _, one = apply_effect("hysteresis", {"half_width_K": 1.0, key: 0.3}, states)
    _, same = apply_effect("hysteresis", {"half_width_K": 1.0, key: [0.3]}, states)
    _, more = apply_effect("hysteresis", {"half_width_K": 1.0, key: [0.3, 0.1]}, states)
    assert np.array_equal(one, same)
    assert not np.allclose(one, more)


def test_slow_sensor_ahead_of_its_device():
    """Forward, the lag of a sensor undoes itself: lag(T_s + τ_s dT_s/dt; τ), with T_s the lag of the true temperature."""
    from dataclasses import replace

    t = np.arange(0.0, 20000.0, 5.0)
    true = 293.15 + 10.0 * np.sin(t / 3000.0)
    sensed = lag(true, 5.0, 120.0)
    states = replace(
        make_states(), time=t, campaign_time=t, housing=sensed, resonator=lag(sensed, 5.0, 900.0), lags=Lags.one(900.0)
    )
    _, change = apply_effect("thermometer-lag", {"sensor_time_constant_s": 120.0}, states)
    late = t > 5000.0
    assert np.allclose((states.resonator + change)[late], lag(true, 5.0, 900.0)[late], atol=0.01)


def test_second_lag_is_the_sum_of_two_lags():
    states = make_states()
    _, change = apply_effect("second-lag", {"weight": 0.3, "second_time_constant_s": 6000.0}, states)
    whole = 0.7 * lag(states.housing, 60.0, 1500.0) + 0.3 * lag(states.housing, 60.0, 6000.0)
    assert np.allclose(states.resonator + change, whole)


def test_static_effects_see_the_temperature_that_thermal_effects_leave():
    from dataclasses import replace

    states = make_states()
    warm = ("self-heating", "frequency_Hz", {"heating_K_per_V2": 3.0}, 0.0)
    rate = ("rate-bias", "bias_deg_per_h", {"coefficient_deg_per_h_per_K_per_s": 100.0}, 0.0)
    changes = apply_effects([rate, warm], states)
    _, warmer = apply_effect(warm[0], warm[2], states)
    assert np.allclose(changes["resonator_temperature"], warmer)
    seen = replace(states, resonator=states.resonator + warmer)
    assert np.allclose(changes["bias_deg_per_h"], apply_effect(rate[0], rate[2], seen, rate[1])[1])


def test_the_engine_knows_no_effect_by_its_name():
    """Names live in the entries: what a diagnosis must know of an effect is a field of it."""
    folders = [Path(package.__file__).parent for package in (studies.diagnosis, studies.inference)]
    found = [
        (path.name, node.lineno, node.value)
        for path in sorted(path for folder in folders for path in folder.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and node.value in library()
    ]
    assert not found


def test_of_a_positive_effect_only_the_first_coefficient_cannot_be_negative(tmp_path):
    """What a diagnosis saves of a leak, a hole with less outgassing than a straight line says, must load."""
    card = load_card("hrg-30mm")
    leak = {"name": "leak", "response": "inverse_q", "temperature_exponent": 0.5}
    slowing = card.with_table("effect", [leak | {"growth_1_per_day": 2e-8, "outgassing_1_per_root_day": -1e-9}])
    save_card(slowing, tmp_path / "card.toml")
    assert load_card(tmp_path / "card.toml").content["effect"][0]["outgassing_1_per_root_day"] == -1e-9
    with pytest.raises(InputError, match="at least 0"):
        card.with_table("effect", [leak | {"growth_1_per_day": -2e-8}])


def test_no_more_heat_is_radiated_than_there_is():
    whole = {"name": "radiation", "radiated_share": 1.0}
    card = load_card("hrg-30mm").with_table("effect", [whole])
    assert card.effects[0].parameters["radiated_share"] == 1.0
    with pytest.raises(InputError, match=r"radiated_share must be .*at most 1"):
        card.with_table("effect", [whole | {"radiated_share": 1.4}])
