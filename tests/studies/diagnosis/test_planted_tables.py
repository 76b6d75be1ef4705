"""Tables of settled readings with a known truth: loops, wandering rows, repeated temperatures, other laws than silica's."""

import re

import numpy as np
import pytest

from shell.constants import zero_Celsius
from studies.calibration.calibrate import calibrate
from studies.calibration.observed import SettledTable
from studies.calibration.scatter import find_scatter
from studies.cli import main
from studies.diagnosis.table import diagnose_table, judge_table
from studies.diagnosis.verdict import spell_structure
from studies.errors import InputError
from studies.inference.lack_of_fit import doubt_of
from studies.instrument.card import load_card
from studies.reports.diagnosis import headline
from studies.resonator.law import law_of

WIDEST = 3
"""Names in one set, of the six effects that have a steady form."""
UP = np.arange(-40.0, 81.0, 10.0)
CYCLE = np.concatenate([UP, UP[-2::-1]])


def quartz(T):
    return 4425 + 0.37 * (T - 273.15) - 2.4e-4 * (T - 273.15) ** 2


def study(T, extra, seed=1, white=2e-3):
    f = quartz(T + 273.15) + extra + np.random.default_rng(seed).normal(0, white, T.size)
    return judge_table(SettledTable("table.csv", T + zero_Celsius, np.round(f, 3), 1e-3))


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


@pytest.mark.parametrize(("row", "wrong"), [(0, 1.0), (7, -0.3), (20, 0.3)])
def test_one_mistyped_digit_far_beyond_the_noise_of_the_others_names_its_row(row, wrong):
    """A hundred standard deviations in the first row were a hysteresis of probability 0.86, in the middle one nothing."""
    T = np.linspace(-40.0, 60.0, 21)
    found = study(T, wrong * (np.arange(21) == row), white=1e-2)
    assert (found.verdict.verdict, found.verdict.causes) == ("unexplained", ())
    assert f"Row {row + 1} (" in found.sentences[0]
    assert "alone makes it" in found.sentences[0]


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "above"), [(11, 20.0), (40, 11.0)])
def test_rows_of_two_gyros_one_after_the_other_are_no_noise_and_no_dip(rows, above):
    """A step of 1.3 Hz among readings of 10 mHz was a noise of 0.33 Hz, or an activity dip that left a good part of it."""
    T = np.linspace(-40.0, 60.0, rows)
    found = study(T, 1.3 * (T >= above), white=1e-2)
    assert (found.verdict.verdict, found.verdict.causes) == ("unexplained", ())
    assert any("is not noise: readings at neighbouring temperatures agree" in sentence for sentence in found.sentences)
    f = quartz(T + 273.15) + 1.3 * (T >= above) + np.random.default_rng(1).normal(0, 1e-2, rows) + 7.0
    warned = calibrate(
        load_card("hrg-30mm"), [], [SettledTable("table.csv", T + zero_Celsius, np.round(f, 3), 1e-3)]
    ).warnings
    assert any(warning.startswith("poor fit in the settled frequency") for warning in warned), warned


@pytest.mark.slow
def test_few_rows_of_pure_noise_name_no_row_and_no_step():
    tables = [study(np.linspace(-40.0, 60.0, 9 + k % 9), 0.0, seed=k, white=1e-2) for k in range(18)]
    assert sum(found.verdict.verdict != "adequate" for found in tables) <= 1
    assert not any("alone makes it" in sentence for found in tables for sentence in found.sentences)


def test_the_same_readings_without_a_loop_are_adequate():
    found = study(CYCLE, 0.0)
    assert (found.verdict.verdict, found.verdict.causes) == ("adequate", ()), found.verdict.causes
    text = " ".join(found.sentences)
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


@pytest.mark.slow
def test_the_papers_slope_is_shown_to_the_digits_of_the_cards_uncertainty():
    """Wang et al. 2012, Table 1: 79.2 ppm/°C at 20 °C; the card knows it to ± 6.3."""
    from studies.papers import hrg
    from studies.reports.diagnosis_table import law_facts

    (slope,) = [one for one in law_facts(diagnose_table(str(hrg.TABLE1), "hrg-30mm")) if one[0].startswith("Slope")]
    assert slope[1] == "79.2 ppm/°C"
    assert "88.7 ± 6.3" in slope[2]


