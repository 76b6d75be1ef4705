"""What least squares must satisfy whatever the data, and what it must refuse."""

import numpy as np
import pytest

from compensation.errors import CompensationError
from compensation.polynomial import fit_polynomial
from compensation.regression import compare_nested, fit_linear


def data(seed, rows=40):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(rows, 3))
    return X, 2 + X @ [1.0, -0.5, 0.0] + 0.1 * rng.normal(size=rows), rng


def test_leave_one_out_equals_fitting_without_each_row():
    X, y, _ = data(1)
    fit = fit_linear(X, y, "abc")
    for k in (0, 17, 39):
        keep = np.arange(40) != k
        rest = fit_linear(X[keep], y[keep], "abc")
        predicted = rest.coefficients @ [1.0, *X[k]]
        assert fit.leave_one_out[k] == pytest.approx(y[k] - predicted, rel=1e-9)


def test_intervals_cover_the_planted_coefficient_at_their_stated_rate():
    hits = 0
    for seed in range(400):
        X, y, _ = data(seed, rows=15)
        fit = fit_linear(X, y, "abc")
        hits += abs(fit.coefficients[2] + 0.5) < 2.200985 * fit.standard_errors[2]  # t(0.975, 11)
    assert 0.93 < hits / 400 < 0.97  # 95 % ± 2 binomial standard deviations


def test_a_needless_term_is_called_significant_at_the_stated_rate():
    p_values = []
    for seed in range(400):
        X, y, _ = data(seed, rows=20)
        p_values.append(compare_nested(fit_linear(X[:, :2], y, "ab"), fit_linear(X, y, "abc")).p_value)
    assert 0.03 < np.mean(np.array(p_values) < 0.05) < 0.07


def test_a_known_rounding_variance_is_never_undercut():
    x = np.arange(6.0)
    fit = fit_polynomial(x, 3 * x, 1, least_variance=0.01)
    assert fit.regression.variance == 0.01


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda X, y: (X[:4], y[:4]), "4 coefficients need at least 5 rows, not 4"),
        (lambda X, y: (np.column_stack([X[:, :2], X[:, 0] - 2 * X[:, 1] + 3]), y), "linear combination"),
        (lambda X, y: (np.column_stack([X[:, :2], np.full(40, 7.0)]), y), "'c' is constant"),
        (lambda X, y: (np.where(np.arange(40)[:, None] == 4, np.nan, X), y), "'a' has 1 missing.*row 5"),
        (lambda X, y: (X, np.where(np.arange(40) == 2, np.inf, y)), "'y' has 1 missing or infinite.*row 3"),
        (lambda X, y: (X[:, :2], y), "one name per column"),
    ],
)
def test_unusable_data_are_refused_by_name(spoil, message):
    X, y = spoil(*data(3)[:2])
    with pytest.raises(CompensationError, match=message):
        fit_linear(X, y, "abc")


def test_collinear_columns_are_named_whatever_their_scale():
    rng = np.random.default_rng(5)
    T = 1e6 + rng.normal(size=50)
    X = np.column_stack([T, 1e-9 * (rng.normal(size=50)), 1e3 * T - 7])
    with pytest.raises(CompensationError, match=r"'(T|T_milli)' is a linear combination of '(T|T_milli)'"):
        fit_linear(X, rng.normal(size=50), ["T", "other", "T_milli"])


def test_a_row_that_alone_fixes_a_coefficient_has_no_leave_one_out_error():
    X = np.column_stack([np.arange(10.0), np.arange(10) == 9])
    fit = fit_linear(X, np.arange(10.0) ** 2, ["a", "last"])
    with pytest.raises(CompensationError, match="row 10 alone fixes"):
        _ = fit.leave_one_out
