"""Planted curves come back with honest intervals; data that cannot carry a curve are refused."""

import numpy as np
import pytest
from scipy import stats

from compensation.errors import CompensationError
from compensation.frequency import compare_orders, exchanged_readings, find_turn, fit_frequency, odd_reading
from studies.models.kinds.frequency import save_frequency, temperature_error

T = np.linspace(-20, 40, 13)
TRUTH = (4424.9, 0.3716, -9.7e-4, 1.53e-5)


def reading(rng, noise=0.02):
    return np.polynomial.polynomial.polyval(T, TRUTH) + noise * rng.normal(size=T.size)


@pytest.mark.slow
def test_intervals_of_coefficients_and_temperature_cover_the_truth():
    rng = np.random.default_rng(11)
    inside = np.zeros(5)
    runs = 200
    for _ in range(runs):
        fit = fit_frequency(T, reading(rng))
        t = stats.t.ppf(0.95, fit.regression.degrees_of_freedom)
        inside[:4] += np.abs(fit.coefficients - TRUTH) < t * fit.standard_errors
        found = float(fit.temperature(np.polynomial.polynomial.polyval(13.7, TRUTH)))
        inside[4] += abs(found - 13.7) < t * temperature_error(save_frequency(fit, (), "test"), found)
    assert np.all(np.abs(inside / runs - 0.90) < 3 * np.sqrt(0.09 / runs))


def test_coefficients_about_another_reference_describe_the_same_curve():
    f = reading(np.random.default_rng(3))
    about_zero, about_25 = fit_frequency(T, f), fit_frequency(T, f, reference_temperature_degC=25.0)
    shifted = np.polynomial.polynomial.polyval(T - 25.0, about_25.coefficients)
    assert shifted == pytest.approx(about_zero.frequency(T), rel=1e-13)
    error = temperature_error(save_frequency(about_zero, (), "test"), 25.0) * abs(float(about_zero.slope(25.0)))
    assert about_25.standard_errors[0] == pytest.approx(error, rel=1e-9)


def test_the_inverse_undoes_the_curve():
    fit = fit_frequency(T, reading(np.random.default_rng(4)))
    inner = np.linspace(-20, 40, 101).reshape(1, -1)
    assert fit.temperature(fit.frequency(inner)) == pytest.approx(inner, abs=1e-9)


def test_a_falling_curve_is_inverted_too():
    fit = fit_frequency(T, 9000 - 0.5 * T - 1e-4 * T**2 + 1e-3 * np.cos(T), order=2)
    assert fit.temperature(fit.frequency(7.0)) == pytest.approx(7.0, abs=1e-9)


@pytest.mark.slow
def test_a_straight_line_with_noise_asks_for_no_second_order():
    rng = np.random.default_rng(8)
    asked = [compare_orders(T, 4425 + 0.37 * T + 0.02 * rng.normal(size=T.size)).recommended > 1 for _ in range(300)]
    assert abs(np.mean(asked) - 0.05) < 3 * np.sqrt(0.05 * 0.95 / 300)


def test_a_law_without_a_quadratic_part_is_a_cubic():
    """About the middle of its range a cubic may have none: it was called a straight line, at p = 1e-4 of the cubic."""
    rng = np.random.default_rng(8)
    asked = [
        compare_orders(T, 4425 + 0.37 * T + 1e-5 * (T - T.mean()) ** 3 + 2e-3 * rng.normal(size=T.size)).recommended
        for _ in range(50)
    ]
    assert np.mean(np.array(asked) == 3) > 0.85


def test_rounding_alone_passes_its_own_test():
    """Readings rounded to 0.01 Hz: χ² against resolution²/12 rejects the true order about one time in twenty."""
    rng = np.random.default_rng(9)
    rejected = []
    for _ in range(300):
        truth = rng.uniform(4400, 4500) + rng.uniform(0.3, 0.4) * T + rng.uniform(-1e-3, 0) * T**2
        fit = fit_frequency(T, np.round(truth, 2), 2, resolution=0.01)
        rejected.append(stats.chi2.sf(fit.chi_squared, fit.regression.degrees_of_freedom) < 0.05)
    assert np.mean(rejected) < 0.09


