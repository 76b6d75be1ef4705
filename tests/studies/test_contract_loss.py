"""`hrg loss` and the loss parts of a card: schema, units, uncertainties, bad input named with its mend, speed-free."""

import numpy as np
import pytest
import tomli_w

from studies.cli import main
from studies.instrument.card import build_instrument, load_card, shipped_cards
from studies.loss.model import loss_model

DOME = {
    "schema": "hrg.card/1",
    "name": "dome",
    "resonator": {"shape": "hemisphere", "radius_mm": 15.0, "thickness_mm": 0.9},
    "material": {"name": "fused-silica"},
}
GOLD = {"material": "gold", "thickness_nm": 100.0, "loss": 1e-4}
PEAK = {"height": 1e-9, "energy_eV": 0.5, "peak_degC": 120.0}


AT_20 = ("--from", "20", "--to", "20")


@pytest.fixture
def write(tmp_path):
    """Write the dome with other tables as a card, and return its path."""

    def written(**tables):
        path = tmp_path / "card.toml"
        path.write_text(tomli_w.dumps(DOME | tables), encoding="utf-8")
        return str(path)

    return written


@pytest.fixture
def say(capsys):
    """Return what `hrg loss` prints of a card."""

    def said(card):
        capsys.readouterr()
        assert main(["loss", card]) == 0
        return capsys.readouterr().out

    return said


@pytest.mark.parametrize("card", sorted(shipped_cards()))
def test_every_shipped_card_has_a_budget(ask, card):
    found = ask(["loss", card, "--from", "20", "--to", "30"])
    assert found["schema"] == "hrg.loss/1"
    total = np.sum([part["inverse_q"] for part in found["parts"]], axis=0)
    assert found["inverse_q"] == pytest.approx(total.tolist(), rel=1e-12)
    assert found["q"] == pytest.approx((1 / total).tolist(), rel=1e-12)
    assert found["attack_first"]["part"] == found["parts"][0]["name"]
    assert all(a < b < c for a, b, c in zip(found["inverse_q_low"], total, found["inverse_q_high"], strict=True))
    assert all(part["source"] for part in found["parts"])


def test_gas_in_the_gap_is_named_with_its_bound(ask, write):
    """A thin ring bends with u = w/n: half a spring p/g on its face is 1/Q = p/(2 g ρ h ω²) / (1 + 1/n²)."""
    ring = {"shape": "cylinder", "radius_mm": 12.5, "thickness_mm": 0.3, "height_mm": 0.5}
    gap = {"gap_um": 20.0, "count": 16, "face": "outer"}
    found = ask(["loss", write(resonator=ring, loss={"pressure_Pa": 1e-2}, electrodes=gap), *AT_20])
    (words,) = (words for words in found["left_out"] if words.startswith("gas squeezed in the gap"))
    gas = next(part for part in found["parts"] if part["name"] == "gas")["inverse_q"][0]
    density, omega = 2200.0, 2 * np.pi * found["frequency_Hz"]
    most = 1e-2 / (2 * 20e-6 * density * 0.3e-3 * omega**2) / 1.25
    bound, times = (float(words.split(at)[1].split()[0]) for at in ("1/Q = ", "µm, "))
    assert bound == pytest.approx(most, rel=0.05)  # two digits are printed
    assert times == pytest.approx(most / gas, rel=0.05)


def test_every_key_of_the_card_makes_its_part(ask, write, say):
    loss = {"pressure_Pa": {"value": 1e-2, "relative_sd": 0.1}, "gas": "nitrogen", "anchor_inverse_q": 2e-9}
    loss |= {
        "film": [GOLD, GOLD | {"material": "chromium", "thickness_nm": 10.0, "face": "inner"}],
        "activated": [PEAK],
    }
    answer = ask(["loss", write(loss=loss), *AT_20])
    found = {part["name"]: part for part in answer["parts"]}
    wanted = {
        "thermoelastic", "bulk", "surface", "gold film", "gold film, heat", "chromium film", "chromium film, heat",
    }  # fmt: skip
    assert set(found) == {*wanted, "gas", "mount", "activated"}
    assert found["gas"]["relative_sd"] == pytest.approx(np.hypot(0.1, 0.1))
    assert found["mount"]["inverse_q"] == pytest.approx([2e-9])
    assert answer["left_out"] == []
    assert "Reduce first: gold film" in say(write(loss=loss))


def test_it_is_said_which_q_a_simulation_takes(write, say):
    """A budget of 2e7 once stood beside a simulation of 1e7 without a word."""
    assert "they use the default of [loss] inverse_q = 1.00e-7 (Q = 1.00e7)" in say(write())
    assert "Simulations take 1/Q from this budget." in say(write(loss={"film": [GOLD]}))


def test_uncertain_parts_are_values_of_the_card():
    card = build_instrument(DOME | {"loss": {"pressure_Pa": 1e-3, "film": [GOLD], "activated": [PEAK]}})
    found = {one.name: (one.value, one.sd, one.unit) for one in card.uncertain}
    assert found["loss.pressure_Pa"] == (1e-3, 5e-4, "Pa")
    assert found["loss.film.0.thickness_nm"] == (100.0, 10.0, "nm")
    assert found["loss.film.0.loss"] == (1e-4, 1e-4, "1")
    assert found["loss.activated.0.height"] == (1e-9, 5e-10, "1")
    thicker = card.with_values({"loss.film.0.thickness_nm": 200.0})
    part = {p.name: p.inverse_q[0] for p in loss_model(card).budget(293.15).parts}
    twice = {p.name: p.inverse_q[0] for p in loss_model(thicker).budget(293.15).parts}
    assert twice["gold film"] == pytest.approx(2 * part["gold film"], rel=1e-12)
    assert twice["surface"] == part["surface"]


