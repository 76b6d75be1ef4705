"""Engines that do not look fail the tests of tables and of campaigns: "always adequate", "always the first effect", "one of all effects"."""

from dataclasses import replace

import pytest

from studies.effects import library
from tests.benchmarks.mutations import BLIND, blind_engine
from tests.studies.diagnosis import test_planted_fast_line as line
from tests.studies.diagnosis import test_planted_memory as memory
from tests.studies.diagnosis import test_planted_runs_apart as apart
from tests.studies.diagnosis import test_planted_tables as tables

FIRST = min(library())
HIDDEN = {
    "periodic": line.test_a_shorter_stretch_resolves_it,
    "second-lag": memory.test_a_slow_mass_that_the_runs_before_have_warmed_is_one_cause,
    "hysteresis": lambda: tables.test_heating_against_cooling_shows_a_loop(1),
    "activity-dip": tables.test_a_dip_in_wandering_rows_is_still_found,
}
NOTHING = (
    apart.test_the_same_runs_without_offsets_are_adequate,
    tables.test_the_same_readings_without_a_loop_are_adequate_and_the_law_is_named,
)


@pytest.mark.parametrize("name", BLIND)
def test_an_engine_that_does_not_look_is_caught(name, monkeypatch):
    engine = blind_engine(name)
    verdict = engine([{"frequency_Hz"}]).verdict
    for module in (line, memory, apart):
        monkeypatch.setattr(module, "diagnose_records", engine)
    for asked in ("study_steady_table", "diagnose_table"):
        true = getattr(tables, asked)
        monkeypatch.setattr(tables, asked, lambda *given, true=true: replace(true(*given), verdict=verdict))
    blind_to = [test for effect, test in HIDDEN.items() if name != "first" or effect != FIRST]
    for test in [*blind_to, *(NOTHING if name != "adequate" else ())]:
        with pytest.raises((AssertionError, ValueError)):  # also where one cause is unpacked and there is none
            test()
