"""Modes of a cup whose height changes: the followed pair keeps its frequency's course where others cross it, and their distances change sign."""

import numpy as np
import pytest

from studies.instrument.card import load_card
from studies.sweeps.evaluate import WorkPlan, evaluate_case
from studies.sweeps.quantities import library

HEIGHT = "resonator.height_mm"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("heights", "other"), [((8.0, 12.0), "separation_n2_of_n0_0_Hz"), ((8.0, 60.0), "separation_n3_of_n0_1_Hz")]
)
def test_a_mode_that_another_crosses_is_followed(heights, other):
    harmonic = int(other.split("_n")[1][0])
    asked = tuple(
        library()[name](harmonic=harmonic, **more)
        for name, more in (("frequency", {}), ("mode-separation", {"distances": True, "highest": 3}))
    )
    columns = [column.name for one in asked for column in one.columns]
    plan = WorkPlan(load_card("cvg-25mm"), ((HEIGHT, ()),), asked, start={HEIGHT: heights[0]})
    rows = [evaluate_case(plan, {HEIGHT: float(h)}) for h in np.linspace(*heights, 3)]
    assert all(row.status == "ok" for row in rows), rows[0].remark
    values = np.array([row.values for row in rows])
    f, apart, nearest = values[:, 0], values[:, columns.index(other)], values[:, 1]
    assert apart[0] * apart[-1] < 0
    assert abs(nearest) == pytest.approx(abs(values[:, 3:]).min(axis=1))
    assert np.ptp(np.diff(f, 2)) < 0.5 * np.ptp(f)  # a smooth course, no jump to the mode that crosses
