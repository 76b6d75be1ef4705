"""Engines that do not look fail the tests of tables and beside a card; the batch of campaigns catches them without one (`tests.stranger`)."""

from types import SimpleNamespace

import pytest

from studies.instrument.card import load_card
from tests.benchmarks.mutations import BLIND, blind_engine
from tests.studies.diagnosis import test_planted_tables as tables
from tests.studies.diagnosis import test_recovery_card as card


@pytest.mark.parametrize("name", BLIND)
def test_an_engine_that_does_not_look_is_caught(name, monkeypatch, tmp_path):
    engine = blind_engine(name)
    monkeypatch.setattr(card, "diagnose_records", engine)
    for asked in ("judge_table", "diagnose_table"):
        monkeypatch.setattr(tables, asked, lambda *_: engine([{"frequency_Hz"}]))
    monkeypatch.setattr(card, "simulated", lambda *_: [{"frequency_Hz"}])
    monkeypatch.setattr(card, "frequencies", lambda runs: runs)
    hidden = [
        lambda: tables.test_heating_against_cooling_shows_a_loop(1),
        lambda: tables.test_a_slope_four_standard_deviations_off_is_named_as_a_value(tmp_path),
        lambda: card.test_a_wrong_value_is_named_as_one(load_card(tables.CARD), lambda *_: None),
        lambda: card.test_a_strong_effect_leaves_the_values_alone(lambda *_: None),
    ]
    nothing = [
        tables.test_the_same_readings_without_a_loop_are_adequate,
        lambda: card.test_a_virtual_record_of_the_card_is_adequate(SimpleNamespace(with_table=lambda *_: None)),
    ]
    for test in [*hidden, *(nothing if name != "adequate" else ())]:
        with pytest.raises(AssertionError):
            test()
