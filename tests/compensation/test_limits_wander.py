"""Limits: the rotated rows of a wander hold the covariance of what the rows are."""

from functools import partial

import numpy as np
import pytest

from compensation.wander import Eigenbasis, flicker, gauss_markov, random_walk


@pytest.mark.parametrize(
    ("covariance", "far"), [(random_walk, 1e-9), (partial(gauss_markov, tau=600.0), 2e-3), (flicker, 8e-3)]
)
def test_rows_that_are_means_have_the_covariance_of_means(covariance, far):
    """Against the average of the covariance of their moments: exact for a random walk, to second order of Δ/τ for the others."""
    moments = 6.0 * (np.arange(12) - 5.5)
    centres = 72.0 * np.arange(60)
    times = (centres[:, None] + moments).ravel()
    mean = np.kron(np.eye(60), np.full((1, 12), 1.0 / 12.0))
    exact = mean @ covariance(times) @ mean.T
    basis = Eigenbasis.of([centres], covariance, moments)
    found = basis.vectors[0] @ np.diag(basis.eigenvalues) @ basis.vectors[0].T
    level = exact[1, 1] - found[1, 1] if covariance is random_walk else 0.0  # of where the walk begins
    assert np.abs(found + level - exact)[1:, 1:].max() < far
