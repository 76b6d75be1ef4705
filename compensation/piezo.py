"""Piezo elements of the bell-shaped gyro: BVG paper eqs. (27)–(29), from the motion of the wall to charge, voltage and rate.

Eight elements stand evenly around the cylinder, element i at (i − 1) · 45°. Their faces lie in the plane of the wall, so that
d₃₁ collects the two stresses *in* it,

    F_i = d₃₁ S (σ_θθ + σ_φφ),    σ_θθ + σ_φφ = Σ (p cos nθ + q sin nθ).

The copy of (27) prints σ_νν + σ_φφ: the stress across a free wall is zero, and σ_φφ alone is ν/(1 + ν) of the sum on a cylinder that
bends around (23 % for ν = 0.3). What drives is reciprocal to what senses: a voltage V gives the patterns the force e_i V, with
e_i = ∂F_i/∂p or ∂F_i/∂q.

Section 2.2 of the paper senses q with elements 2 and 6 and drives it with 4 and 8; section 3.2 and (27), (28) sense with 4 and 8 and
drive with 2 and 6. (28) is followed here. The other choice changes the sign of q and of its force, and no rate.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.errors import CompensationError

COUNT = 8
DRIVE_P, SENSE_P, DRIVE_Q, SENSE_Q = (1, 5), (3, 7), (2, 6), (4, 8)
"""Elements of the two axes, section 3.2 of the paper."""


@dataclass(frozen=True)
class PiezoRing:
    """Eight equal elements on the wall."""

    # Σ = σ_θθ + σ_φφ of the wall under the elements per displacement of the pattern (Pa/m), at its antinode
    stress: float
    d31: float  # piezoelectric constant (C/N)
    area: float  # area S of one element (m²)
    arc: float  # angle that one element covers (rad); its charge is the mean over it
    capacitance: float  # feedback of the charge amplifiers (F): they give V = −F/C
    harmonic: int = 2

    def __post_init__(self) -> None:
        if not (self.area > 0 and self.capacitance > 0 and 0 < self.arc <= 2 * np.pi / COUNT):
            raise CompensationError("piezo elements need a positive area and capacitance, and an arc of 45° at most: there are eight of them.")  # fmt: skip
        if not self.stress * self.d31:
            raise CompensationError("piezo elements need a stress of the wall and a d31 other than zero.")

    @property
    def coupling(self) -> Array:
        """E (8, 2), C/m and N/V: charge of each element per p and q, and force on p and q per volt on it."""
        azimuth = self.harmonic * 2 * np.pi / COUNT * np.arange(COUNT)
        mean = np.sinc(self.harmonic * self.arc / (2 * np.pi))  # of cos nθ over the arc
        size = self.d31 * self.area * self.stress * mean
        return np.asarray(size * np.column_stack([np.cos(azimuth), np.sin(azimuth)]))

    def charges(self, p: ArrayLike, q: ArrayLike) -> NDArray[np.generic]:
        """Return F_i (8, ...) of displacements or amplitudes p and q (m): eq. (27)."""
        return np.tensordot(self.coupling, np.stack([np.asarray(p), np.asarray(q)]), 1)

    def voltages(self, charges: ArrayLike) -> NDArray[np.generic]:
        """Return what the charge amplifiers give, −F/C (V)."""
        return -np.asarray(charges) / self.capacitance

    @property
    def scales(self) -> tuple[float, float]:
        """ς_p and ς_q of eq. (28), metres per volt of the two elements' sum."""
        e = self.coupling
        return tuple(
            -self.capacitance / float(sum(e[i - 1, axis] for i in pair)) for axis, pair in enumerate((SENSE_P, SENSE_Q))
        )  # type: ignore[return-value]

    def displacements(self, voltages: ArrayLike) -> tuple[NDArray[np.generic], NDArray[np.generic]]:
        """Return p and q (m) from the voltages (8, ...) of all amplifiers: eq. (28)."""
        V = np.asarray(voltages)
        p, q = (gain * sum(V[i - 1] for i in pair) for gain, pair in zip(self.scales, (SENSE_P, SENSE_Q), strict=True))
        return p, q

    def forces(self, voltages: ArrayLike) -> Array:
        """Return f_p and f_q (2, ...), N, of voltages (8, ...) on the elements."""
        return np.asarray(np.tensordot(self.coupling.T, np.asarray(voltages), 1))
