"""What pages show of one response of a diagnosis, whichever inference made it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SeenResponse:
    """Residuals of one response over time and inputs, `plain` and `final`; `left` an input and twice the log evidence of a lack of fit."""

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
