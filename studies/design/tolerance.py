"""What tolerances do about a design: to first order by the slopes of full solves, checked by a few more of them."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from studies.design.search import BOXES, Search
from studies.design.task import is_magnitude, shown

Array = NDArray[np.float64]
DRAWN = 16  # designs drawn from the tolerances, besides the worst corners


@dataclass(frozen=True, eq=False)
class Spread:
    """What tolerances do to one wanted column; `first_order` worst case to one side, `passed` the probability that its limits hold, or None."""

    column: str
    value: float
    first_order: float
    sd: float
    low: float
    high: float
    passed: float | None


def spread_about(search: Search, best: int) -> tuple[Spread, ...]:
    """Return what tolerances do to each wanted column, to first order, and check it by full solves."""
    task, goals = search.task, search.goals
    x, values = search.x[best], search.values[best]
    most = np.array([t.most if (t := task.tolerance(n)) else 0.0 for n in task.study.names]) / search.width
    sd = np.array([t.sd if (t := task.tolerance(n)) else 0.0 for n in task.study.names]) / search.width
    slopes = search.slopes(best, BOXES[-1])
    moves = {c: goals.moves(values, slopes, c) for name in task.wanted for c in goals.smooth(name)}
    nearest = {name: moves[min(goals.smooth(name), key=lambda c: abs(values[c]))] for name in task.wanted}
    corners = [x + side * np.sign(move) * most for move in nearest.values() for side in (1.0, -1.0)]
    rng = np.random.default_rng(task.keys.search.seed)
    ends = np.array([t.tolerance is not None if (t := task.tolerance(n)) else False for n in task.study.names])
    drawn = [
        x + np.where(ends, most * rng.uniform(-1, 1, len(x)), sd * rng.standard_normal(len(x))) for _ in range(DRAWN)
    ]
    known = len(search.values)
    search.look([*corners, *drawn])
    around = np.vstack([search.values[known:], values])
    found = []
    for name in task.wanted:
        c, move = task.columns.index(name), nearest[name]
        column = np.abs(around[:, c]) if is_magnitude(name) else around[:, c]
        one = float(np.sum(np.abs(move) * most)), float(np.linalg.norm(move * sd))
        value = shown(name, values[c])
        passed = [
            scipy.stats.norm.cdf(sign * (limit - value) / max(one[1], 1e-300))
            for n, sign, limit, _ in goals.limits
            if n == name
        ]
        share = float(max(0.0, sum(passed) - (len(passed) - 1))) if passed else None
        found.append(Spread(name, value, *one, float(column.min()), float(column.max()), share))
    return tuple(found)
