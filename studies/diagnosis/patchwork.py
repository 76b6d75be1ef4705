"""A third witness: effects that only patch up together what none of them is.

With enough of them, dips and lines follow any curve. Effects that a gyro has once are selected once (`selection.MOST`).
"""

import itertools
from collections.abc import Sequence

from studies.diagnosis.baseline import Term
from studies.diagnosis.fit import Fit, intervals

APART = 3.0
"""Distance of two dips or peaks over the sum of their widths, from which on they are two."""


def patched(fit: Fit) -> bool:
    """Whether dips or peaks overlap, or effects cancel: none of their coefficients is known to better than itself."""
    terms = fit.terms
    return _overlap(terms) or (len(terms) > 1 and any(_unknown(fit, index) for index in range(len(terms))))


def _overlap(terms: Sequence[Term]) -> bool:
    """Two dips or two peaks at one temperature are parts of another curve."""
    return any(
        one.name == two.name
        and one.name in ("activity-dip", "loss-peak")
        and abs(one.shape[0] - two.shape[0]) < APART * (one.shape[1] + two.shape[1])
        for one, two in itertools.combinations(terms, 2)
    )


def _unknown(fit: Fit, index: int) -> bool:
    known = intervals(fit, index)
    own = fit.terms[index].effect.coefficient_names(fit.problem.response, fit.terms[index].count)
    return all(known[name].high - known[name].low > 2.0 * abs(known[name].value) for name in own)
