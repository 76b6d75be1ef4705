"""The four loops of a shell gyro, their gains from the bandwidths, and their stability margins.

GA holds the amplitude, GF the phase (the frequency of the numerically controlled oscillator), GR the rate force that
keeps the node at rest, GQ the quadrature (BVG paper, section 3.2 and figure 8). Each is sampled: the demodulated signal
passes a one-pole low pass and a PI controller, the command is held for one sample and comes late by the delay:

    y ← y + α (x − y), α = 1 − e^{−2π f_d T};   u = −(K y + I);   I ← I + K_i T y

on a plant ẋ = −x/τ + u (1/τ = 0 for the phase).
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.errors import CompensationError

CORNER = 0.25  # corner of the integral part over the bandwidth: 14° of phase margin for it
LEAST_BANDWIDTH = 1e-3


@dataclass(frozen=True)
class Loops:
    """Bandwidths (Hz, where the open loop has gain 1) of the four loops; `sampling` and `demodulator` (Hz), `delay` (s) of the force."""

    amplitude: float = 1.0
    phase: float = 10.0
    rate: float = 10.0
    quadrature: float = 5.0
    sampling: float = 1000.0
    delay: float = 1e-3
    demodulator: float = 200.0

    NAMES: ClassVar[tuple[str, ...]] = ("amplitude", "phase", "rate", "quadrature")
    PAPER: ClassVar[dict[str, str]] = {"amplitude": "GA", "phase": "GF", "rate": "GR", "quadrature": "GQ"}

    def __post_init__(self) -> None:
        for name in (*self.NAMES, "sampling", "demodulator"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise CompensationError(f"the {name} of the loops must be a positive frequency in Hz.")
        if not 0 <= self.delay < 1:
            raise CompensationError(f"the delay of the loops must lie between 0 and 1 s, not {self.delay:g}.")
        for name in self.NAMES:
            if not getattr(self, name) < self.sampling / 2:
                raise CompensationError(f"the {name} loop's {getattr(self, name):g} Hz is not below half the sampling rate.")  # fmt: skip

    @property
    def step(self) -> float:
        """Sampling interval T (s)."""
        return 1 / self.sampling

    @property
    def smoothing(self) -> float:
        """α of the low pass."""
        return float(1 - np.exp(-2 * np.pi * self.demodulator / self.sampling))

    @property
    def late(self) -> tuple[int, float]:
        """The delay as whole samples m and the rest r (s), 0 ≤ r < T."""
        whole = int(self.delay * self.sampling * (1 + 1e-12))
        return whole, max(self.delay - whole / self.sampling, 0.0)

    def gains(self, loop: str) -> tuple[float, float]:
        """K (1/s) and K_i (1/s²) of one loop: K = 2π f_b/√(1 + c²), K_i = K · 2π f_b c, c the corner over f_b."""
        crossover = 2 * np.pi * getattr(self, loop)
        proportional = crossover / np.hypot(1.0, CORNER)
        return float(proportional), float(proportional * crossover * CORNER)

    def open_loop(self, loop: str, decay: float, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Return the sampled loop gain L(e^{jωT}) of one loop at frequencies (Hz); `decay` is 1/τ (1/s)."""
        T, (whole, rest) = self.step, self.late
        z = np.exp(2j * np.pi * np.asarray(frequency, dtype=float) * T)
        d = 0.0 if loop == "phase" else decay
        now, late = held(d, T - rest), np.exp(-d * (T - rest)) * held(d, rest)
        plant = (now + late / z) / (z - np.exp(-d * T)) * z ** (-whole)
        K, K_i = self.gains(loop)
        a = self.smoothing
        low_pass = a * z / (z - (1 - a))
        return np.asarray(plant * low_pass * (K + K_i * T / (z - 1)))


@dataclass(frozen=True)
class Margin:
    """Margins of one loop: `phase` (rad) at `crossover` (Hz), `gain` (1) at `reversal` (Hz) where the phase is −180°."""

    loop: str
    crossover: float
    phase: float
    gain: float
    reversal: float

    @property
    def stable(self) -> bool:
        """The loop is stable: both margins are on the right side."""
        return self.gain > 1 and self.phase > 0


def find_margins(loops: Loops, decay: float, names: tuple[str, ...] = Loops.NAMES) -> tuple[Margin, ...]:
    """Return the margins of the loops for a wave of decay 1/τ (1/s)."""
    return tuple(_margin(loops, name, decay) for name in names)


def require_stable(loops: Loops, decay: float, names: tuple[str, ...] = Loops.NAMES) -> tuple[Margin, ...]:
    """Return the margins, or raise naming the unstable loop, its margins and a bandwidth that is stable."""
    margins = find_margins(loops, decay, names)
    for margin in margins:
        if not margin.stable:
            most: float = getattr(loops, margin.loop)
            while most > LEAST_BANDWIDTH:  # to a gain margin of 6 dB and a phase margin of 45°
                most /= 1.2
                calm = _margin(replace(loops, **{margin.loop: most}), margin.loop, decay)
                if calm.gain >= 2 and calm.phase >= np.pi / 4:
                    break
            raise CompensationError(
                f"the {margin.loop} loop ({Loops.PAPER[margin.loop]}) is unstable: gain margin {20 * np.log10(margin.gain):.1f} dB at {margin.reversal:.3g} Hz, phase margin"
                f" {np.degrees(margin.phase):.0f}° at {margin.crossover:.3g} Hz; lower its bandwidth to about {most:.2g} Hz, shorten the delay or sample faster."
            )
    return margins


def held(decay: float, time: float) -> float:
    """∫₀ᵗ e^{−ds} ds."""
    return time if decay == 0 else float(-np.expm1(-decay * time) / decay)


def _margin(loops: Loops, name: str, decay: float) -> Margin:
    half = loops.sampling / 2
    grid = np.geomspace(min(1e-4 * half, getattr(loops, name) / 300), half * (1 - 1e-9), 4000)
    L = loops.open_loop(name, decay, grid)
    angle = np.unwrap(np.angle(L))
    angle -= 2 * np.pi * np.round((angle[0] + np.pi / 2) / (2 * np.pi))  # starts between −180° and 0

    from scipy.optimize import brentq

    def level(f: float) -> float:
        return float(np.log(np.abs(loops.open_loop(name, decay, f))))

    size = np.log(np.abs(L))
    falling = np.flatnonzero((size[:-1] > 0) & (size[1:] <= 0))
    crossover = brentq(level, grid[falling[-1]], grid[falling[-1] + 1]) if len(falling) else float(grid[-1])
    phase = float(np.interp(crossover, grid, angle) + np.pi)
    reversing = np.flatnonzero((angle[:-1] > -np.pi) & (angle[1:] <= -np.pi))
    reversal = (
        float(np.interp(-np.pi, angle[[reversing[0] + 1, reversing[0]]], grid[[reversing[0] + 1, reversing[0]]]))
        if len(reversing)
        else half
    )
    gain = float(1 / np.abs(loops.open_loop(name, decay, reversal * (1 - 1e-12))))
    return Margin(name, float(crossover), phase, gain, reversal)
