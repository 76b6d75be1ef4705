"""`hrg loads`: what its parts are."""

import pytest

from studies.instrument.card import load_card, save_card
from studies.loss.model import loss_model


def test_pressure_is_stress_and_the_inertia_of_the_gas_of_the_card(tmp_path, ask):
    """Contract: the shift by pressure is the sum of both; an ideal gas, ρ = p M/(R T), stated; both are proportional to p."""
    card = tmp_path / "argon.toml"
    save_card(load_card("hrg-30mm").with_values({"loss.gas": "argon"}), card)
    words = ["loads", card, "--from", "20", "--to", "20", "--pressure"]
    (one, two), air = (
        (ask([*words, p]) for p in ("40", "80")),
        ask(["loads", "hrg-30mm", *words[2:], "80"]),
    )
    for found in (one, two, air):
        (row,) = (row for row in found["loads"] if row["load"] == "pressure")
        assert row["shift_ppm"] == pytest.approx(found["gas"]["elastic_ppm"] + found["gas"]["inertia_ppm"], rel=1e-12)
    assert two["gas"]["density_kg_m3"] == pytest.approx(80e3 * 0.039948 / (8.314462618 * 293.15), rel=1e-9)
    assert (two["gas"]["gas"], air["gas"]["gas"]) == ("argon", "air")
    for key in ("elastic_ppm", "inertia_ppm", "sound_inverse_q"):
        assert two["gas"][key] == pytest.approx(2 * one["gas"][key], rel=1e-9)
    assert two["gas"]["inertia_ppm"] < 1.3 * air["gas"]["inertia_ppm"] < 0
    sound = f"in the open it adds 1/Q = {air['gas']['sound_inverse_q']:.2g}."
    for pressure, said in ((80e3, True), (1e-3, False)):  # where molecules fly past the wall nothing sounds
        left_out = loss_model(load_card("hrg-30mm").with_values({"loss.pressure_Pa": pressure})).left_out
        assert any(sound in words for words in left_out) is said
