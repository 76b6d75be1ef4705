"""Limits: the rotated rows of a wander hold its covariance, whatever the runs."""

import numpy as np
import pytest

from studies.diagnosis.noise import KERNELS, Eigenbasis


@pytest.mark.parametrize("kind", KERNELS)
def test_rotated_rows_are_independent(kind):
    times = [72.0 * np.arange(60), np.delete(72.0 * np.arange(50), [7, 8, 30])]
    basis = Eigenbasis.of(times, KERNELS[kind], 72.0)
    turned = basis.rotate(np.eye(107))
    exact = np.zeros((107, 107))
    for rows, t in zip((slice(0, 60), slice(60, 107)), times, strict=True):
        exact[rows, rows] = KERNELS[kind](t, 72.0)
    assert turned @ exact @ turned.T == pytest.approx(np.diag(basis.eigenvalues), abs=1e-9)
    assert basis.unrotate(turned) == pytest.approx(np.eye(107), abs=1e-12)
