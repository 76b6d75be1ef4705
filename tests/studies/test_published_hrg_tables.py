"""Published values: the HRG paper's Tables 1 and 2, equation (18), and what its own data say of its conclusion."""

import numpy as np
import pytest

from studies.papers import hrg
from studies.record import read_frequency_table

T, F = hrg.printed_table1()
STUDY = hrg.study_table(T, F, resolution=hrg.RESOLUTION)


def test_local_slopes_have_their_published_values():
    """Theory sheet: slopes between neighbours over the local frequency, each ± 0.09 from rounding."""
    np.testing.assert_allclose(STUDY.local_slope_ppm, [92.3, 87.0, 82.7, 79.2, 78.7, 82.0], atol=0.06)
    assert STUDY.local_uncertainty_ppm == pytest.approx(0.09, abs=0.005)
    assert float(STUDY.fit.slope_ppm(20.0)) == pytest.approx(79.2, abs=0.05)
    assert float(STUDY.fit.slope_ppm(0.0)) == pytest.approx(84.0, abs=0.05)


def test_rows_in_any_order_give_the_same_study():
    shuffled = np.random.default_rng(3).permutation(len(T))
    other = hrg.study_table(T[shuffled], F[shuffled], resolution=hrg.RESOLUTION)
    np.testing.assert_allclose(other.calculated_degC, STUDY.calculated_degC, atol=1e-9)


def test_a_straight_line_with_noise_asks_for_no_second_order():
    rng = np.random.default_rng(20)
    at = np.linspace(-20, 40, 13)
    asked = [
        hrg.study_table(at, 4425 + 0.36 * at + rng.normal(0, 0.01, at.size), order=1).orders.recommended
        for _ in range(200)
    ]
    # An F-test at the 5 % level lets one in twenty through.
    assert np.mean(np.array(asked) > 1) < 0.10


def test_constant_column_is_refused(tmp_path):
    path = tmp_path / "flat.csv"
    path.write_text("temperature_degC,frequency_Hz\n" + "\n".join(f"{t},4432.0" for t in range(7)))
    table = read_frequency_table(path)
    with pytest.raises(ValueError, match="constant"):
        hrg.study_table(table.values["temperature_degC"], table.values["frequency_Hz"])
