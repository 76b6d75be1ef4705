"""Contract: every shipped card loads and says what is illustrative; a wrong card is refused by key with the mend."""

import re
import tomllib

import pytest

from shell.materials import read_materials
from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card, save_card, shipped_cards

LAG = {"name": "second-lag", "weight": 0.1, "second_time_constant_s": 2000.0}
HRG = shipped_cards()["hrg-30mm"].read_text(encoding="utf-8")


@pytest.mark.parametrize("name", sorted(shipped_cards()))
def test_shipped_card_is_complete(name):
    card = load_card(name)
    assert card.name == name
    assert "llustrative" in card.note
    elastic = card.material.elastic(card.reference_temperature)
    assert 1e10 < elastic.E < 3e11
    assert card.resonator.length > 0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("hrg.card/1", "hrg.card/9", ["schema", "hrg.card/1"]),
        ("radius_mm = 15.0", "radius_mm = ]", ["TOML"]),
        ('support = "stem"', 'support = "stme"', ["support", "'stem'"]),
        ('support = "stem"', 'support = "free"', ["[resonator.stem]"]),
        ("radius_mm = 2.5", "radius_mm = 25.0", ["stem", "larger"]),
        ("end_mm = -5.0", "end_mm = [-5.0, 20.0]", ["end_mm"]),
        ('side = "inner"', 'side = "both"', ["end_mm", "[inner, outer]"]),
        ('name = "fused-silica"', 'name = "fused-silca"', ["'fused-silica'"]),
        ('name = "fused-silica"', 'name = "fused-silica"\nlaw = "spiner"', ["'spinner'"]),
        ('name = "fused-silica"', 'name = "mystery"\nyoungs_modulus_GPa = 70', ["mystery", "poisson_ratio, density"]),
        ('name = "fused-silica"', 'name = "fused-silica"\nfile = "none.toml"', ["none.toml", "cannot be read"]),
        (
            'name = "fused-silica"',
            'name = "fused-silica"\nyoungs_modulus_GPa = 72.7e9',
            ["looks like pascal: write 72.7"],
        ),
        ('name = "fused-silica"', 'name = "fused-silica"\nyoungs_modulus_GPa = 5000.0', ["no solid is stiffer"]),
        ('name = "fused-silica"', 'name = "fused-silica"\ndensity_kg_m3 = 2.203', ["looks like g/cm³: write 2203"]),
        ('name = "fused-silica"', 'name = "fused-silica"\ndensity_kg_m3 = 2e6', ["30 to 30000"]),
        ("[material]", "[[effect]]\nsize = 1\n[material]", ["[[effect]] number 1", "name"]),
    ],
)
def test_wrong_card_is_refused_by_key(tmp_path, old, new, words):
    assert old in HRG
    path = tmp_path / "card.toml"
    path.write_text(HRG.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_card(path)
    for word in [str(tmp_path), *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "thickness", ["0", "-0.9", "40.0", "[[0, 1]]", "[[0, 1], [0.5, 1]]", "[[0.5, 1], [0.2, 1]]", "[1, 2]"]
)
def test_impossible_thickness_is_refused(tmp_path, thickness):
    path = tmp_path / "card.toml"
    lines = [f"thickness_mm = {thickness}" if line.startswith("thickness_mm") else line for line in HRG.splitlines()]
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match="thickness"):
        load_card(path)


def test_thickness_may_vary_along_the_meridian(tmp_path):
    path = tmp_path / "card.toml"
    profile = "thickness_mm = [[0, 0.95], [0.5, 0.9], [1, 0.85]]"
    lines = [profile if line.startswith("thickness_mm") else line for line in HRG.splitlines()]
    path.write_text("\n".join(lines), encoding="utf-8")
    resonator = load_card(path).resonator
    thickness = resonator.at([share * resonator.length for share in (0.0, 0.25, 1.0)]).thickness
    assert thickness == pytest.approx([0.95e-3, 0.925e-3, 0.85e-3])


def test_given_values_rescale_the_law_at_the_reference_temperature(tmp_path):
    path = tmp_path / "card.toml"
    given = 'name = "fused-silica"\nyoungs_modulus_GPa = 73.0\npoisson_ratio = 0.18\ndensity_kg_m3 = 2201'
    path.write_text(HRG.replace('name = "fused-silica"', given), encoding="utf-8")
    plain, own = load_card("hrg-30mm").material, load_card(path).material
    at = own.elastic(293.15)
    assert (at.E, at.nu, at.rho) == pytest.approx((73e9, 0.18, 2201), rel=1e-12)
    for name in ("shear_modulus", "poisson_ratio"):
        law = plain.value(name, 323.15) / plain.value(name, 293.15)
        assert own.value(name, 323.15) / own.value(name, 293.15) == pytest.approx(law, rel=1e-12)


