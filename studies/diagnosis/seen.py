"""What pages show of one response of a diagnosis, whichever inference made it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SeenResponse:
    """Residuals of one response over time and inputs (the resonator's temperature and its rate first), and what stood for its causes.

    `plain` and `final` are of the baseline and of the model with causes, `rest` of the baseline on averages of `step`
    s, `slope` df/dT, Hz/K; `left` is an input and twice the log evidence of a significant lack of fit.
    """

    time: tuple[Array, ...]
    plain: tuple[Array, ...]
    final: tuple[Array, ...]
    named: bool
    step: float
    rest: Array
    run: NDArray[np.intp]
    inputs: Mapping[str, Array]
    slope: float
    alternatives: tuple[tuple[tuple[str, float], ...], ...]
    left: tuple[str, float] | None
