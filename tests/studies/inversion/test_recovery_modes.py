"""Recovery: values, assignment and the mode to measure next from frequencies of modes; what cannot be decided is said."""

import numpy as np
import pandas as pd
import pytest

import studies
from studies.errors import InputError
from studies.instrument.card import build_instrument, load_card
from studies.inversion.assignment import assign
from studies.inversion.invert import decided, invert
from studies.inversion.model import ModeModel, Which
from studies.inversion.readings import ModeReadings, is_mode_table, read_modes
from tests.golden.answers import HERE

CARD = (HERE / "inputs" / "modal.toml", HERE / "inputs" / "modal.csv")
TRUE = {"material.youngs_modulus_GPa": 73.0, "resonator.thickness_mm": 1.494}  # what the table was solved with


def test_recovery_of_a_planted_assignment():
    """Twelve candidates whose prior spread is five times their spacing: the readings together decide."""
    rng = np.random.default_rng(1)
    g, J = np.sort(rng.uniform(0, 1, 12)), rng.standard_normal((12, 3)) * 0.2
    u, places = rng.standard_normal(3), rng.permutation(12)[:8]
    y = (g + J @ u)[places] + 1e-4 * rng.standard_normal(8)
    best, *_ = assign(y, np.full(8, 1e-4), [range(12)] * 8, g, J)
    assert best.places == tuple(places)


def test_limits_twins_share_the_likelihood_and_impossible_readings_have_no_assignment():
    g, J = np.array([0.0, 1.0, 1.0]), np.ones((3, 1)) * 1e-2
    one, other = assign(np.array([0.0, 1.0]), np.full(2, 1e-3), [[0], [1, 2]], g, J)
    assert {one.places, other.places} == {(0, 1), (0, 2)}
    assert one.cost == pytest.approx(other.cost, abs=1e-9)
    assert assign(np.array([0.5]), np.full(1, 1e-3), [[0, 1, 2]], g, J) == []


@pytest.fixture(scope="module")
def from_file():
    return studies.calibrate(*CARD)


@pytest.mark.slow
def test_recovery_of_modulus_and_wall_with_a_mode_of_unknown_harmonic(from_file):
    found, card = from_file, load_card(CARD[0])
    assert [(m.harmonic, m.index) for m in found.fit.modes] == [(2, 0), (3, 0), (0, 0)]
    assert decided(found)
    assert not found.warnings
    for one in found.estimates:
        assert one.low <= TRUE[one.parameter] <= one.high
        assert one.sd < 1e-3 * one.value
    assert all(one.sd_then < one.sd for one in found.next_modes)
    # the same reading between n = 0 and n = 1 of the card, without the modes that fix E: not decided
    f = np.array([7328.6, 55725.0])
    vague = ModeReadings(
        "m.csv", np.array([2.0, np.nan]), np.full(2, np.nan), f, 1e-6 * f, np.full(2, np.nan), (2, 3), False
    )
    found = invert(card, vague)
    assert not decided(found)
    assert found.rivals[1]
    f[1] = 40000.0
    with pytest.raises(InputError, match=r"no assignment explains.*line 3"):
        invert(card, vague)


def test_limits_derivatives_by_modulus_and_density_are_exact():
    content = load_card(CARD[0]).content
    material = {**content["material"], "density_kg_m3": {"value": 2203.0, "relative_sd": 0.01}}
    card = build_instrument({**content, "material": material})
    from studies.inversion.invert import _priors

    model = ModeModel(card, _priors(card, ("resonator.thickness_mm",)), 1e-5)
    J = model.derivatives([Which(2, 0, card.reference_temperature)], np.zeros(2))
    assert J[0] == pytest.approx([0.005, -0.005], rel=1e-5)  # half of 1 % each, logarithmic
    assert is_mode_table(str(CARD[1]))


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("2,4500\n2.5,9000", ["line 3", "harmonic", "whole number"]),
        ("2,-1", ["line 2", "frequency_Hz", "positive"]),
        ("2,", ["line 2", "frequency_Hz"]),
        ("25,9000", ["line 2", "0 to 20"]),
        ("2,4.6997\n3,12.159", ["line 2", "looks like kHz"]),
    ],
)
def test_contract_a_bad_row_is_named(tmp_path, rows, words):
    path = tmp_path / "modes.csv"
    path.write_text(f"harmonic,frequency_Hz\n{rows}\n")
    with pytest.raises(InputError) as caught:
        read_modes(str(path))
    for word in [str(path), *words]:
        assert word in str(caught.value)


RUN = "time_s,housing_temperature_degC,frequency_Hz\n0,20,4500\n1,20,4500\n"


@pytest.mark.parametrize(
    ("card", "words", "tables"),
    [
        (CARD[0], "the column 'harmonic' is missing", ["frequency_Hz,sd_Hz\n4500,0.5\n"]),
        ("free-dome", "harmonic and index are exchanged", ["index,harmonic,frequency_Hz\n2,0,4600\n3,0,11927\n4,0,21402\n"]),
        (CARD[0], "twice", ["harmonic,index,frequency_Hz\n2,0,4500\n2,0,4501\n"]),
        (CARD[0], "alone", ["harmonic,index,frequency_Hz\n2,0,4500\n", RUN]),
    ],
)  # fmt: skip
def test_contract_a_table_that_cannot_be_used_is_refused(tmp_path, refuse, card, words, tables):
    paths = [tmp_path / f"{k}.csv" for k in range(len(tables))]
    for path, text in zip(paths, tables, strict=True):
        path.write_text(text)
    assert words in refuse(["calibrate", card, *paths])


@pytest.mark.slow
def test_contract_from_python_as_from_the_command_line(from_file, monkeypatch):
    """A table of modes by path or of pandas is the same table; the result is short, and a table of values."""
    path, one = CARD[1], from_file
    assert repr(one).startswith("ModeCalibration(")
    assert len(repr(one)) < 120
    monkeypatch.setattr("studies.inversion.invert.invert", lambda card, readings, *_: readings)
    same = studies.calibrate(CARD[0], pd.read_csv(path, comment="#"))
    for name in ("harmonic", "index", "frequency", "sd", "temperature"):
        np.testing.assert_array_equal(getattr(same, name), getattr(one.readings, name))
    assert one.to_frame().loc["resonator.thickness_mm", "told_by"] == "data"
    with pytest.raises(InputError, match="alone"):
        studies.calibrate(CARD[0], path, path)
