"""What is known of a card's values before any record: independent standard normal coordinates.

A value v of mean v₀ and standard deviation s is v₀ + s z, or v₀ exp(s z/v₀) where its logarithm is normal; z of values
that go together, such as slope and curvature of a material's law, have a correlation R = L Lᵀ, and z = L u with u of
independent unit normals. A value that is even between its bounds is taken as normal within them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from studies.instrument.uncertain import UncertainValue

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Priors:
    """Uncertain values of a card, and the root L of their prior correlation."""

    values: tuple["UncertainValue", ...]
    root: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values."""
        return tuple(value.name for value in self.values)

    def standard(self, u: Array) -> Array:
        """Coordinates z of unit prior variance from independent ones."""
        return np.asarray(self.root @ u)

    def inside(self, u: Array) -> Array:
        """Nearest coordinates whose values respect their bounds."""
        z = self.standard(u)
        held = np.clip(z, *self._ends)
        return u if np.array_equal(z, held) else np.asarray(np.linalg.solve(self.root, held))

    def at(self, u: Array) -> dict[str, float]:
        """Values of the card."""
        return {
            value.name: float(np.clip(from_standard(value, z), value.low, value.high))
            for value, z in zip(self.values, self.standard(u), strict=True)
        }

    def slopes(self, u: Array) -> Array:
        """∂value/∂z at these coordinates."""
        at = self.at(u)
        return np.array([at[v.name] * v.sd / v.value if v.logarithmic else v.sd for v in self.values])

    def bound(self, u: Array) -> tuple[str | None, ...]:
        """Which bound each value has reached."""
        z, (low, high) = self.standard(u), self._ends
        return tuple(
            "low" if one <= a + 1e-9 else "high" if one >= b - 1e-9 else None
            for one, a, b in zip(z, low, high, strict=True)
        )

    @property
    def _ends(self) -> tuple[Array, Array]:
        ends = np.array([[to_standard(v, v.low), to_standard(v, v.high)] for v in self.values]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]


def from_standard(value: "UncertainValue", z: float) -> float:
    """Value at a coordinate of unit prior variance."""
    if value.logarithmic:
        return float(value.value * np.exp(z * value.sd / value.value))
    return value.value + z * value.sd


def to_standard(value: "UncertainValue", number: float) -> float:
    """Coordinate of unit prior variance of a value; infinite at an end without bound."""
    if value.logarithmic:
        return -np.inf if number <= 0 else float(np.log(number / value.value) * value.value / value.sd)
    return float((number - value.value) / value.sd)


def gather_priors(instrument: "Instrument", exact: Sequence[str] = ()) -> Priors:
    """Return the priors of an instrument's uncertain values but for those that are to be taken as exact."""
    correlation = instrument.correlation
    idle = _idle(instrument)
    values = tuple(value for value in instrument.uncertain if value.name not in exact and value.name not in idle)
    R = np.eye(len(values))
    for i, one in enumerate(values):
        for j, other in enumerate(values[:i]):
            R[i, j] = R[j, i] = correlation.get((one.name, other.name), correlation.get((other.name, one.name), 0.0))
    low, vectors = np.linalg.eigh(R)
    R = (vectors * np.maximum(low, 1e-10)) @ vectors.T
    return Priors(values, np.linalg.cholesky(R))


def _idle(instrument: "Instrument") -> set[str]:
    """Values that say nothing in this card: the parts of a loss budget that it does not use, or what stands for them."""
    parts = instrument.part("loss", "loss_parts")
    whole = {f"loss.{key}" for key in instrument.loss.__struct_fields__}
    return {
        value.name
        for value in instrument.uncertain
        if value.name.startswith("loss.") and (value.name in whole) == bool(parts.given)
    }
