"""What is diagnosed: the measured responses, with their columns, units and names for people."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array


@dataclass(frozen=True)
class Response:
    """One measured response; `scale`: how many of the unit in which small numbers are `shown` make one."""

    column: str
    word: str
    unit: str
    shown: str
    scale: float
    thermometer: bool = False  # whether the other responses read the resonator's temperature from it


RESPONSES: dict[str, Response] = {
    r.column: r
    for r in (
        Response("frequency_Hz", "frequency", "Hz", "mHz", 1e3, thermometer=True),
        Response("bias_deg_per_h", "bias", "°/h", "°/h", 1.0),
        Response("inverse_q", "1/Q", "1", "ppb", 1e9),
    )
}
"""By column, the thermometer first: what it finds is known when the others are asked."""


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
