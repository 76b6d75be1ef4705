"""Angular rate from the control loop of a bell-shaped gyro, BVG paper equations (23)–(26).

    m₀ p̈ − 2 Ω b q̇ + c₀ p + c₁ q = f_p,    m₀ q̈ + 2 Ω b ṗ + c₀ q + c₁ p = f_q                  (23)

The copy of the paper prints (24)–(26) with ω_n² q̇ where (23) gives ω_n² q, and with f_q for f_q / m₀: here they are
derived from (23) anew. With k = b / (2 m₀), eq. (21), the second equation gives

    Ω = [ f_q / m₀ − q̈ − ω_n² q − (c₁/m₀) p ] / (4 k ṗ),

and the first its second form, with p and q exchanged. Each is singular wherever ṗ (or q̇) passes zero, so they are taken for the
amplitudes of p = Im{P e^{jωt}}. The coupling c₁ then stands in quadrature to the rate and drops out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.samples import check_time, read_columns


@dataclass(frozen=True)
class BellResonator:
    """Constants of eq. (23): modal mass m0 (kg), gyroscopic b (kg), stiffness c0 and its imperfection c1 (N/m)."""

    m0: float
    b: float
    c0: float
    c1: float = 0.0

    def __post_init__(self) -> None:
        if not (self.m0 > 0 and self.c0 > 0 and self.b != 0):
            raise CompensationError("eq. (23) needs a positive modal mass and stiffness, and b other than zero.")

    @property
    def precession_factor(self) -> float:
        """K = b / (2 m₀): eq. (21)."""
        return self.b / (2 * self.m0)

    @property
    def omega(self) -> float:
        """ω_n = √(c₀/m₀) (rad/s): eq. (22)."""
        return float(np.sqrt(self.c0 / self.m0))


def read_rate_from_loop(
    resonator: BellResonator, omega: float, time: ArrayLike, p: ArrayLike, q: ArrayLike, force: ArrayLike | None = None
) -> Array:
    """Return the rate (rad/s) from the amplitudes of both axes and of the rebalance force, (24)–(26); without force open loop, (25).

    Ω = Re{ [F/m₀ − (c₁/m₀) P − (ω_n² − ω²) Q − 2jω Q̇] / (4 k jω P) }; Q̈ is neglected against ω Q̇.
    """
    P, Q = np.asarray(p, dtype=complex), np.asarray(q, dtype=complex)
    F = np.zeros_like(P) if force is None else np.asarray(force, dtype=complex)
    (t, *_) = read_columns(time=time, p=np.abs(P), q=np.abs(Q), force=np.abs(F))
    check_time(t)
    if np.any(P == 0):
        raise CompensationError("the driven axis p does not vibrate; without its amplitude there is no rate.")
    r = resonator
    growth = 2j * omega * np.gradient(Q, t, edge_order=2 if len(t) > 2 else 1)
    numerator = F / r.m0 - r.c1 / r.m0 * P - (r.omega**2 - omega**2) * Q - growth
    return np.asarray((numerator / (4 * r.precession_factor * 1j * omega * P)).real, dtype=float)


def read_rate_from_drive(
    resonator: BellResonator, omega: float, time: ArrayLike, p: ArrayLike, q: ArrayLike, force: ArrayLike
) -> Array:
    """Return the rate (rad/s) from the force on the driven axis: second form of eq. (24).

    The first of (23) gives Ω = [p̈ + ω_n² p + (c₁/m₀) q − f_p/m₀] / (4 k q̇); for amplitudes
    Ω = Re{ [(ω_n² − ω²) P + 2jω Ṗ + (c₁/m₀) Q − F/m₀] / (4 k jω Q) }. It needs an axis q that moves: open loop.
    """
    r = resonator
    if np.any(np.asarray(q) == 0):
        raise CompensationError("the axis q does not vibrate: where the loop holds q at rest, the rate cannot be found from the drive force.")  # fmt: skip
    # (23) is the same for the two axes exchanged and the rate reversed
    return -read_rate_from_loop(r, omega, time, q, p, force)


def scale_of_rebalance(resonator: BellResonator, omega: float, amplitude: float) -> float:
    """K of Ω = K A_q, rad/s per newton of rebalance amplitude: 1 / (4 k m₀ ω P), BVG paper eq. (30)."""
    return 1 / (4 * resonator.precession_factor * resonator.m0 * omega * amplitude)
