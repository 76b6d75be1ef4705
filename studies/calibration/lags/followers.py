"""How a resonator may follow its housing: by lags, or through a network with named constants."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

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


class Follower(Protocol):
    """A model of the resonator's temperature behind the housing's."""

    @property
    def constants(self) -> tuple[Constant, ...]:
        """The constants to be identified."""

    @property
    def states(self) -> int:
        """Number of temperatures that are unknown at the start of a run."""

    def follow(
        self, constants: Mapping[str, float], departure: Array, time: Array, housing_temperature: Array
    ) -> Array:
        """Temperature of the resonator (K) at every row; `departure` (states,) is from the steady start, in K."""


@dataclass(frozen=True)
class Lags:
    """T_r = Σ w_j T_j with Σ w_j = 1 and τ_j dT_j/dt = T_h − T_j: the modes of any linear network.

    Constants: "time_constant_1" … (s) and, for the second lag and later ones, "weight_2" … . A negative weight is a
    lag in series rather than in parallel.
    """

    constants: tuple[Constant, ...]

    @property
    def states(self) -> int:
        """One for each lag."""
        return sum(constant.name.startswith("time_constant") for constant in self.constants)

    def follow(
        self, constants: Mapping[str, float], departure: Array, time: Array, housing_temperature: Array
    ) -> Array:
        """Sum of the lags; `departure` j decays with lag j."""
        T = np.zeros_like(time)
        first_weight = 1.0 - sum(constants[f"weight_{j}"] for j in range(2, self.states + 1))
        for j in range(1, self.states + 1):
            tau = constants[f"time_constant_{j}"]
            weight = first_weight if j == 1 else constants[f"weight_{j}"]
            T += weight * lag(time, housing_temperature, tau) + departure[j - 1] * np.exp((time[0] - time) / tau)
        return T


def make_lags(*starts: float, shortest: float = 10.0, longest: float = 1e5) -> Lags:
    """Lags with these starting time constants (s), all sharing the weight at first."""
    taus = [Constant(f"time_constant_{j}", tau, shortest, longest) for j, tau in enumerate(starts, 1)]
    weights = [Constant(f"weight_{j}", 1 / len(starts), -5.0, 5.0) for j in range(2, len(starts) + 1)]
    return Lags((*taus, *weights))


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
