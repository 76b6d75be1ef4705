"""Tables of settled readings with a known truth: loops, wandering rows, repeated temperatures, other laws than silica's."""

import numpy as np
import pytest

from studies.diagnosis.table import study_steady_table

UP = np.arange(-40.0, 81.0, 10.0)
CYCLE = np.concatenate([UP, UP[-2::-1]])


def quartz(T):
    return 4425 + 0.37 * (T - 273.15) - 2.4e-4 * (T - 273.15) ** 2


def study(T, extra, seed=1, white=2e-3):
    f = quartz(T + 273.15) + extra + np.random.default_rng(seed).normal(0, white, T.size)
    return study_steady_table(T, np.round(f, 3), 1e-3, quartz, "quartz, law 'at'")


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
    (cause,) = found.verdict.causes
    assert "hysteresis" in {cause.effect, *cause.equivalent}
    assert any("both sides: hysteresis is tested" in sentence for sentence in found.sentences)


def test_one_loop_could_be_a_drift_and_is_not_adequate():
    found = study(CYCLE, 0.004 * play(CYCLE, 12.0))
    assert found.verdict.verdict == "not-identifiable"


def test_the_same_readings_without_a_loop_are_adequate_and_the_law_is_named():
    found = study(CYCLE, 0.0)
    assert found.verdict.verdict == "adequate"
    text = " ".join(found.sentences)
    assert "quartz, law 'at'" in text
    assert "silica" not in text
    assert "a cubic is sufficient" in text
    assert "not sufficient" not in text


def test_neighbouring_rows_that_wander_together_name_nothing_and_are_not_adequate():
    """A random walk over 200 rows of a sweep; taken for independent it was an activity dip or a curvature in six of ten."""
    T = np.linspace(-40.0, 80.0, 200)
    for seed in range(6):
        walk = np.cumsum(np.random.default_rng(100 + seed).normal(0, 3e-3, T.size))
        found = study(T, walk, seed, white=1e-4)
        assert found.verdict.verdict == "not-identifiable"
        assert not found.verdict.causes
        assert any("The rows drift" in sentence for sentence in found.sentences)


def test_a_dip_in_wandering_rows_is_still_found():
    T = np.linspace(-40.0, 80.0, 200)
    walk = np.cumsum(np.random.default_rng(9).normal(0, 3e-4, T.size))
    x = (T - 25.0) / 3.0
    found = study(T, walk + 0.05 * x / (1 + x**2), white=1e-3)
    assert "activity-dip" in {name for cause in found.verdict.causes for name in (cause.effect, *cause.equivalent)}
