"""The sparse interpolant in its exact limits: polynomials, bounded basis, and what it must not promise."""

import numpy as np
import pytest

from shell.interpolation import MOST_POINTS, Exploration, leja_points, tabulate


def test_every_basis_function_is_one_at_its_point_and_nowhere_larger():
    points = leja_points()
    assert len(np.unique(points)) == MOST_POINTS
    values = tabulate(np.linspace(-1, 1, 4001), 20)
    assert abs(values).max() <= 1 + 1e-6
    at_points = tabulate(points[:20], 20)
    assert np.diag(at_points) == pytest.approx(np.ones(20))
    assert abs(np.triu(at_points.T, 1).T - np.tril(at_points, -1)).max() < 1e-12


def quartic(x):
    """Of degree 4 in one coordinate, 2 and 1 in others, with products; the second output has other terms."""
    a, b, c = x
    return np.array([1 + 2 * a - a**4 + 3 * a * b - b**2 + 0.5 * a * b * c + b * c + a * c, c * b - 7 * a**2 + a**3])


def test_a_polynomial_is_found_exactly_from_as_many_points_as_it_has_terms():
    grid = Exploration(quartic, 3)
    assert grid.refine(1e-12, 100)
    assert len(grid.surpluses) < 40  # the full tensor of degree 4 has 125
    x = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    polynomial = grid.polynomial()
    np.testing.assert_allclose(polynomial(x), np.array([quartic(row) for row in x]), atol=1e-13)


def test_an_analytic_function_of_many_numbers_spends_its_points_where_they_matter():
    weights = np.array([1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001, 0.001])
    grid = Exploration(lambda x: np.array([1 / (6 + weights @ x)]), 8)
    assert grid.refine(1e-6, 300)
    x = np.random.default_rng(2).uniform(-1, 1, (500, 8))
    assert abs(grid.polynomial()(x)[:, 0] - 1 / (6 + x @ weights)).max() < 2e-5
    degrees = np.max(list(grid.surpluses), axis=0)
    assert degrees[0] > degrees[1] > degrees[3]


def test_a_product_whose_factors_alone_do_nothing_is_not_found():
    """Why whoever relies on the interpolant must judge it by points that it has not seen."""
    grid = Exploration(lambda x: np.array([x[0] * x[1] * x[2]]), 3)
    assert grid.refine(1e-6, 100)
    assert abs(grid.polynomial()(np.ones((1, 3)))[0, 0]) < 1e-12


def test_it_gives_up_where_the_points_do_not_suffice():
    grid = Exploration(lambda x: np.array([abs(x[0] - 0.3)]), 1)
    assert not grid.refine(1e-9, 20)
    assert grid.pending > 1e-9


def test_a_point_gives_the_same_alone_and_among_others():
    grid = Exploration(quartic, 3)
    grid.refine(1e-12, 100)
    polynomial, x = grid.polynomial(), np.random.default_rng(3).uniform(-1, 1, (1500, 3))
    together = polynomial(x)
    for k in (0, 7, 1499):
        np.testing.assert_array_equal(polynomial(x[k : k + 1])[0], together[k])


def test_without_coordinates_it_is_a_constant():
    polynomial = Exploration(lambda _: np.array([3.0]), 0).polynomial()
    np.testing.assert_array_equal(polynomial(np.zeros((4, 0))), np.full((4, 1), 3.0))
