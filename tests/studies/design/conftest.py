"""Design tasks whose columns are formulas, so that their answers are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from studies.design.keys import DesignKeys
from studies.design.task import Task
from studies.schema.reader import read_keys
from studies.sweeps.block import Row


class Formulas:
    """Stands for the explorer: computes columns by a function of the design."""

    def __init__(self, function):
        self.function, self.asked = function, 0

    def cases(self, designs):
        self.asked += len(designs)
        values = [np.array(self.function(row), dtype=float) for row in designs]
        return [Row("ok", "", v, np.full_like(v, np.nan)) for v in values]


@pytest.fixture
def pose():
    """Make a task of parameters {name: (low, high, start)} and columns, and the explorer of its formulas."""

    def make(parameters, columns, function, **tables):
        content = {
            "schema": "hrg.design/1",
            "card": "free-dome",
            "parameter": [{"name": n, "low": a, "high": b, **more} for n, (a, b, more) in parameters.items()],
            **tables,
        }
        keys = read_keys(content, DesignKeys, "test")
        known = [SimpleNamespace(name=n, low=a, high=b) for n, (a, b, _) in parameters.items()]
        others = [t for t in keys.tolerance if t.name not in parameters]
        known += [SimpleNamespace(name=t.name, low=1 - t.most, high=1 + t.most) for t in others]
        study = SimpleNamespace(
            parameters=known,
            names=tuple(p.name for p in known),
            columns=[SimpleNamespace(name=c, unit="1", label=c) for c in columns],
        )
        start = np.array([more.get("start", (a + b) / 2) for a, b, more in parameters.values()] + [1.0] * len(others))
        return Task(keys, "test", study, len(parameters), start), Formulas(function)

    return make
