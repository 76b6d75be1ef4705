"""Piezoelectric pick-offs of a bell-shaped gyro and their C–V converter, BVG paper equations (27)–(29).

    F_i = (σ_νν + σ_φφ) d₃₁ S_i (27),    p = ς_p (F₃ + F₇),  q = ς_q (F₄ + F₈) (28)

Charge F_i (C) of element i from the stresses (Pa), its constant d₃₁ (C/N) and area S_i (m²); the converter turns it into
volts over its feedback capacitor. (29) is (26) with p and q from the charges; it is printed for the instant and singular
where ṗ = 0, so amplitudes are used here (`loop.read_rate_from_loop`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.errors import CompensationError
from compensation.loop import BellResonator, read_rate_from_loop
from compensation.motion import demodulate

Real = NDArray[np.float64]


@dataclass(frozen=True)
class PiezoPair:
    """Two opposite elements on one axis: `d31` (C/N), `area` (m²), and `scale` ς (m/C) of eq. (28)."""

    d31: float
    area: float
    scale: float

    def __post_init__(self) -> None:
        if not (self.d31 != 0 and self.area > 0 and self.scale != 0):
            raise CompensationError("a piezo pair needs d31, an area and a scale other than zero.")

    def charge(self, stress_along: ArrayLike, stress_around: ArrayLike) -> Real:
        """Return the charge (C) of one element from the mean stresses σ_νν and σ_φφ (Pa): eq. (27)."""
        return np.asarray((np.asarray(stress_along) + np.asarray(stress_around)) * self.d31 * self.area)

    def displacement(self, first: ArrayLike, second: ArrayLike) -> Real:
        """Return the displacement (m) of the axis from the charges of its two elements: eq. (28)."""
        return np.asarray(self.scale * (np.asarray(first) + np.asarray(second)))


def convert_charge(charge: ArrayLike, feedback: float) -> Real:
    """Return the volts of a charge amplifier with the feedback capacitor C_f (F): V = −F/C_f."""
    if not feedback > 0:
        raise CompensationError(f"the feedback capacitor must be positive, not {feedback:g} F.")
    return np.asarray(-np.asarray(charge, dtype=float) / feedback)


def read_rate_from_charges(
    resonator: BellResonator,
    omega: float,
    time: ArrayLike,
    primary: tuple[PiezoPair, ArrayLike, ArrayLike],
    secondary: tuple[PiezoPair, ArrayLike, ArrayLike],
    force: ArrayLike,
) -> tuple[Real, Real]:
    """Return times (s) and the rate (rad/s) from the charges of elements 3, 7 and 4, 8 and the rebalance force: eq. (29).

    Parameters
    ----------
    resonator : BellResonator
    omega : float
        Carrier frequency (rad/s).
    time : array (N,)
        Even times (s), a whole number per period.
    primary, secondary : PiezoPair and the charges (C) of its two elements, arrays (N,)
    force : array (N,)
        f_q (N) at these times.
    """
    at, P = demodulate(time, primary[0].displacement(*primary[1:]), omega)
    _, Q = demodulate(time, secondary[0].displacement(*secondary[1:]), omega)
    _, F = demodulate(time, force, omega)
    return at, read_rate_from_loop(resonator, omega, at, P, Q, F)
