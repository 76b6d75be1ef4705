"""Tables of settled readings with a known truth: loops, wandering rows, repeated temperatures, other laws than silica's."""

import numpy as np
import pytest

from studies.diagnosis.table import diagnose_table, study_steady_table
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.resonator.law import law_of

WIDEST = 3
"""Names in one set, of the six effects that have a steady form."""
UP = np.arange(-40.0, 81.0, 10.0)
CYCLE = np.concatenate([UP, UP[-2::-1]])


def quartz(T):
    return 4425 + 0.37 * (T - 273.15) - 2.4e-4 * (T - 273.15) ** 2


def study(T, extra, seed=1, white=2e-3):
    f = quartz(T + 273.15) + extra + np.random.default_rng(seed).normal(0, white, T.size)
    return study_steady_table(T, np.round(f, 3), 1e-3, quartz, "quartz, law 'at'")


def check_first(verdict, hidden):
    """The strongest physical cause is the hidden effect, or a small set that holds it."""
    cause = next((cause for cause in verdict.causes if cause.kind == "physics"), None)
    assert cause is not None, verdict
    assert hidden in (cause.effect, *cause.equivalent), verdict.causes
    assert len(cause.equivalent) < WIDEST, verdict.causes


def play(T, half_width):
    """The play operator: follows the temperature at a distance."""
    found, state = [], T[0] - half_width
    for value in T:
        state = min(max(state, value - half_width), value + half_width)
        found.append(state)
    return np.array(found)


@pytest.mark.parametrize("repeats", [1, 2], ids=["", "each reading twice"])
def test_heating_against_cooling_shows_a_loop(repeats):
    """The order of the rows counts, and a temperature may come again: a table once lost the one and divided by zero in the other."""
    T = np.repeat(np.concatenate([CYCLE, CYCLE[1:]]), repeats)
    found = study(T, 0.004 * play(T, 12.0))
    assert len(found.verdict.causes) == 1
    check_first(found.verdict, "hysteresis")
    assert any("rising and falling in temperature" in sentence for sentence in found.sentences)


def test_one_loop_could_be_a_drift_and_is_not_adequate():
    found = study(CYCLE, 0.004 * play(CYCLE, 12.0))
    assert found.verdict.verdict == "unexplained"


def test_the_same_readings_without_a_loop_are_adequate_and_the_law_is_named():
    found = study(CYCLE, 0.0)
    assert (found.verdict.verdict, found.verdict.causes) == ("adequate", ()), found.verdict.causes
    text = " ".join(found.sentences)
    assert "quartz, law 'at'" in text
    assert "silica" not in text
    assert "a cubic is sufficient" in text
    assert "not sufficient" not in text


@pytest.mark.slow
def test_neighbouring_rows_that_wander_together_name_nothing_and_are_not_adequate():
    """A random walk over 200 rows of a sweep; taken for independent it was an activity dip or a curvature in six of ten."""
    T = np.linspace(-40.0, 80.0, 200)
    for seed in range(6):
        walk = np.cumsum(np.random.default_rng(100 + seed).normal(0, 3e-3, T.size))
        found = study(T, walk, seed, white=1e-4)
        assert found.verdict.verdict == "unexplained"
        assert not found.verdict.causes
        assert any("The rows drift" in sentence for sentence in found.sentences)


def test_a_dip_in_wandering_rows_is_still_found():
    T = np.linspace(-40.0, 80.0, 200)
    walk = np.cumsum(np.random.default_rng(9).normal(0, 3e-4, T.size))
    x = (T - 25.0) / 3.0
    found = study(T, walk + 0.05 * x / (1 + x**2), white=1e-3)
    check_first(found.verdict, "activity-dip")


CARD = "hrg-30mm"
WIDE = np.linspace(-30.0, 70.0, 26)


@pytest.fixture(scope="module")
def own():
    """What the card itself predicts, °C to Hz."""
    law = law_of(load_card(CARD))
    return lambda T: law.frequency(T + 273.15)


