"""`[loss]`: 1/Q of the drive mode over temperature."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, Note, number


class Loss(Keys, frozen=True, kw_only=True):
    """1/Q = q₀ (1 + a x + b x²), x = T − T_ref (K)."""

    inverse_q: Annotated[float, number("at the reference temperature", above=0.0, relative_sd=1.0)] = 1e-7
    slope_per_K: Annotated[float, number("relative", sd=4e-3)] = 4e-3
    curvature_per_K2: Annotated[float, number("relative", sd=4e-5)] = 0.0
    note: Note = ""

    def __post_init__(self) -> None:
        if not self.inverse_q < 0.1:
            raise ValueError(f"inverse_q = {self.inverse_q:g} must lie between 0 and 0.1: it is 1/Q, not Q.")

    def at(self, excess: NDArray[np.float64]) -> NDArray[np.float64]:
        """1/Q at temperatures above the reference (K)."""
        return np.asarray(self.inverse_q * (1 + excess * (self.slope_per_K + self.curvature_per_K2 * excess)))


TABLE = CardTable("loss", Loss)
