"""Start-up of the primary vibration: acquisition under a limited drive."""

import cmath
import math
from collections import deque
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.controllers import Loops, require_stable
from compensation.errors import CompensationError

LOCKED = math.radians(5.0)
SETTLED = 0.01
NOTHING = 1e-4  # amplitude at the start, over the command
MOST_STEPS = 200_000


@dataclass(frozen=True)
class StartUp:
    """Course of a start: `amplitude` over the command, `phase_error` (rad), `offset` (rad/s); `locked` within 5°, `ready` within 1 % (s)."""

    time: Array
    amplitude: Array
    phase_error: Array
    offset: Array
    locked: float
    ready: float


@lru_cache(maxsize=32)
def start_up(tau: float, loops: Loops, *, headroom: float = 20.0, offset: float = 0.0) -> StartUp:
    """Start the vibration from almost nothing, a quarter cycle off: nothing is linearised here.

    Ż = −Z/τ − i (ν − ω + ω_n) Z + u, the drive u at most `headroom` times what holds the amplitude.
    """
    if not headroom > 1:
        raise CompensationError(f"the drive reaches {headroom:g} of the commanded amplitude; it must exceed 1.")
    require_stable(loops, 1 / tau, ("amplitude", "phase"))
    least = tau * math.log(headroom / (headroom - 1))
    seconds = 3 * least + 20 / loops.phase + 10 / loops.amplitude
    T = max(loops.step, seconds / MOST_STEPS)
    slow = replace(loops, sampling=1 / T, demodulator=min(loops.demodulator, 1 / T))
    require_stable(slow, 1 / tau, ("amplitude", "phase"))
    (K_a, I_a), (K_p, I_p) = slow.gains("amplitude"), slow.gains("phase")
    most, smoothing, (late, rest) = headroom / tau, slow.smoothing, slow.late
    course = []
    Z = seen = 1j * NOTHING
    drive_integral = phase_integral = 0.0
    waiting = deque([(0.0, 0.0)] * (late + (rest > 0) + 1))
    for _ in range(math.ceil(seconds / T)):
        u, nu = waiting.popleft()
        rate = complex(-1 / tau, offset - nu)
        grown = cmath.exp(rate * T)
        Z = Z * grown + u * (grown - 1) / rate
        seen += smoothing * (Z - seen)
        size, phase = abs(seen), math.atan2(seen.imag, seen.real)
        wanted = K_a * (1 - size) + drive_integral
        given = 0.0 if wanted < 0 else most if wanted > most else wanted
        if wanted == given:  # the integral waits while the drive is at its limit
            drive_integral += I_a * T * (1 - size)
        nu = K_p * phase + phase_integral
        phase_integral += I_p * T * phase
        waiting.append((given, nu))
        course.append((abs(Z), phase, nu))
    size, phase, nu = np.array(course).T
    time = np.asarray(T * np.arange(1, len(size) + 1), dtype=float)
    locked, ready = _since(time, np.abs(phase) < LOCKED), _since(time, np.abs(size - 1) < SETTLED)
    return StartUp(time, size, phase, nu, locked, ready)


def _since(time: Array, holds: NDArray[np.bool_]) -> float:
    """Return the time from which a condition holds to the end; NaN when it does not hold there."""
    broken = np.flatnonzero(~holds)
    if not len(broken):
        return float(time[0])
    return float(time[broken[-1] + 1]) if broken[-1] + 1 < len(time) else math.nan
