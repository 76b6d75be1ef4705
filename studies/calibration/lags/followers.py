"""A resonator behind its housing: lags in series, part of whose heat is radiated."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from thermal.errors import ThermalError
from thermal.lag import lag
from thermal.network import Array

SUBSTEPS = 4  # of a row, between which what radiation adds is linear
MOST_FEEDS = 40
FEED_TOLERANCE = 1e-7  # K


@dataclass(frozen=True)
class Constant:
    """A constant to be identified: its start and bounds; with positive bounds it is fitted in its logarithm."""

    name: str
    start: float
    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low < self.start < self.high:
            raise ThermalError(
                f"the start of '{self.name}', {self.start:g}, must lie between {self.low:g} and {self.high:g}."
            )

    @property
    def is_positive(self) -> bool:
        """Whether the constant is fitted in its logarithm."""
        return self.low > 0


@dataclass(frozen=True)
class LagSeries:
    """Lags in series, part of whose heat is radiated: the end of a chain of lumps.

    τ_j dT_j/dt = (1 − ρ + ρ g_j)(T_{j−1} − T_j), g_j = (T_{j−1} + T_j)(T_{j−1}² + T_j²)/(4 T₀³), T_0 = T_h, T_r the last:
    the exchange σ a (T_{j−1}⁴ − T_j⁴) makes the share ρ of the conductance at T₀. Constants: "time_constant_1" … (s, at
    T₀) and "radiated_share", the same for all.
    """

    constants: tuple[Constant, ...]  # the time constants, then the share
    reference_temperature: float  # T₀, K

    @property
    def states(self) -> int:
        """One for each lag."""
        return len(self.constants) - 1

    def follow(
        self, constants: Mapping[str, float], departure: Array, time: Array, housing_temperature: Array
    ) -> Array:
        """Temperature at the end of the chain; `departure` j is that of its lump j from the housing."""
        fine = np.linspace(time[0], time[-1], SUBSTEPS * (len(time) - 1) + 1)
        drive = np.interp(fine, time, housing_temperature)
        share, cube = constants["radiated_share"], 4 * self.reference_temperature**3
        for j, start in enumerate(departure, 1):
            tau = constants[f"time_constant_{j}"]
            drive = _radiating_lag(fine, drive, tau, share, cube, float(housing_temperature[0] + start))
        return drive[::SUBSTEPS]


def make_series(
    *starts: float, reference_temperature: float = 293.15, shortest: float = 10.0, longest: float = 1e5
) -> LagSeries:
    """Lags in series with these starting time constants (s), a tenth of the heat radiated at first."""
    taus = [Constant(f"time_constant_{j}", tau, shortest, longest) for j, tau in enumerate(starts, 1)]
    return LagSeries((*taus, Constant("radiated_share", 0.1, -0.5, 1.0)), reference_temperature)


def _radiating_lag(time: Array, drive: Array, tau: float, share: float, cube: float, start: float) -> Array:
    """One lump: what radiation adds is fed back to the drive of a linear lag until it no longer changes."""
    T = lag(time, drive, tau, start)
    for _ in range(MOST_FEEDS if share else 0):
        g = (drive + T) * (drive**2 + T**2) / cube
        last, T = T, lag(time, drive + share * (g - 1) * (drive - T), tau, start)
        if np.abs(T - last).max() < FEED_TOLERANCE:
            return T
    return T
