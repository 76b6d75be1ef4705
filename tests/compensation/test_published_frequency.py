"""HRG paper eq. (18) and Table 2 from its Table 1, and what the paper's own conclusion misses.

Numbers without a printed counterpart were recomputed independently of this project.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from compensation.frequency import compare_orders, fit_frequency, misreading_degC

REFERENCE = Path(__file__).parents[1] / "reference"
TABLE1 = np.loadtxt(REFERENCE / "hrg_f_vs_T_wang2012.csv", delimiter=",", skiprows=4)
TABLE2 = np.loadtxt(REFERENCE / "hrg_T_from_f_wang2012.csv", delimiter=",", skiprows=3)


def fit(order):
    return fit_frequency(*TABLE1.T, order=order, resolution=0.01)


def test_equation_18():
    expected = [4424.90095, 0.3715556, -9.70238e-4, 1.527778e-5]
    assert fit(3).coefficients == pytest.approx(expected, rel=3e-7)
    # printed sizes of the second and third order
    assert round(abs(fit(3).coefficients[2]), 7) == 9.702e-4
    assert round(fit(3).coefficients[3], 8) == 1.528e-5


def test_table_2_to_the_last_printed_digit():
    calculated = fit(3).temperature(TABLE2[:, 0])
    assert calculated == pytest.approx([-19.976, -10.058, -0.003, 10.071, 20.011, 29.924, 40.031], abs=5e-4)
    assert TABLE2[:, 1] - calculated == pytest.approx(TABLE2[:, 3], abs=1e-3)  # one unit of the last digit


def test_the_cubic_leaves_structure_and_the_quartic_only_rounding():
    cubic, quartic = fit(3), fit(4)
    assert cubic.regression.sum_of_squares == pytest.approx(2.150e-3, abs=5e-7)
    assert cubic.regression.leave_one_out_rms == pytest.approx(0.0868, abs=5e-5)
    assert np.max(np.abs(cubic.regression.residuals)) == pytest.approx(0.026904762, rel=1e-7)
    assert cubic.largest_residual_of_span == pytest.approx(0.0012, abs=5e-5)  # the paper's "0.12 %"
    assert chi2.sf(cubic.chi_squared, cubic.regression.degrees_of_freedom) < 1e-20
    assert quartic.regression.sum_of_squares == pytest.approx(4.03e-5, abs=5e-8)
    assert quartic.chi_squared == pytest.approx(4.8, abs=0.05)
    assert quartic.regression.degrees_of_freedom == 2
    assert chi2.sf(quartic.chi_squared, quartic.regression.degrees_of_freedom) > 0.05
    assert quartic.regression.leave_one_out_rms == pytest.approx(0.0216, abs=5e-5)


def test_the_f_test_asks_for_the_quartic():
    comparison = compare_orders(*TABLE1.T, resolution=0.01)
    cubic_against_quartic = comparison.against_next[2]
    assert cubic_against_quartic.statistic == pytest.approx(105, abs=0.5)
    assert (cubic_against_quartic.numerator, cubic_against_quartic.denominator) == (1, 2)
    assert comparison.recommended == 4


def test_cubic_and_quartic_part_outside_the_range():
    """The theory sheet: at -40 and 60 °C the readings differ by 1.7 °C one way and by 2.0 °C the other."""
    ways = [misreading_degC(fit(3), fit(4), [-40.0, 60.0]), misreading_degC(fit(4), fit(3), [-40.0, 60.0])]
    for there in np.sort(np.abs(ways), axis=0).T:
        assert there == pytest.approx([1.7, 2.0], abs=0.055)
    # Roots of the difference by numpy's companion matrix.
    cubic, quartic = np.polyfit(*TABLE1.T, 3), np.polyfit(*TABLE1.T, 4)
    root = np.roots(np.polysub(cubic, [np.polyval(quartic, 60.0)]))
    assert ways[0][1] == pytest.approx(root[np.isreal(root)][0].real - 60.0, abs=1e-6)
