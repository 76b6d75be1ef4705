"""What one run goes through on an even time grid, and the operators with memory that act on it."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from compensation.arrays import Array
from compensation.transfer import recur

FloatArray = Array


@dataclass(frozen=True)
class States:
    """The drives and the thermal state of one run on an even time grid."""

    run: int  # number of the run in its campaign, from 0
    time: FloatArray  # (N,) array: Seconds since the start of the run, evenly spaced
    campaign_time: FloatArray  # (N,) array: Seconds since the start of the first run
    housing: FloatArray  # (N,) array: Temperature that drives the resonator (housing sensor, else chamber), K
    # (N,) array: Temperature of the resonator, K: the housing's through one lag `tau`, unless something better is
    # known.
    resonator: FloatArray
    tau: float  # time constant of that lag, s
    reference: float  # temperature from which polynomials count, K
    # amplitude_squared, voltage_squared, quadrature, pattern_angle: (N,) array or None: Square of the drive amplitude
    # and of the electrode bias, V²; quadrature control, V; azimuth, rad.
    amplitude_squared: FloatArray | None = None
    voltage_squared: FloatArray | None = None
    quadrature: FloatArray | None = None
    pattern_angle: FloatArray | None = None
    # (K,) array or None: Temperatures at which the resonator turned in the runs before, K: all that a loop may remember
    # of them.
    before: FloatArray | None = None
    # (N,) array or None: Rate of the resonator temperature, K/s, where a simulation knows it.
    known_rate: FloatArray | None = None

    @property
    def step(self) -> float:
        """Time step of the grid, s."""
        return float(self.time[1] - self.time[0]) if self.time.size > 1 else 1.0

    @property
    def excess(self) -> FloatArray:
        """Resonator temperature minus the reference, K."""
        return self.resonator - self.reference

    @property
    def rate(self) -> FloatArray:
        """Rate of the resonator temperature, K/s: as it is known, else differences of the samples."""
        if self.known_rate is not None:
            return self.known_rate
        if self.time.size < 2:
            return np.zeros_like(self.time)
        return np.asarray(np.gradient(self.resonator, self.step))

    def warmed(self, warming: FloatArray) -> "States":
        """Return them with a resonator that is warmer (K)."""
        rate = None if self.known_rate is None else self.known_rate + np.gradient(warming, self.step)
        return replace(self, resonator=self.resonator + warming, known_rate=rate)


def remembered(runs: Sequence[States]) -> list[FloatArray]:
    """Return, for every run, the temperatures at which the resonator turned in the runs before it, K."""
    past, out = np.empty(0), [np.empty(0)] * len(runs)
    for k in sorted(range(len(runs)), key=lambda k: float(runs[k].campaign_time[0])):
        out[k], t = past, runs[k].resonator
        turns = np.flatnonzero((t[1:-1] - t[:-2]) * (t[2:] - t[1:-1]) < 0.0) + 1
        past = np.concatenate([past, t[:1], t[turns], t[-1:]])
    return out


def lag(drive: FloatArray, step: float, tau: float, start: float | None = None) -> FloatArray:
    """Return the response of a first-order lag, τ y′ = u − y, to drives (N,) or (N, m) linear between samples; settled at first, or from a value."""
    ratio = step / tau
    decay = np.exp(-ratio)
    ramp = -np.expm1(-ratio) / ratio if ratio > 1e-12 else 1.0
    ahead, behind = 1.0 - ramp, ramp - decay
    first = drive[:1] if start is None else np.full_like(drive[:1], start)
    return recur(decay, np.concatenate([first, ahead * drive[1:] + behind * drive[:-1]]))


def play(drive: FloatArray, radius: float | Sequence[float], start: float = 0.0) -> FloatArray:
    """Return the play (backlash) operator, the elementary rate-independent hysteresis, of one half width or of several, (N, R).

    p_k = min(u_k + r, max(u_k − r, p_{k−1})), with p_0 = u_0 + start · r: each rising or falling branch is done at once.
    """
    radii = np.atleast_1d(np.asarray(radius, dtype=float))
    out = np.empty((drive.size, radii.size))
    state = drive[0] + start * radii
    rising = np.diff(drive) >= 0.0
    turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    out[0] = state
    for begin, end in itertools.pairwise([0, *turns.tolist(), rising.size]):
        if end > begin:
            branch = drive[begin + 1 : end + 1, None]
            up = bool(rising[begin])
            out[begin + 1 : end + 1] = np.maximum(branch - radii, state) if up else np.minimum(branch + radii, state)
            state = out[end]
    return out[:, 0] if np.ndim(radius) == 0 else out


ORDERS = 12  # a knee of a tenth of the range is followed, fringes of a sixth of it are not


def waves(x: FloatArray, low: float, high: float, orders: int = ORDERS) -> FloatArray:
    """Return cos(k π u), k = 2 … orders, of u = (x − low)/(high − low) held to the range: (N, orders − 1)."""
    u = np.clip((x - low) / max(high - low, 1e-9), 0.0, 1.0)
    return np.asarray(np.cos(np.pi * u[:, None] * np.arange(2, orders + 1)))


def smoothness(size: float, orders: int = ORDERS) -> tuple[float, ...]:
    """Return prior standard deviations of the waves, falling as k⁻²: the curve has a slope, and finite bends."""
    return tuple(float(size * (2.0 / k) ** 2) for k in range(2, orders + 1))
