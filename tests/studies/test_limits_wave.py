"""Length and axis of the damping's anisotropy against draws from their priors, and jumps of a chamber between two rows."""

import numpy as np
import pytest

from studies.calibration.priors import gather_priors
from studies.calibration.wave import PER_DEGREE
from studies.instrument.card import load_card
from studies.simulation.drive import Drive
from thermal.profile import Profile

T, LATER = 293.15, 303.15


@pytest.fixture(scope="module")
def priors():
    return gather_priors(load_card("hrg-30mm"))


@pytest.mark.slow
@pytest.mark.parametrize(("x", "sd"), [(-0.9, 0.05), (0.3, 0.1)])
def test_length_and_axis_are_what_draws_that_agree_with_the_data_say(priors, x, sd):
    """Of a million draws of ln A and θ, those are weighed with the data's likelihood of one component; a cosine may be negative."""
    wave, rng = priors.wave, np.random.default_rng(3)
    mean, spread_a, _ = wave.moments
    A = wave.length.value * np.exp(rng.standard_normal(1_000_000) * wave.length.sd / wave.length.value)
    axis = (wave.axis.sd * rng.standard_normal(A.size) + 45.0) % 90.0 - 45.0
    seen = (A * np.cos(axis * PER_DEGREE) - mean) / spread_a
    weight = np.exp(-(((seen - x) / sd) ** 2) / 2)
    information = np.diag([1 / sd**2, 0.0])
    found = wave.posterior(information, np.linalg.solve(information + np.eye(2), information @ [x, 0.0]), np.eye(2))
    for one, values in ((found.length, A), (found.axis, axis)):
        order = np.argsort(values)
        total = np.cumsum(weight[order]) / weight.sum()
        low, high = values[order][np.searchsorted(total, [0.05, 0.95])]
        assert one.low == pytest.approx(low, rel=0.03, abs=0.3 if one is found.axis else 0)
        assert one.high == pytest.approx(high, rel=0.03)
    assert float(np.sum(weight * seen) / weight.sum()) == pytest.approx(found.mean[0], abs=0.02)


@pytest.mark.parametrize("turned", [0.0, 1e-14, -1e-14])
def test_an_axis_of_which_nothing_is_known_has_ends_alike(priors, turned):
    """Rounding put all axes at 45° on one side: −37.3 … 36.4 on one processor, −36.4 … 37.3 on another."""
    found = priors.wave.posterior(np.array([[0.25, turned], [turned, 0.0]]), np.zeros(2), np.eye(2))
    assert found.axis.low == pytest.approx(-found.axis.high, abs=0.01)


def test_derivatives_by_the_components_are_those_of_length_and_axis(priors):
    u = 0.3 * np.random.default_rng(1).standard_normal(len(priors.values))
    slopes = priors.slopes(u)
    for k in priors.pair:
        step = np.zeros(len(u))
        step[k] = 1e-5
        above, below = (np.array([*priors.at(u + sign * step).values()]) for sign in (1, -1))
        assert slopes[:, k] == pytest.approx((above - below) / 2e-5, rel=1e-6, abs=1e-12)


def test_a_jump_moves_past_rows_that_then_have_its_other_value():
    profile = Profile(np.array([0.0, 60.0, 120.0, 120.0, 180.0, 240.0]), np.array([T, T, T, LATER, LATER, LATER]))
    times = np.arange(0.0, 241.0, 10.0)
    for later in (-90.0, -30.0, 0.0, 30.0, 90.0):
        moved = Drive(np.array([0.0, 240.0]), "chamber", profile, jumps={0: later}).imposed
        assert moved.at(times) == pytest.approx(np.where(times >= 120.0 + later, LATER, T))
        assert list(moved.jumps) == [120.0 + later]
