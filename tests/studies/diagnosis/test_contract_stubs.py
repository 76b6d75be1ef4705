"""Engines that do not look fail the hide-and-find tests: "always adequate", "always the first effect", "one of all effects"."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from studies.diagnosis.verdict import Cause, ResponseResult, Verdict
from studies.effects import library
from tests.generator.hidden import EFFECTS
from tests.studies.diagnosis import test_planted_effects as runs
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


def blind(stub):
    """An engine of runs that sees no more of a campaign than which response is asked for besides the frequency."""

    def investigate(campaign, *_, **__):
        response = next((one for one in campaign.responses if one != "frequency_Hz"), "frequency_Hz")
        verdict = STUBS[stub](response)
        return SimpleNamespace(
            verdict=replace(
                verdict, responses=dict.fromkeys(campaign.responses, next(iter(verdict.responses.values())))
            )
        )

    return investigate


@pytest.mark.parametrize("stub", STUBS)
def test_hidden_effects_are_not_found_by_a_stub(stub, monkeypatch):
    monkeypatch.setattr(runs, "investigate", blind(stub))
    asked = [key for key in sorted(EFFECTS) if key.split("@")[0] != NAMES[0]][::4]
    assert len(asked) > 4
    for key in asked:
        with pytest.raises(AssertionError):
            runs.test_hidden_effect_is_named(key)
    for test in (runs.test_two_effects_are_both_found, runs.test_inseparable_pair_is_answered_as_a_set):
        with pytest.raises(AssertionError):
            test()


@pytest.mark.parametrize("stub", ["always the first effect", "one of all effects"])
def test_a_null_campaign_is_not_passed_by_a_stub_that_names(stub, monkeypatch):
    monkeypatch.setattr(runs, "investigate", blind(stub))
    with pytest.raises(AssertionError):
        runs.test_null_campaigns_are_adequate("white")


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
