"""What pages show of one response of a diagnosis, whichever inference made it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SeenResponse:
    """Residuals of one response in time and against its inputs, and what stood for its causes.

    Attributes
    ----------
    time, plain, final : by run: times (s), residuals of the baseline and of the model with causes
    named : whether it has causes
    step : duration of the averages that are shown against the inputs, s
    rest, run : residual of the baseline on all averages, and the run of each
    inputs : what it is shown against, by name with unit; the first two are the resonator's temperature and its rate
    slope : of the frequency over temperature, Hz/K; 0 for other responses
    alternatives : for each cause the effects that could stand there, with twice their log odds
    left : input and twice the log evidence of a significant lack of fit
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
