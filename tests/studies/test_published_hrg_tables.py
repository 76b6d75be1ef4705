"""Published values: the HRG paper's Tables 1 and 2, equation (18), and what its own data say of its conclusion."""

import numpy as np
import pytest

from studies.papers import hrg

T, F = hrg.printed_table1()
STUDY = hrg.study_table(T, F, resolution=hrg.RESOLUTION)


def test_local_slopes_have_their_published_values():
    """Theory sheet: slopes between neighbours over the local frequency, each ± 0.09 from rounding."""
    np.testing.assert_allclose(STUDY.local_slope_ppm, [92.3, 87.0, 82.7, 79.2, 78.7, 82.0], atol=0.06)
    assert STUDY.local_uncertainty_ppm == pytest.approx(0.09, abs=0.005)
    assert float(STUDY.fit.slope_ppm(20.0)) == pytest.approx(79.2, abs=0.05)
    assert float(STUDY.fit.slope_ppm(0.0)) == pytest.approx(84.0, abs=0.05)
