"""Evidence: exact limits of the predictor that the held-out residuals are compared with."""

import numpy as np
import pytest

from tests.stranger import make_campaign
from tests.stranger.ideal import ideal_ratios
from tests.stranger.noise import FAMILIES, covariance_of, draw_noise


@pytest.mark.parametrize("family", FAMILIES)
def test_covariance_of_means_is_that_of_many_draws(family):
    rng = np.random.default_rng(8)
    time, cells = np.arange(0.0, 2400.0, 10.0), np.arange(0, 240, 20)
    draws = np.stack([draw_noise(family, time, rng, 90.0).reshape(12, 20).mean(axis=1) for _ in range(6000)])
    exact = covariance_of(family, time, cells, 90.0)
    found = draws.T @ draws / len(draws)
    error = np.sqrt((np.outer(np.diag(exact), np.diag(exact)) + exact**2) / len(draws))  # of a sample covariance
    assert np.max(np.abs(found - exact) / error) < 5.0


def test_covariance_follows_uneven_rows():
    time = np.array([0.0, 10.0, 20.0, 50.0, 60.0])
    walk = covariance_of("random-walk", time, np.array([0, 2, 3]), 1.0) * 60.0 * 0.41**2
    assert np.allclose(walk, [[2.5, 5.0, 5.0], [5.0, 20.0, 20.0], [5.0, 20.0, 52.5]])  # means of min(t, t')
    relaxing = covariance_of("ar1", time, np.arange(5), 30.0)
    assert np.allclose(relaxing, np.exp(-np.abs(time[:, None] - time) / 30.0))
    jittered = np.array([0.0, 6.0, 14.0, 21.0, 31.0])  # of steps of 7.5 s the places 0, 1, 2, 3, 4
    shared = np.array([0.0, 10.0, 14.0, 20.0, 30.0])  # of steps of 8 s the places 0, 1, 2, 2, 4
    assert np.allclose(np.diag(covariance_of("ar1", jittered, np.arange(5), 30.0)), 1.0)
    assert covariance_of("ar1", shared, np.arange(5), 30.0)[2, 3] == pytest.approx(1.0)


@pytest.mark.slow
def test_many_runs_foretell_another_to_its_white_noise(tmp_path):
    ratios = ideal_ratios(make_campaign(5, "null", "white", runs=6, folder=tmp_path))
    assert all(ratio == pytest.approx(1.0, abs=0.02) for ratio in ratios.values())


@pytest.mark.slow
def test_what_only_one_run_shows_is_not_foretold(tmp_path):
    truth = make_campaign(5, "effect", "jump", 12.0, runs=2, folder=tmp_path)
    ratios = ideal_ratios(truth)
    assert ratios.get("frequency_Hz", 0.0) < 1.6
    assert ratios.get("bias_deg_per_h", 0.0) < 1.6