def beside_card(folder, T, f, card=CARD):
    path = folder / "table.csv"
    path.write_text(
        "temperature_degC,frequency_Hz\n" + "".join(f"{t:.3f},{v:.3f}\n" for t, v in zip(T, f, strict=True))
    )
    return diagnose_table(str(path), card)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda f: 2.0 * f[13] - f, "26 standard deviations. If the temperatures are read with the opposite sign"),
        (lambda f: 1.5 * f, "this is not a record of that gyro"),
        (lambda f: 8110.0 * (1.0 - 27e-6 * (WIDE - 20.0)), "this is not a record of that gyro"),
        (lambda f: f[13] * (1.0 - 27e-6 * (WIDE - WIDE[13])), "This table is of another gyro"),
    ],
    ids=["slope negated", "frequencies x 1.5", "another gyro's", "another gyro's slope"],
)
def test_what_is_not_this_cards_table_is_said_to_be_another_gyros(spoil, said, own, tmp_path):
    """A free level and a free scale of any sign once made each of them `adequate`."""
    with pytest.raises(InputError, match=said.replace("26", r"\d\d")):
        beside_card(tmp_path, WIDE, spoil(own(WIDE)))


@pytest.mark.slow
def test_the_cards_own_table_is_adequate_and_moves_nothing(own, tmp_path):
    found = beside_card(tmp_path, WIDE, own(WIDE) + np.random.default_rng(3).normal(0, 2e-3, WIDE.size))
    assert found.verdict.verdict == "adequate", found.verdict.causes
    assert max(abs(one.shift_sd) for one in found.verdict.calibration) < 0.5
    assert abs(found.verdict.details["settled"]["slope_ppm_per_degC"]["away_sd"]) < 0.2


@pytest.mark.slow
def test_a_slope_four_standard_deviations_off_is_named_as_a_value(tmp_path):
    card, name = load_card(CARD), "material.deviation.shear_modulus.log_slope_per_K"
    sd = next(value.sd for value in card.uncertain if value.name == name)
    law = law_of(card.with_values({name: 4.0 * sd}))
    f = law.frequency(WIDE + 273.15) + np.random.default_rng(4).normal(0, 2e-3, WIDE.size)
    found = beside_card(tmp_path, WIDE, f)
    assert found.verdict.verdict == "explained"
    assert [(cause.kind, cause.effect) for cause in found.verdict.causes] == [("value", name)]
    assert found.verdict.calibration[0].shift_sd == pytest.approx(4.0, abs=0.3)
    assert found.verdict.details["settled"]["slope_ppm_per_degC"]["away_sd"] == pytest.approx(4.0, abs=0.3)


@pytest.mark.slow
def test_a_dip_in_the_cards_own_table_is_named_and_its_values_stay(own, tmp_path):
    x = (WIDE - 25.0) / 6.0
    f = own(WIDE) + 0.2 * x / (1 + x**2) + np.random.default_rng(5).normal(0, 2e-3, WIDE.size)
    found = beside_card(tmp_path, WIDE, f)
    (cause,) = [one for one in found.verdict.causes if one.kind == "physics"]
    assert cause.effect == "activity-dip"
    assert len(cause.equivalent) <= 2
    assert max(abs(one.shift_sd) for one in found.verdict.calibration) < 2.0


@pytest.mark.slow
def test_a_level_off_by_less_than_three_per_cent_is_a_value_of_the_card(own, tmp_path):
    """2.7 % is eight standard deviations of the modulus: no noise of the readings."""
    found = beside_card(tmp_path, WIDE, own(WIDE) * 0.9733)
    assert [cause.kind for cause in found.verdict.causes] == ["value"]
    assert "would remove the difference in level" in " ".join(found.sentences)


def test_the_papers_slope_is_shown_to_the_digits_of_the_cards_uncertainty():
    """Wang et al. 2012, Table 1: 79.2 ppm/°C at 20 °C; the card knows it to ± 6.3."""
    from studies.papers import hrg
    from studies.reports.diagnosis_table import law_facts

    (slope,) = [
        one for one in law_facts(diagnose_table(str(hrg.table1_path()), "hrg-30mm")) if one[0].startswith("Slope")
    ]
    assert slope[1] == "79.2 ppm/°C"
    assert "88.7 ± 6.3" in slope[2]
