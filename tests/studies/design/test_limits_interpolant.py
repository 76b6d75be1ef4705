"""The interpolant goes through its designs, is exact where the columns are linear, and has the slopes of its values."""

import numpy as np
import pytest

from studies.design.interpolant import interpolate


def test_it_goes_through_and_reproduces_what_is_linear():
    rng = np.random.default_rng(1)
    x = rng.random((12, 3))
    values = np.column_stack([1e3 + x @ [1.0, -2.0, 3.0], np.exp(x[:, 0])])
    twice, again = np.vstack([x, x[:1]]), np.vstack([values, values[:1]])
    found = interpolate(twice, again)
    assert np.array([found(one)[0] for one in x]) == pytest.approx(values, rel=1e-9)
    assert found.of(np.array([1]))(x[0])[0] == pytest.approx(values[0, 1:])
    value, slopes = found(np.array([0.3, 0.9, 0.1]))
    assert value[0] == pytest.approx(1e3 + 0.3 - 1.8 + 0.3, rel=1e-12)
    assert slopes[0] == pytest.approx([1.0, -2.0, 3.0], abs=1e-9)


def test_slopes_are_those_of_the_values_and_nothing_moves_where_no_design_did():
    rng = np.random.default_rng(2)
    x = np.column_stack([rng.random((15, 2)), np.full(15, 0.5)])
    values = np.sin(3 * x[:, :1]) * x[:, 1:2]
    found = interpolate(x, values)
    at = np.array([0.4, 0.6, 0.5])
    by = [(found(at + 1e-6 * one)[0] - found(at - 1e-6 * one)[0]) / 2e-6 for one in np.eye(3)]
    assert found(at)[1][0] == pytest.approx(np.array(by)[:, 0], abs=1e-6)
    assert found(at)[1][0, 2] == pytest.approx(0.0, abs=1e-9)
