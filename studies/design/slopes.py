"""Exact slopes of what hangs on the modes by their frequencies alone: a frequency is stationary in the shape of its mode.

    ∂λ/∂p = dR(p, x)/dp at the unchanged shape x,      R(p, x) = xᵀ K(p) x / xᵀ M(p) x,

so that one solve tells the slopes by all parameters; a star of solves takes one for each (Wittrick 1962; Haug, Choi and
Komkov 1986). Bryan factors, losses and temperature coefficients hang on the shape itself and have none.
"""

import numpy as np

from compensation.arrays import Array
from studies.errors import UNUSABLE_INPUT, InputError
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, Quantity

STEP = 1e-6  # of a parameter's range: what is neglected is as small, rounding 1e-7


class Slopes(Quantity, frozen=True, kw_only=True, tag="slopes"):
    """Slope of every column of stationary quantities by every parameter, in their units."""

    of: tuple[Quantity, ...]
    by: tuple[tuple[str, float], ...]  # names of parameters and their steps

    def list_columns(self) -> tuple[Column, ...]:
        """Return the columns of one quantity after the other, each by all parameters."""
        return tuple(
            Column(f"{column.name}_by_{name}", "1", f"slope of {column.label} by {name}")
            for one in self.of
            for column in one.columns
            for name, _ in self.by
        )

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        """Return the change of every column with the shapes kept, over that of the parameter."""
        here = self._values(case)
        slopes = [self._slope(case, here, name, step) for name, step in self.by]
        return tuple(Number(float(value)) for value in np.transpose(slopes).ravel())

    def _slope(self, case: Case, here: Array, name: str, step: float) -> Array:
        for move in (step, -step):
            try:
                return (self._values(case.moved(name, case.parameters[name] + move)) - here) / move
            except UNUSABLE_INPUT as error:
                reason = error
        raise InputError(f"no design beside it by '{name}': {reason}")

    def _values(self, case: Case) -> Array:
        return np.array([number.value for one in self.of for number in one.evaluate(case)])