PAPER = (4416.97, 4421.05, 4424.90, 4428.56, 4432.07, 4435.56, 4439.20)
"""Wang et al. 2012, Table 1, Hz at -20 to 40 °C."""
SCRAMBLED = {
    "one row mistyped": ((*PAPER[:3], 4482.56, *PAPER[4:]), r"Row 4 \(10 °C, 4482.56 Hz\) alone makes it"),
    "shuffled": ([PAPER[k] for k in (3, 0, 5, 1, 6, 2, 4)], "No single row makes it. Are the rows mixed up, or of two"),
    "two gyros": ([f * (1.004 if k % 2 == 0 else 1.0) for k, f in enumerate(PAPER)], "No single row .* of two gyros"),
    "2 Hz of noise": (
        (4417.16, 4423.55, 4423.04, 4430.54, 4431.55, 4435.04, 4443.00),
        r"2.21 Hz .* 9.(\d+ % of the 23.8|48 % of the 23.4) Hz",  # of the card's law, of their own parabola
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "card"), [*((name, CARD) for name in SCRAMBLED), ("shuffled", None), ("2 Hz of noise", None)]
)
def test_rows_that_follow_no_law_are_unexplained(name, card, tmp_path):
    """Beside the card each was `adequate`, 20 Hz off: the noise took it all, and the slope was judged by that noise."""
    f, said = SCRAMBLED[name]
    found = beside_card(tmp_path, np.arange(-20.0, 41.0, 10.0), f, card)
    assert (found.verdict.verdict, found.verdict.causes) == ("unexplained", ()), found.verdict
    assert re.search(said, found.sentences[0]), found.sentences[0]
    if card and "mistyped" in found.sentences[0]:  # level and slope are of the other rows
        slope = found.verdict.details["settled"]["slope_ppm_per_degC"]
        assert slope["measured"] == pytest.approx(79.2, abs=0.3)
        assert slope["away_sd"] == pytest.approx(-1.5, abs=0.1)


def test_a_slope_is_judged_by_the_card_and_clean_rows(tmp_path):
    """A slope of two gyros, 28 ppm/°C off where the card knows it to 6.3, was 0.3 standard deviations away."""
    found = beside_card(tmp_path, np.arange(-20.0, 41.0, 10.0), SCRAMBLED["two gyros"][0])
    slope = found.verdict.details["settled"]["slope_ppm_per_degC"]
    assert abs(slope["away_sd"]) == pytest.approx(abs(slope["measured"] - slope["predicted"]) / slope["sd"], rel=0.1)


@pytest.mark.parametrize("part", [0.002, 0.005])
def test_rows_that_scatter_like_measured_ones_are_not_questioned(part):
    """The paper's table leaves 0.4 % of its changes, and a thermometer of 0.3 K as much."""
    T = np.arange(-20.0, 41.0, 10.0) + zero_Celsius
    law = law_of(load_card(CARD)).frequency(T)
    for seed in range(20):
        f = law + np.random.default_rng(seed).normal(0, part * np.ptp(law), T.size)
        assert find_scatter(SettledTable("t.csv", T, f, 0.01), law) is None


@pytest.mark.slow
def test_a_slope_within_six_standard_deviations_is_a_value_before_it_is_fahrenheit(tmp_path):
    """0.7 times the slope, 5.3 standard deviations, was refused as °F; it is a value, in words, and the unit a question."""
    f = 4432.07 + 0.7 * (np.array(PAPER) - 4432.07)
    found = beside_card(tmp_path, np.arange(-20.0, 41.0, 10.0), f)
    text = " ".join(found.sentences)
    assert text.index("5.3 standard deviations") < text.index("If the temperatures were in °F, the slope would be 1.0")
    assert "temperature slope of the shear modulus by 3.3 standard deviations" in headline(found.verdict)
    with pytest.raises(InputError, match=r"6 standard deviations[.] If the temperatures are read in °F"):
        beside_card(tmp_path, 1.8 * np.arange(-20.0, 41.0, 10.0) + 32.0, PAPER)


@pytest.mark.slow
def test_a_card_of_rows_that_follow_no_law_is_not_saved(tmp_path, capsys):
    """It was saved, with exit status 0."""
    path, card = tmp_path / "typo.csv", tmp_path / "card.toml"
    f = SCRAMBLED["one row mistyped"][0]
    path.write_text("temperature_degC,frequency_Hz\n" + "".join(f"{10 * k - 20},{v}\n" for k, v in enumerate(f)))
    assert main(["calibrate", CARD, str(path), "--save", str(card)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"warning: The rows of {path} scatter by 22.1 Hz (rms)")
    assert f"card.toml not saved: row 4 of {path} does not follow the others" in said
    assert not card.exists()


def test_what_is_left_over_is_said_in_words():
    assert "the residual may hold a narrow feature in temperature: its evidence of 9.91 is more than noise leaves" in (
        doubt_of("temperature: a narrow feature", 4.955)
    )
    assert spell_structure("time: brief events") == "brief events"
    assert spell_structure("history of the temperature") == "structure in history of the temperature"
