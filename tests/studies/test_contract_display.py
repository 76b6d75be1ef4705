"""Names that people read for keys: every uncertain value of the shipped cards has one, and no two share it."""

import pytest

from studies.instrument.card import load_card, shipped_cards
from studies.instrument.display import display_name, name_constant


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
