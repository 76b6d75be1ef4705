"""A third witness: effects that only patch up together what none of them is.

With enough of them, loops, dips and lags follow any curve. A gyro may jump more than once, hear more than one line and
have more than one spurious mode, but it has one hysteresis, one second lag, one law of each kind.
"""

import itertools
from collections.abc import Sequence

from studies.diagnosis.baseline import Term
from studies.diagnosis.fit import Fit, intervals

MOST = {"jump": 2, "periodic": 2, "activity-dip": 2, "loss-peak": 2}
"""How often an effect may stand in one response; all others once."""
APART = 3.0
"""Distance of two dips or peaks over the sum of their widths, from which on they are two."""


def patched(fit: Fit) -> bool:
    """Whether an effect repeats where it cannot, or effects cancel: none of their coefficients is known to better than itself."""
    terms = fit.terms
    names = [term.name for term in terms]
    if any(names.count(name) > MOST.get(name, 1) for name in names) or _overlap(terms):
        return True
    return len(terms) > 1 and any(_unknown(fit, index) for index in range(len(terms)))


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
