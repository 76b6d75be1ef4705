"""What one run goes through on an even time grid, and the operators with memory that act on it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from compensation.arrays import Array
from compensation.memory import follow_lag, follow_play


@dataclass(frozen=True)
class Lags:
    """How the resonator takes up a change of its housing, and heat in its shell: the modes of its heat path, y = Σ w lag(x; τ), both of Σ w = 1."""

    times: tuple[float, ...]  # s, the slowest first
    housing: tuple[float, ...]
    heat: tuple[float, ...]

    @classmethod
    def one(cls, tau: float) -> "Lags":
        """Return a single lag."""
        return cls((tau,), (1.0,), (1.0,))

    def follow(self, values: Array, step: float, weights: Sequence[float]) -> Array:
        """Return what follows values in the modes."""
        parts = (w * lag(values, step, tau) for w, tau in zip(weights, self.times, strict=True) if w)
        return np.asarray(sum(parts))


@dataclass(frozen=True)
class States:
    """The drives and the thermal state of one run on an even time grid."""

    run: int  # number of the run in its campaign, from 0
    time: Array  # (N,) array: Seconds since the start of the run, evenly spaced
    campaign_time: Array  # (N,) array: Seconds since the start of the first run
    housing: Array  # (N,) array: Temperature that drives the resonator (housing sensor, else chamber), K
    # (N,) array: Temperature of the resonator, K: the housing's behind its lags, unless something better is known.
    resonator: Array
    lags: Lags
    reference: float  # temperature from which polynomials count, K
    # amplitude_squared, voltage_squared, quadrature, pattern_angle: (N,) array or None: Square of the drive amplitude
    # and of the electrode bias, V²; quadrature control, V; azimuth, rad.
    amplitude_squared: Array | None = None
    voltage_squared: Array | None = None
    quadrature: Array | None = None
    pattern_angle: Array | None = None
    # (K,) array or None: Temperatures at which the resonator turned in the runs before, K: all that a loop may remember
    # of them.
    before: Array | None = None
    # (N,) array or None: Rate of the resonator temperature, K/s, where a simulation knows it.
    known_rate: Array | None = None

    @property
    def tau(self) -> float:
        """Slowest time constant of the resonator behind its housing, s."""
        return self.lags.times[0]

    def behind(self, housing: Array) -> Array:
        """Return what the resonator makes of (a part of) the housing's temperature."""
        return self.lags.follow(housing, self.step, self.lags.housing)

    def heated(self, power: Array) -> Array:
        """Return what it makes of heat in its shell, in units of what that settles at."""
        return self.lags.follow(power, self.step, self.lags.heat)

    @property
    def step(self) -> float:
        """Time step of the grid, s."""
        return float(self.time[1] - self.time[0]) if self.time.size > 1 else 1.0

    @property
    def excess(self) -> Array:
        """Resonator temperature minus the reference, K."""
        return self.resonator - self.reference

    @property
    def rate(self) -> Array:
        """Rate of the resonator temperature, K/s: as it is known, else differences of the samples."""
        if self.known_rate is not None:
            return self.known_rate
        if self.time.size < 2:
            return np.zeros_like(self.time)
        return np.asarray(np.gradient(self.resonator, self.step))

    def warmed(self, warming: Array) -> "States":
        """Return them with a resonator that is warmer (K)."""
        rate = None if self.known_rate is None else self.known_rate + np.gradient(warming, self.step)
        return replace(self, resonator=self.resonator + warming, known_rate=rate)


def remembered(runs: Sequence[States]) -> list[Array]:
    """Return, for every run, the temperatures at which the resonator turned in the runs before it, K."""
    past, out = np.empty(0), [np.empty(0)] * len(runs)
    for k in sorted(range(len(runs)), key=lambda k: float(runs[k].campaign_time[0])):
        out[k], t = past, runs[k].resonator
        turns = np.flatnonzero((t[1:-1] - t[:-2]) * (t[2:] - t[1:-1]) < 0.0) + 1
        past = np.concatenate([past, t[:1], t[turns], t[-1:]])
    return out


lag, play = follow_lag, follow_play

ORDERS = 12  # a knee of a tenth of the range is followed, fringes of a sixth of it are not


def waves(x: Array, low: float, high: float, orders: int = ORDERS) -> Array:
    """Return cos(k π u), k = 2 … orders, of u = (x − low)/(high − low) held to the range: (N, orders − 1)."""
    u = np.clip((x - low) / max(high - low, 1e-9), 0.0, 1.0)
    return np.asarray(np.cos(np.pi * u[:, None] * np.arange(2, orders + 1)))


def smoothness(size: float, orders: int = ORDERS) -> tuple[float, ...]:
    """Return prior standard deviations of the waves, falling as k⁻²: the curve has a slope, and finite bends."""
    return tuple(float(size * (2.0 / k) ** 2) for k in range(2, orders + 1))
