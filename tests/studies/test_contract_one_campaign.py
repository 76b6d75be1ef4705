"""Runs that do not belong to a campaign whose heat path is far from one lag: of another gyro, logged by two clocks, stuck to the end, counted by halves."""

import dataclasses

import numpy as np
import pytest

from studies.errors import InputError
from studies.instrument.card import load_card
from studies.record.one_gyro import records_of_one_gyro
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run

pytestmark = pytest.mark.slow
CAMPAIGN = (
    "ramp 25 -15 1 then soak -15 2h",
    "ramp -15 40 1 then soak 40 2h",
    "cycle 20 -5 45 0.5 30min 1",
    "step 30 5 3h",
)
HOUSING, CHAMBER, FREQUENCY = "housing_temperature_degC", "chamber_temperature_degC", "frequency_Hz"


@pytest.fixture(scope="module")
def runs():
    card = load_card("hrg-30mm")
    made = [simulate_run(card, load_profile(one), 1 / 60, seed).record for seed, one in enumerate(CAMPAIGN)]
    return [dataclasses.replace(run, path=f"run{k}.csv") for k, run in enumerate(made)]


def put(runs, k, change):
    return [change(run) if j == k else run for j, run in enumerate(runs)]


def said_of(runs):
    said = []
    return records_of_one_gyro(runs, said.append), said


def test_runs_of_one_gyro_raise_no_doubt(runs):
    kept, said = said_of(runs)
    assert said == []
    assert all(one is own for one, own in zip(kept, runs, strict=True))


@pytest.mark.parametrize(("k", "apart"), [(0, -2.8), (2, -17.0), (3, 5.0)])
def test_a_run_of_another_gyro_is_named_behind_any_heat_path(runs, k, apart):
    """One lag left more than these differ by: a diagnosis named a second lag, radiation and a mounting stress of 10 days."""
    _, said = said_of(put(runs, k, lambda run: run.with_columns({FREQUENCY: run[FREQUENCY] + apart})))
    (sentence,) = said
    assert sentence.startswith(f"run{k}.csv: frequency_Hz is ")
    assert float(sentence.split(" is ")[1].split(" Hz")[0]) == pytest.approx(apart, rel=0.15)


@pytest.mark.parametrize("apart", [0.1, 0.5])
def test_a_jump_or_an_ageing_is_no_other_gyro(runs, apart):
    _, said = said_of(put(runs, 1, lambda run: run.with_columns({FREQUENCY: run[FREQUENCY] + apart})))
    assert said == []


def late(run, hours):
    """The same run, its temperatures logged by a clock that is so many hours behind."""
    time = run["time_s"]
    rows = (time - 3600.0 * hours >= time[0]) & (time - 3600.0 * hours <= time[-1])
    moved = {name: np.interp(time[rows] - 3600.0 * hours, time, run[name]) for name in (HOUSING, CHAMBER)}
    columns = {name: column[rows] for name, column in run.columns.items()} | moved
    return dataclasses.replace(run, columns=columns | {"time_s": columns["time_s"] - columns["time_s"][0]})


@pytest.mark.parametrize(("k", "hours", "said"), [(1, 1, "1 h behind"), (2, -1, "1 h ahead of")])
def test_temperatures_of_a_clock_an_hour_off_are_named(runs, k, hours, said):
    """Such a run was a second lag and radiation, with a noise of 0.8 Hz."""
    with pytest.raises(InputError, match=rf"run{k}\.csv: {HOUSING} is {said} {FREQUENCY}: moved so, one law holds"):
        said_of(put(runs, k, lambda run: late(run, hours)))


@pytest.mark.parametrize("name", [FREQUENCY, "bias_deg_per_h", HOUSING])
def test_a_column_that_is_stuck_to_the_end_is_left_out(runs, name):
    """Only readings on both sides told; a housing so stuck was called exchanged with its chamber."""

    def stick(run):
        own = run[name].copy()
        own[-100:] = own[-100]
        return run.with_columns({name: own})

    kept, said = said_of(put(runs, 2, stick))
    assert [sentence.split(", the first")[0] for sentence in said] == [
        f"run2.csv: {name} repeats one reading in 100 rows"
    ]
    last = list(range(len(kept[2]) - 100, len(kept[2])))
    without = {
        name,
        *((FREQUENCY, "bias_deg_per_h", "inverse_q") if name == HOUSING else ()),
    }  # nothing drives them there
    for column, own in kept[2].columns.items():
        assert np.flatnonzero(np.isnan(own)).tolist() == (last if column in without else [])


@pytest.mark.parametrize(
    ("factor", "said"), [(0.5, r"\(by 2: "), (1e-3, r"\(by 1000: one is in kHz\)"), (1.1, r"so much\. The")]
)
def test_the_odd_frequency_of_several_comes_first_and_its_factor_is_told(runs, factor, said):
    with pytest.raises(InputError, match=rf"^run2\.csv: frequency_Hz is about .*{said}"):
        said_of(put(runs, 2, lambda run: run.with_columns({FREQUENCY: factor * run[FREQUENCY]})))
