"""What is known of a card's values before any record: independent standard normal coordinates.

v = v₀ + s z, or v₀ exp(s z/v₀) where the logarithm is normal; z of values that go together have the correlation R = L
Lᵀ, z = L u. The damping's anisotropy is moved by its components (`studies.calibration.wave`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.calibration.wave import ANISOTROPY, AXIS, WavePrior

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from studies.instrument.uncertain import UncertainValue

LEAST = 1e-12
"""Of the variances of a correlation's principal axes: what is left by the digits that a card keeps."""


@dataclass(frozen=True)
class Priors:
    """Uncertain values of a card, and the root L of their prior correlation; the coordinates of `wave` are components."""

    values: tuple["UncertainValue", ...]
    root: Array
    wave: WavePrior | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values."""
        return tuple(value.name for value in self.values)

    @property
    def pair(self) -> list[int]:
        """Places of the length and the axis whose coordinates are components; none without."""
        return [] if self.wave is None else [self.names.index(name) for name in (ANISOTROPY, AXIS)]

    @property
    def shipped(self) -> Array:
        """Coordinates z of the card's own values: 0, but for components, which are 0 at their mean."""
        z = np.zeros(len(self.values))
        if self.wave is not None:
            mean, spread, _ = self.wave.moments
            z[self.pair[0]] = (self.wave.length.value - mean) / spread
        return z

    def standard(self, u: Array) -> Array:
        """Coordinates z of unit prior variance from independent ones."""
        return np.asarray(self.root @ u)

    def covariance(self, C: Array) -> Array:
        """Covariance of these coordinates z from that of the independent ones, which come first."""
        count = len(self.values)
        return np.asarray(self.root @ C[:count, :count] @ self.root.T)

    def inside(self, u: Array) -> Array:
        """Nearest coordinates whose values respect their bounds."""
        z = self.standard(u)
        held = np.clip(z, *self._ends)
        return u if np.array_equal(z, held) else np.asarray(np.linalg.solve(self.root, held))

    def at(self, u: Array) -> dict[str, float]:
        """Values of the card."""
        z = self.standard(u)
        found = {
            v.name: float(np.clip(from_standard(v, one), v.low, v.high)) for v, one in zip(self.values, z, strict=True)
        }
        if self.wave is not None:
            length, axis = self.wave.at(*z[self.pair])
            found |= {ANISOTROPY: float(np.clip(length, self.wave.length.low, self.wave.length.high)), AXIS: axis}
        return found

    def slopes(self, u: Array) -> Array:
        """∂value/∂u at these coordinates, (p, p)."""
        at = self.at(u)
        own = np.diag([at[v.name] * v.sd / v.value if v.logarithmic else v.sd for v in self.values])
        if self.wave is not None:
            own[np.ix_(self.pair, self.pair)] = self.wave.slopes(*self.standard(u)[self.pair])
        return np.asarray(own @ self.root)

    def bound(self, u: Array) -> tuple[str | None, ...]:
        """Which bound each value has reached."""
        z, (low, high) = self.standard(u), self._ends
        return tuple(
            "low" if one <= a + 1e-9 else "high" if one >= b - 1e-9 else None
            for one, a, b in zip(z, low, high, strict=True)
        )

    @property
    def free_ends(self) -> tuple[Array, Array]:
        """Bounds of the independent coordinates of values that go with no others; none of the rest."""
        alone = np.count_nonzero(self.root, axis=0) + np.count_nonzero(self.root, axis=1) == 2
        low, high = self._ends
        return np.where(alone, low, -np.inf), np.where(alone, high, np.inf)

    @property
    def _ends(self) -> tuple[Array, Array]:
        ends = np.array([[to_standard(v, v.low), to_standard(v, v.high)] for v in self.values]).reshape(-1, 2)
        ends[self.pair] = [-np.inf, np.inf]
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
    idle = idle_values(instrument)
    values = tuple(value for value in instrument.uncertain if value.name not in exact and value.name not in idle)
    R = instrument.correlation_of(values)
    known = {value.name: value for value in values}
    told: tuple[float, float] | None = instrument.part("posterior").anisotropy_sd
    wave = (
        WavePrior(known[ANISOTROPY], known[AXIS], told)
        if {ANISOTROPY, AXIS} <= set(known) and known[ANISOTROPY].logarithmic
        else None
    )
    if wave is None or told is None:  # what others have in common with the components is theirs alone
        pair = [k for k, value in enumerate(values) if value.name in (ANISOTROPY, AXIS)]
        R[pair], R[:, pair] = 0.0, 0.0
        R[pair, pair] = 1.0
    low, vectors = np.linalg.eigh(R)
    R = (vectors * np.maximum(low, LEAST)) @ vectors.T
    return Priors(values, np.linalg.cholesky(R), wave)


def check_exact(instrument: "Instrument", exact: Sequence[str]) -> None:
    """Refuse names that are no uncertain values of the card."""
    from studies.errors import InputError, nearest

    known = sorted(value.name for value in instrument.uncertain)
    for name in exact:
        if name not in known:
            raise InputError(f"{instrument.path}: '{name}' is not an uncertain value of the card{nearest(name, known)}")


def idle_values(instrument: "Instrument") -> set[str]:
    """Return the values that say nothing in this card: the parts of a loss budget that it does not use, or what stands for them."""
    parts = instrument.part("loss", "loss_parts")
    whole = {f"loss.{key}" for key in instrument.loss.__struct_fields__}
    return {
        value.name
        for value in instrument.uncertain
        if value.name.startswith("loss.") and (value.name in whole) == bool(parts.given)
    }
