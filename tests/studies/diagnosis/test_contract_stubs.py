"""Engines that do not look fail the tests of tables: "always adequate", "always the first effect", "one of all effects"."""

from dataclasses import replace

import pytest

from studies.diagnosis.verdict import Cause, ResponseResult, Verdict
from studies.effects import library
from tests.studies.diagnosis import test_planted_tables as tables

NAMES = tuple(library())


def answer(state, names, response):
    """A verdict as confident as its form allows."""
    cause = (Cause(names[0], response, 0.99, tuple(names[1:]), {}, 1e3),) if names else ()
    result = ResponseResult(state, 1e-3, (1.0, 1.0), (1e-3, 1e-3) if names else None, "none")
    return Verdict(state, cause, {response: result}, None)


STUBS = {
    "always adequate": lambda response: answer("adequate", (), response),
    "always the first effect": lambda response: answer("explained", NAMES[:1], response),
    "one of all effects": lambda response: answer("not-identifiable", NAMES, response),
}


@pytest.mark.parametrize("stub", STUBS)
def test_hidden_effects_of_tables_are_not_found_by_a_stub(stub, monkeypatch, tmp_path):
    for name in ("study_steady_table", "diagnose_table"):
        true = getattr(tables, name)
        monkeypatch.setattr(
            tables, name, lambda *given, true=true: replace(true(*given), verdict=STUBS[stub]("frequency_Hz"))
        )
    hidden = {
        "hysteresis": lambda: tables.test_heating_against_cooling_shows_a_loop(1),
        "activity-dip": tables.test_a_dip_in_wandering_rows_is_still_found,
    }
    for effect, test in hidden.items():
        if stub != "always the first effect" or effect != NAMES[0]:
            with pytest.raises(AssertionError):
                test()
    if stub != "always adequate":
        with pytest.raises(AssertionError):
            tables.test_the_same_readings_without_a_loop_are_adequate_and_the_law_is_named()