def test_saved_card_loads_equal_even_from_another_folder(tmp_path):
    own = tmp_path / "a" / "mine.toml"
    own.parent.mkdir()
    own.write_text(
        'schema = "hrg.materials/1"\n[glass.laws.data]\nsource = "mine"\nrange_degC = [0, 50]\n'
        'youngs_modulus = {form = "constant", value = 70e9}\npoisson_ratio = {form = "constant", value = 0.2}\n'
        'density = {form = "constant", value = 2300, at_degC = 20}\nexpansion = {form = "constant", value = 1e-6}\n'
    )
    card = tmp_path / "a" / "card.toml"
    card.write_text(HRG.replace('name = "fused-silica"', 'name = "glass"\nfile = "mine.toml"'), encoding="utf-8")
    first = load_card(card)
    moved = tmp_path / "b" / "card.toml"
    moved.parent.mkdir()
    save_card(first.with_table("effect", [LAG]), moved)
    again = load_card(moved)
    assert again.material == first.material
    assert again.resonator == first.resonator
    (effect,) = again.effects
    assert (effect.name, effect.parameters) == ("second-lag", {"weight": 0.1, "second_time_constant_s": 2000.0})
    assert tomllib.loads(moved.read_text())["schema"] == "hrg.card/1"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[glass.laws.a]\nrange_degC = [0, 50]\n', "[glass.laws.a]: the key 'source' is missing; add it. ({}:2)"),
        ('[glass.steel]\n', "[glass]: unknown key 'steel'; known: default, description, laws. ({}:2)"),
        (
            '[glass.laws.a]\nsource = "s"\nrange_degC = [0, 50]\ndensity = {form = "constant", valu = 2300}\n',
            "[glass.laws.a.density]: unknown key 'valu'; did you mean 'value'? ({}:5)",
        ),
    ],
)  # fmt: skip
def test_contract_faults_of_a_material_file_are_named_with_its_line(tmp_path, capsys, text, said):
    own, card = tmp_path / "mine.toml", tmp_path / "card.toml"
    own.write_text('schema = "hrg.materials/1"\n' + text)
    card.write_text(HRG.replace('name = "fused-silica"', 'name = "glass"\nfile = "mine.toml"'), encoding="utf-8")
    assert main(["cards", str(card)]) == 2
    assert capsys.readouterr().err == f"hrg: {own} {said.format(own)}\n"


@pytest.mark.parametrize(("key", "mend"), [("support", "known: bottom_thickness_mm"), ("cylinder_height_mm", "did you mean 'height_mm'")])  # fmt: skip
def test_a_key_of_another_shape_is_not_sent_to_the_table_in_which_it_stands(tmp_path, key, mend):
    card = tmp_path / "card.toml"
    shape = f'shape = "cylinder"\nradius_mm = 12.5\nthickness_mm = 0.3\nheight_mm = 3.0\n{key} = "free"\n'
    card.write_text(f'schema = "hrg.card/1"\nname = "x"\n[resonator]\n{shape}[material]\nname = "fused-silica"\n')
    with pytest.raises(InputError, match=rf"unknown key '{key}'; shape = 'cylinder' has none; {mend}"):
        load_card(card)


@pytest.mark.parametrize("stem", ["", 'support = "stem"\n[resonator.stem]\nradius_mm = 2.5\nend_mm = 2.0\n'])
def test_lengths_a_thousand_times_too_large_are_named(tmp_path, stem):
    card = tmp_path / "card.toml"
    card.write_text(
        'schema = "hrg.card/1"\nname = "x"\n[resonator]\nshape = "hemisphere"\nradius_mm = 15000.0\nthickness_mm = 900.0\n'
        f"{stem}"
        '[material]\nname = "fused-silica"\n'
    )
    with pytest.raises(InputError, match="radius_mm = 15000 looks 1000 × too large: is it in µm"):
        load_card(card)


def _printed(value, text):
    """Whether a text prints a number, as such or in GPa."""
    numbers = [float(found) for found in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)]
    return any(abs(value * scale - one) <= 1e-3 * abs(one) for one in numbers for scale in (1.0, 1e-9)) or value == 0


@pytest.mark.parametrize("name", read_materials())
def test_contract_every_value_of_a_material_has_a_source_or_says_that_it_was_not_checked(name, ask):
    """Without a source of its own a value stands in the source of its law; what is not checked is told in every answer."""
    shown = ask(["materials", name])["materials"]
    laws = read_materials()[name]
    for row, law in zip(shown, laws.values(), strict=True):
        source = next(iter(laws.values())).source if law.source.startswith("as law") else law.source
        for key, found in law.properties.items():
            if key not in law.unchecked and not found.source:
                value = found.numbers["value"]
                assert _printed(value, source) or (round(6 * value, 3) == 1 and "1/6" in source), (key, source)
        if law.crystal is not None:
            assert all(_printed(value, source) for value in law.crystal.constants.values()), source
            assert not law.crystal.slope or "temperature_coefficients" in law.unchecked
        assert row["unchecked"] == list(law.unchecked)
        assert bool(law.unchecked) == any("not checked against a source" in text for text in row["caveats"])


def test_the_values_of_a_card_without_geometry_stand_to_the_digits_of_their_errors(tmp_path, ask, capsys):
    card = tmp_path / "law.toml"
    card.write_text(
        'schema = "hrg.card/1"\nname = "law"\n[law]\nf0_Hz = {value = 7312.39998, sd = 4.3e-4}\n', encoding="utf-8"
    )
    assert ask(["cards", card])["mass_properties"] is None
    assert main(["cards", str(card)]) == 0
    said = capsys.readouterr().out
    assert "7312.39998" in said
    assert "Mass" not in said
