"""Exact slopes of a design's columns are those of differences of full solves."""

from dataclasses import replace

import numpy as np
import pytest

from studies.design.task import read_task
from studies.sweeps.evaluate import WorkPlan, evaluate_case

TASK = """
schema = "hrg.design/1"
card = "hrg-30mm"
[[parameter]]
name = "resonator.thickness_mm"
low = 0.6
high = 1.4
[[parameter]]
name = "resonator.stem.radius_mm"
low = 2.0
high = 4.0
[[tolerance]]
name = "resonator.radius_mm"
tolerance = 0.01
[[objective]]
column = "mass_g"
[[constraint]]
column = "frequency_n2_Hz"
low = 4500.0
[[constraint]]
column = "separation_n2_Hz"
low = 500.0
[[constraint]]
column = "time_constant_shell_s"
high = 1e4
[[constraint]]
column = "bryan_factor_n2"
low = 0.2
[[quantity]]
name = "mode-separation"
highest = 1
each = 2
tolerance = 1e-6
[search]
evaluations = 10
"""


@pytest.mark.slow
def test_limits_slopes_of_full_solves(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text(TASK)
    task = read_task(path)
    names = task.columns
    assert {"mass_g", "frequency_n2_Hz", "time_constant_shell_s"} < {names[k] for k in task.exact}
    assert "bryan_factor_n2" not in {names[k] for k in task.exact}
    plan = replace(WorkPlan.of(task.study), start=task.named(task.start))
    row = np.array(evaluate_case(plan, task.named(task.start)).values)
    slopes = row[len(names) :].reshape(len(task.exact), -1)
    for k, step in enumerate((2e-3, 1e-3, 2e-3)):
        ends = [evaluate_case(plan, task.named(task.start + side * step * np.eye(3)[k])) for side in (1.0, -1.0)]
        high, low = (np.array(end.values)[list(task.exact)] for end in ends)
        found = (high - low) / (2 * step)
        assert slopes[:, k] == pytest.approx(found, rel=1e-3, abs=1.0)
