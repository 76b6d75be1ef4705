"""The card after a calibration: most probable values, their widths, correlations and intervals."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from studies.calibration.estimates import Estimate
    from studies.calibration.priors import Priors
    from studies.instrument.card import Instrument

Array = NDArray[np.float64]
DIGITS = 12  # of a correlation: the frequency knows two values together a thousand times better than each, and 1 − ρ² is the square


def posterior_card(
    instrument: "Instrument",
    priors: "Priors",
    point: Array,
    covariance: Array,
    estimates: "Sequence[Estimate]",
    more: dict[str, float] | None = None,
) -> "Instrument":
    """Return the card with posterior values, widths, correlations and intervals; `more` are further values of it."""
    moves = priors.slopes(point)
    C = moves @ covariance @ moves.T
    sd = np.sqrt(np.diag(C))
    R = np.clip(C / np.outer(sd, sd), -1.0, 1.0)
    np.fill_diagonal(R, 1.0)
    values = {}
    for one, prior in zip(estimates, priors.values, strict=True):
        ends = {"low": prior.low if prior.low != 0.0 else -np.inf, "high": prior.high}
        hard = {name: end for name, end in ends.items() if np.isfinite(end)}
        values[one.parameter] = {"value": one.value, "sd": one.sd, **hard}
    posterior = {
        "names": [one.parameter for one in estimates],
        "correlation": R.round(DIGITS).tolist(),
        "interval": [[one.low, one.high] for one in estimates],
    }
    return instrument.with_values(values | (more or {})).with_table("posterior", posterior)
