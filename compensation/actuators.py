"""Actuators of a gyro: the largest forces and stiffness that its electrodes give, and the part that the loops use.

Limits are over 2ω and the commanded amplitude (1/s). Rate and quadrature share one pair of electrodes as √(rate² +
quadrature²), unless a stiffness κ nulls the quadrature, Ẋ ∋ iκ Y and Ẏ ∋ iκ X (HRG paper), which no phase error turns into rate.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError

NEAR = 0.9  # part of a limit from which a row of the record is followed sample by sample


@dataclass(frozen=True)
class RangeUse:
    """Parts of their limits that rate, quadrature and drive use (1): numbers, or one per row."""

    rate: Array
    quadrature: Array
    drive: Array
    shared: bool

    @property
    def across(self) -> Array:
        """Part of the force across the wave: of rate and, where it is a force, quadrature together."""
        return np.hypot(self.rate, self.quadrature) if self.shared else self.rate

    @property
    def worst(self) -> float:
        """The largest part of any limit."""
        return float(max(np.max(x) for x in (self.across, self.quadrature, self.drive)))


@dataclass(frozen=True)
class Actuators:
    """Limits of the actuators, 1/s."""

    force: float = np.inf  # of the force across the wave
    drive: float = np.inf  # of the force along it, which holds the amplitude
    stiffness: float = np.inf  # of the stiffness that nulls quadrature, κ = ½ Δω
    quadrature: Literal["force", "stiffness"] = "force"  # "force" or "stiffness", what the quadrature loop commands

    def __post_init__(self) -> None:
        for name in ("force", "drive", "stiffness"):
            if not getattr(self, name) > 0:
                raise CompensationError(f"the limit of the {name} must be positive.")

    @property
    def stiff(self) -> bool:
        """Quadrature is nulled by a stiffness."""
        return self.quadrature == "stiffness"

    @property
    def finite(self) -> bool:
        """There is a limit at all."""
        return bool(np.isfinite([self.force, self.drive, *([self.stiffness] if self.stiff else [])]).any())

    def use(self, rate: ArrayLike, quadrature: ArrayLike, drive: ArrayLike) -> RangeUse:
        """Return the parts of the limits that commands (1/s) use."""
        holds = self.stiffness if self.stiff else self.force

        def part(command: ArrayLike, limit: float) -> Array:
            return np.asarray(np.abs(command) / limit, dtype=float)

        return RangeUse(part(rate, self.force), part(quadrature, holds), part(drive, self.drive), not self.stiff)

    def give(self, command: Array) -> Array:
        """Return what is given of commands (amplitude, phase, rate, quadrature): a force across keeps its direction in phase."""
        amplitude, phase, rate, quadrature = command
        amplitude = min(max(amplitude, -self.drive), self.drive)
        if self.stiff:
            rate = min(max(rate, -self.force), self.force)
            quadrature = min(max(quadrature, -self.stiffness), self.stiffness)
        elif (size := float(np.hypot(rate, quadrature))) > self.force:
            rate, quadrature = rate * self.force / size, quadrature * self.force / size
        return np.array([amplitude, phase, rate, quadrature])

    def is_near(self, commands: Array) -> bool:
        """Whether any of the commands (N, 4) is near a limit."""
        return self.use(commands[:, 2], commands[:, 3], commands[:, 0]).worst > NEAR


UNLIMITED = Actuators()  # forces without limits, for quadrature too


def require_range(use: RangeUse, context: str) -> None:
    """Raise if settled loops would exceed the limits of the actuators."""
    if use.worst > 1:
        raise CompensationError(
            f"{context}: the loops need {100 * use.worst:.0f} % of the actuators' range (rate {100 * float(np.max(use.rate)):.3g} %,"
            f" quadrature {100 * float(np.max(use.quadrature)):.3g} %, drive {100 * float(np.max(use.drive)):.3g} % of their ranges); the wave cannot be held."
        )
