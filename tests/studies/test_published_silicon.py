"""A card of cubic silicon with films: what `hrg modes` says of them."""

import json

import pytest

from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card

CARD = """schema = "hrg.card/1"
name = "silicon"
[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.9
[material]
name = "silicon (100)"
density_kg_m3 = 2329.0
crystal = { C11_GPa = 165.7, C12_GPa = 63.9, C44_GPa = 79.6 }
[[loss.film]]
material = "gold"
thickness_nm = 100
loss = 1e-4
"""


@pytest.fixture
def modes(tmp_path, capsys):
    def read(text, *words):
        (tmp_path / "card.toml").write_text(text)
        assert main(["modes", str(tmp_path / "card.toml"), "--json", *words]) == 0
        return json.loads(capsys.readouterr().out)["modes"]

    return read


@pytest.mark.slow
def test_the_pair_of_a_silicon_dome(modes):
    """By NGSolve (tests/benchmarks/cubic_ngsolve.py of 722ba988); n = 4 is not solved."""
    two, four = modes(CARD, "--harmonic", "2", "4")
    pair = two["crystal"]
    assert [pair["antinode_along_100_Hz"], pair["other_Hz"]] == pytest.approx([6407.882, 6876.657], rel=1e-5)
    assert "crystal" not in four


def test_films_of_a_card_shift_its_frequency(modes):
    """A film is a thicker wall where it is of the wall's own glass, half as much where it covers half of it."""
    glass = CARD.split("[material]")[0] + '[material]\nname = "fused-silica"\n'
    own = (
        'material = "own"\nthickness_nm = 100\nloss = 0.0\n'
        "youngs_modulus_GPa = 72.0\npoisson_ratio = 0.167\ndensity_kg_m3 = 2202.0\n"
    )
    films = f'{glass}youngs_modulus_GPa = 72.0\npoisson_ratio = 0.167\ndensity_kg_m3 = 2202.0\n[[loss.film]]\n{own}[[loss.film]]\n{own}coverage = 0.5\n[[loss.film]]\nmaterial = "tantala"\nthickness_nm = 100\n'
    (two,) = modes(films)
    whole, half, unknown = two["films"]
    # both faces: the wall grows by 2 t with its middle surface where it was
    assert whole["shift_ppm"] == pytest.approx(1e6 * two["sensitivities"]["thickness"] * 2e-7 / 0.9e-3, rel=1e-3)
    assert half["shift_ppm"] == pytest.approx(whole["shift_ppm"] / 2)
    assert (unknown["shift_ppm"], unknown["missing"]) == (None, ["density_kg_m3"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("density_kg_m3 = 2329.0\n", "", "density_kg_m3 of the crystal is missing"),
        ("2329.0\n", "2329.0\nyoungs_modulus_GPa = 130.0\n", "no youngs_modulus_GPa"),
        ("C44_GPa = 79.6", "C44_GPa = 79.6, C55_GPa = 1.0", "C55_GPa"),
        ("63.9", "263.9", "stable only with"),
    ],
)
def test_crystals_that_cannot_be(tmp_path, old, new, said):
    (tmp_path / "card.toml").write_text(CARD.replace(old, new))
    with pytest.raises(InputError, match=said):
        load_card(tmp_path / "card.toml")
