"""A hole in a record, in which its housing turned back: what comes after it follows from what the housing may have done.

The record is the card's own prediction without noise, of which 20 minutes about the turn are left out; the curve that bridges them does not
turn round, and leaves more than 0.05 Hz afterwards. With the card's values held, only departures in the hole, within their stated spread, can explain it;
after one linear step 5 % of it are left at most.
"""

import numpy as np
import pytest

from studies.calibration.observed import observe
from studies.calibration.priors import Priors, gather_priors
from studies.calibration.problem import CardProblem, wide_law
from studies.instrument.card import load_card
from studies.record import Record
from studies.simulation.chamber import load_profile
from studies.simulation.drive import drive_by_record
from studies.simulation.holes import PARTS, bridge_holes, straight
from studies.simulation.virtual_gyro import simulate_run
from thermal.profile import Profile

BEGIN, END = 2800.0, 4000.0


@pytest.fixture(scope="module")
def card():
    return load_card("hrg-30mm")


@pytest.fixture(scope="module")
def record(card):
    profile = load_profile("soak 20 30min then ramp 20 45 1.0 then ramp 45 20 1.0 then soak 20 1h")
    whole = simulate_run(card, profile, 0.1, 1, noise=False).record
    keep = (whole["time_s"] < BEGIN) | (whole["time_s"] > END)
    names = ("time_s", "housing_temperature_degC", "frequency_Hz")
    return Record({name: whole[name][keep] for name in names}, path="hole.csv")


def left_by(columns, residual, noise):
    """What is left of a residual by columns of unit prior, in noise of so much."""
    rows = np.vstack([columns / noise, np.eye(columns.shape[1])])
    x = np.linalg.lstsq(rows, np.append(residual / noise, np.zeros(columns.shape[1])), rcond=None)[0]
    return float(np.sqrt(np.mean((residual - columns @ x) ** 2)))


def test_calibration_and_diagnosis_follow_what_comes_after_a_hole(card, record):
    runs = observe([record])
    problem = CardProblem(card, gather_priors(card), runs, wide_law(card, runs))
    known = CardProblem(card, Priors((), np.eye(0)), runs, problem.law)  # the values are the card's: they may not help
    state = known.evaluate(np.zeros(known.count))
    residual, columns = state.residual["frequency_Hz"], state.slope["frequency_Hz"]
    assert np.sqrt(np.mean(residual**2)) > 0.05
    assert left_by(columns, residual, 1e-3) < 0.005


def test_a_simulation_through_a_hole_says_where_it_is(card, record):
    run = simulate_run(card, drive_by_record(record), noise=False)
    assert any("has a hole of 1220 s after 2790 s: a smooth curve bridges it" in one for one in run.warnings)


def test_a_straight_line_over_a_hole_stays_where_it_is():
    time = np.concatenate([np.arange(0.0, 1000.0, 10.0), np.arange(1900.0, 3000.0, 10.0)])
    profile = Profile(time, 293.15 + 0.01 * time)
    bridged, departures = bridge_holes(profile)
    assert len(bridged.time) == len(time) + PARTS - 1
    np.testing.assert_allclose(bridged.value, 293.15 + 0.01 * bridged.time, rtol=1e-13)
    (first,) = departures
    assert bridged.time[first - 1] == 990.0
    assert bridged.time[first + PARTS - 1] == 1900.0
    np.testing.assert_allclose(straight(bridged, departures).value, bridged.value, rtol=1e-13)


def test_a_cubic_over_a_hole_keeps_its_values_and_its_integral():
    """Exact limit: slopes by parabolas of rows at both sides are exact for T of second degree, whose integral over the hole follows."""
    time = np.concatenate([np.arange(0.0, 1000.0, 10.0), np.arange(1300.0, 2500.0, 10.0)])
    bridged, departures = bridge_holes(Profile(time, 300.0 + 0.02 * time - 3e-6 * time**2))
    (first,) = departures
    rows = slice(first - 1, first + PARTS)
    t, T = bridged.time[rows], bridged.value[rows]
    a, b = t[0], t[-1]
    exact = 300.0 * (b - a) + 0.01 * (b**2 - a**2) - 1e-6 * (b**3 - a**3)
    assert (a, b) == (990.0, 1300.0)
    assert np.trapezoid(T, t) == pytest.approx(exact, rel=1e-12)
    assert straight(bridged, departures).value[first] < T[1]


def test_a_curve_over_a_hole_does_not_turn_round():
    """A jump of the chamber right before a hole leaves a slope that a straight cubic would follow far beyond the values at both ends."""
    time = np.concatenate([np.arange(0.0, 1000.0, 10.0), np.arange(2900.0, 5000.0, 10.0)])
    profile = Profile(time, 293.15 + 30.0 * (1.0 - np.exp(-np.clip(time - 900.0, 0.0, None) / 300.0)))
    bridged, (first,) = bridge_holes(profile)[0], bridge_holes(profile)[1]
    assert np.all(np.diff(bridged.value[first - 1 : first + PARTS]) >= 0.0)
    assert bridged.value.max() <= profile.value.max()
    assert bridge_holes(Profile(time[:100], time[:100] + 300.0))[1] == {}