def test_a_published_surface_is_chosen_by_its_treatment():
    part = [
        {p.name: p.inverse_q[0] for p in loss_model(build_instrument(DOME | {"loss": loss})).budget(293.15).parts}
        for loss in ({}, {"surface_treatment": "mechanically-polished"})
    ]
    assert part[1]["surface"] == pytest.approx(
        3 * part[0]["surface"], rel=1e-9
    )  # three times as lossy, says the source


def test_what_no_source_states_is_left_out_and_said():
    found = loss_model(load_card("bvg-bell"))
    assert any(sentence.startswith("bulk: no source states that of 3j53") for sentence in found.left_out)
    assert any(sentence.startswith("gas: give pressure_Pa") for sentence in found.left_out)


@pytest.mark.parametrize(
    ("loss", "words"),
    [
        ({"gas": "xenon"}, "gas = 'xenon' is unknown"),
        ({"film": [GOLD | {"thickness_nm": 2e6}]}, "thicker than the wall (0.9 mm): is it in nm?"),
        ({"film": [GOLD | {"thickness_nm": 1e5}]}, "more than 5 % of the wall"),
        ({"film": [{"material": "gold", "thickness_nm": 100.0}]}, "no source states loss of the film 'gold'; add it."),
        (
            {"film": [{"material": "ti", "thickness_nm": 9.0}]},
            "(films of the table: gold, chromium, tantala, silica); add it.",
        ),
        ({"film": [GOLD | {"from_position": 1.0}]}, "from_position (1) is not before to_position (1)."),
        ({"activated": [PEAK | {"energy_eV": 0.0}]}, "energy_eV must be"),
        ({"unbalance_mg": 1.0}, "on a stem"),
        ({"surface_treatment": "drown"}, "did you mean 'drawn'?"),
        ({"inverse_q": 1e7}, "inverse_q = 1e+07 must lie between 0 and 0.1: it is 1/Q, not Q."),
    ],
)
def test_an_unusable_part_is_named_with_its_mend(refuse, write, loss, words):
    said = refuse(["loss", path := write(loss=loss)])
    assert words in said
    assert path in said


def test_anchor_of_a_stem(ask):
    found = {part["name"]: part for part in ask(["loss", "hrg-30mm", "--anchor", *AT_20])["parts"]}
    assert 0 < found["anchor"]["inverse_q"][0] < 1e-15


@pytest.mark.parametrize(
    ("quality", "words"),
    [
        (4e6, "The stated loss exceeds these contributions"),
        (2.5e7, "Explained share of the stated loss"),
        (9e8, "one of them is too large"),
    ],
)
def test_a_measured_q_stands_beside_what_the_parts_explain(ask, write, say, quality, words):
    found = ask(["loss", path := write(loss={"inverse_q": 1 / quality})])
    explained = found["stated"]["explained"]
    assert found["stated"]["explained_low"] < explained < found["stated"]["explained_high"]
    at = found["temperature_degC"].index(20.0)
    assert explained == pytest.approx(found["inverse_q"][at] * quality, rel=1e-9)
    assert words in say(path)
    assert ask(["loss", "free-dome"])["stated"] is None


def test_masses_on_the_rim_unbalance_it(ask, write):
    """A point mass of the card's [[imperfection.mass]] is the same first and third harmonic as given ones, and damps unequally."""
    stem = {"support": "stem", "stem": {"radius_mm": 2.5, "end_mm": -5.0, "fillet_mm": 0.5}}
    given = {
        "unbalance_mg": 10.0,
        "unbalance_azimuth_deg": 20.0,
        "third_unbalance_mg": 10.0,
        "third_unbalance_azimuth_deg": 20.0,
    }
    masses = {"mass": [{"mass_ug": 1e4, "azimuth_deg": 20.0}]}
    found = [
        ask(["loss", write(resonator=DOME["resonator"] | stem, **tables), *AT_20])
        for tables in ({"loss": given}, {"imperfection": masses})
    ]
    one, other = ({part["name"]: part["inverse_q"][0] for part in payload["parts"]}["imbalance"] for payload in found)
    assert one > 0
    assert other == pytest.approx(one, rel=1e-9)
    around, again = (payload["anisotropy"]["inverse_q_split"][0] for payload in found)
    assert 0 < around <= 2 * one * (1 + 1e-9)
    assert again == pytest.approx(around, rel=1e-9)


@pytest.mark.parametrize(("film", "loss"), [("tantala", 2.3e-4), ("silica", 4e-5)])
def test_a_dielectric_film_of_the_table_needs_its_thickness_alone(film, loss):
    """gwinc states their loss and heat; a given loss angle replaces that of the table."""
    keys = {"material": film, "thickness_nm": 100.0}
    found = []
    for more in ({}, {"loss": 2 * loss}):
        card = build_instrument(DOME | {"loss": {"film": [keys | more]}})
        found.append({part.name: part for part in loss_model(card).budget(293.15).parts})
    own, twice = (parts[f"{film} film"] for parts in found)
    assert "gwinc" in own.source
    assert twice.inverse_q == pytest.approx(2 * own.inverse_q)
    assert 0 < found[0][f"{film} film, heat"].inverse_q[0] < own.inverse_q[0]
