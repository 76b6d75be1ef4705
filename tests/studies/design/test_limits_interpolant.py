"""The interpolant goes through its designs, with the slopes that are known, is exact where the columns are linear, and has the slopes of its values."""

import numpy as np
import pytest

from studies.design.interpolant import interpolate


def unknown(x, values):
    return np.full((*values.shape, x.shape[1]), np.nan)


def test_it_goes_through_and_reproduces_what_is_linear():
    rng = np.random.default_rng(1)
    x = rng.random((12, 3))
    values = np.column_stack([1e3 + x @ [1.0, -2.0, 3.0], np.exp(x[:, 0])])
    twice, again = np.vstack([x, x[:1]]), np.vstack([values, values[:1]])
    found = interpolate(twice, again, unknown(twice, again))
    assert np.array([found(one)[0] for one in x]) == pytest.approx(values, rel=1e-9)
    value, slopes = found(np.array([0.3, 0.9, 0.1]))
    assert value[0] == pytest.approx(1e3 + 0.3 - 1.8 + 0.3, rel=1e-12)
    assert slopes[0] == pytest.approx([1.0, -2.0, 3.0], abs=1e-9)


def test_slopes_are_those_of_the_values_and_nothing_moves_where_no_design_did():
    rng = np.random.default_rng(2)
    x = np.column_stack([rng.random((15, 2)), np.full(15, 0.5)])
    values = np.sin(3 * x[:, :1]) * x[:, 1:2]
    found = interpolate(x, values, unknown(x, values))
    at = np.array([0.4, 0.6, 0.5])
    by = [(found(at + 1e-6 * one)[0] - found(at - 1e-6 * one)[0]) / 2e-6 for one in np.eye(3)]
    assert found(at)[1][0] == pytest.approx(np.array(by)[:, 0], abs=1e-6)
    assert found(at)[1][0, 2] == pytest.approx(0.0, abs=1e-9)


def test_known_slopes_are_kept_and_bring_it_nearer():
    """Of two columns one has slopes, at two thirds of the designs."""
    rng = np.random.default_rng(3)
    x, probes = rng.random((15, 3)), rng.uniform(0.2, 0.8, (50, 3))

    def curve(x):
        return np.exp(np.atleast_2d(x) @ [1.0, -2.0, 0.5])[:, None]

    values = np.hstack([curve(x), curve(x)])
    slopes = unknown(x, values)
    slopes[:10, 0] = curve(x[:10]) * [1.0, -2.0, 0.5]
    found = interpolate(x, values, slopes)
    assert np.array([found(one)[0] for one in x]) == pytest.approx(values, rel=1e-9)
    assert np.array([found(one)[1][0] for one in x[:10]]) == pytest.approx(slopes[:10, 0], rel=1e-8)
    with_slopes, without = np.abs([found(one)[0] - curve(one)[0] for one in probes]).max(axis=0)
    assert with_slopes < without / 3
    at = probes[0]
    by = [(found(at + 1e-6 * one)[0] - found(at - 1e-6 * one)[0]) / 2e-6 for one in np.eye(3)]
    assert found(at)[1] == pytest.approx(np.transpose(by), abs=1e-6)
    assert found.of(np.array([1]))(at)[0] == pytest.approx(found(at)[0][1:])