@pytest.mark.parametrize(
    ("temperature", "frequency", "options", "message"),
    [
        (np.full(7, 20.0), 4400 + np.arange(7.0), {}, "'temperature_degC' is constant"),
        (np.arange(7.0), np.full(7, 4400.0), {}, "'frequency' is constant"),
        ([0, 0, 10, 10, 20, 20], np.arange(6.0) + 4400, {}, "needs at least 4 different values"),
        ([0.0, 10, 20, 30], [4400.0, 4403, 4407, 4410], {}, "5 rows"),
        (np.arange(6.0), [4400, np.nan, 4402, 4403, 4404, 4405], {}, "'y' has 1 missing"),
        ([0, np.nan, 2, 3, 4, 5], np.arange(6.0), {}, "'temperature_degC' has missing"),
        (np.arange(6.0), np.arange(6.0) - 2, {}, "must be positive"),
        (np.arange(6.0), np.arange(6.0) + 4400, {"order": 0}, "order of 1 or more"),
        (np.arange(6.0), np.arange(6.0) + 4400, {"resolution": 0.0}, "resolution"),
        (np.arange(6.0), np.arange(6.0) + 4400, {"resolution": 1e300}, "cannot have a resolution"),
        (np.arange(6.0), np.arange(6.0) + 4400, {"resolution": 1e-300}, "cannot have a resolution"),
        (np.arange(6.0), np.arange(6.0) + 4400, {"reference_temperature_degC": float("nan")}, "reference temperature"),
        (np.arange(6.0), np.arange(6.0) + 4400, {"reference_temperature_degC": 1e300}, "reference temperature"),
        (np.arange(6.0), np.arange(5.0) + 4400, {}, "equally long"),
        ("law.csv", "more.csv", {}, "reads files"),
    ],
)
def test_unusable_tables_are_refused(temperature, frequency, options, message):
    with pytest.raises(CompensationError, match=message):
        fit_frequency(temperature, frequency, **options)


def test_nothing_is_extrapolated_unless_asked():
    fit = fit_frequency(T, reading(np.random.default_rng(2)))
    with pytest.raises(CompensationError, match="outside the fitted range -20 to 40"):
        fit.frequency([0.0, 41.0])
    with pytest.raises(CompensationError, match="lies outside"):
        fit.temperature(4450.0)
    assert fit.frequency(41.0, extrapolate=True) > fit.frequency(40.0)


@pytest.mark.parametrize("turn", [20.0, 60.0])
def test_a_curve_turns_where_its_slope_is_zero(turn):
    """Below the middle of the range the grid's step before it was said."""
    assert find_turn(lambda T: (T - turn) ** 2, (-60.0, 140.0)) == pytest.approx(turn, abs=1e-9)


def test_planted_a_mistyped_digit_is_found_and_chance_rarely_is():
    """4482.56 for 4428.56 Hz, 54 Hz; of tables with noise one in ten thousand may be told, 20 of 20000 by no chance."""
    random, T = np.random.default_rng(0), np.arange(-20.0, 41.0, 10.0)
    f = np.array([4416.97, 4421.05, 4424.90, 4428.56, 4432.07, 4435.56, 4439.20])
    assert odd_reading(T, f, 3) is None
    f[3] += 54.0
    assert odd_reading(T, f, 3) == (3, pytest.approx(54.0, abs=0.1))
    tables = 4400 + 0.3 * T + 0.01 * random.standard_normal((20000, T.size))
    assert sum(odd_reading(T, one, 3) is not None for one in tables) < 10


@pytest.mark.parametrize("i", range(7))
def test_recovery_of_two_rows_that_are_exchanged(i):
    """Each pair of ten; a straight line was sufficient for them, 10 K off. Noise and a warming that is not the cooling exchange none."""
    T, rng = np.linspace(-40.0, 80.0, 10), np.random.default_rng(i)
    f = 4432.0 + 0.35 * T - 4e-4 * T**2 + 2e-3 * rng.standard_normal(T.size)
    assert exchanged_readings(T, f, 3) is None
    again = np.r_[f, f[::-1] + 0.02 + 2e-3 * rng.standard_normal(T.size)]
    assert exchanged_readings(np.r_[T, T[::-1]], again, 3) is None
    for j in range(i + 1, 10):
        mixed = f.copy()
        mixed[[i, j]] = f[[j, i]]
        assert sorted(exchanged_readings(T, mixed, 3)) == [i, j]
