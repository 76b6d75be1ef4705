"""Zero-rate output and loss of a virtual gyro from the tables `[bias]` and `[loss]` of its card.

[loss]                             # every key may be left out
inverse_q = 1e-7                   # at the reference temperature
slope_per_K = 4e-3                 # relative
curvature_per_K2 = 0.0             # relative

[bias]                             # every key may be left out
offset_deg_per_h = 0.0
damping_anisotropy = 0.01          # Δ(1/τ) over the mean 1/τ = π f/Q
damping_axis_deg = 0.0             # θ_τ
pattern_angle_deg = 22.5           # θ of the standing wave
k1_deg_per_h_per_Hz, k2_…_per_Hz2, k3_…_per_Hz3                    # HRG paper eqs. (21), (22), with f the change of
k4_deg_per_h_s_per_Hz, k5_…_s2_per_Hz2, k6_…_s3_per_Hz3            # frequency from the reference temperature and
k7_deg_per_h_s_per_Hz2, k8_…_s_per_Hz3, k9_…_s2_per_Hz3            # its rate; all 0 unless given
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.files.toml import Section

Array = NDArray[np.float64]
DEG_PER_H = np.degrees(1.0) * 3600.0  # of 1 rad/s
TERMS = {
    # key: powers of f and of its rate (HRG paper eq. 21)
    "k1_deg_per_h_per_Hz": (1, 0),
    "k2_deg_per_h_per_Hz2": (2, 0),
    "k3_deg_per_h_per_Hz3": (3, 0),
    "k4_deg_per_h_s_per_Hz": (0, 1),
    "k5_deg_per_h_s2_per_Hz2": (0, 2),
    "k6_deg_per_h_s3_per_Hz3": (0, 3),
    "k7_deg_per_h_s_per_Hz2": (1, 1),
    "k8_deg_per_h_s_per_Hz3": (2, 1),
    "k9_deg_per_h_s2_per_Hz3": (1, 2),
}
BIAS_KEYS = ("offset_deg_per_h", "damping_anisotropy", "damping_axis_deg", "pattern_angle_deg", *TERMS)
LOSS_KEYS = ("inverse_q", "slope_per_K", "curvature_per_K2")


@dataclass(frozen=True)
class LossModel:
    """1/Q = q₀ (1 + a x + b x²), x = T − T_ref (K)."""

    inverse_q: float
    slope: float
    curvature: float

    def at(self, excess: Array) -> Array:
        """1/Q at temperatures above the reference (K)."""
        return np.asarray(self.inverse_q * (1 + excess * (self.slope + self.curvature * excess)))


@dataclass(frozen=True)
class BiasModel:
    """Zero-rate output in deg/h: offset, damping anisotropy, and the paper's polynomial in f and its rate."""

    offset: float
    anisotropy: float
    damping_axis: float
    pattern_angle: float
    terms: Mapping[tuple[int, int], float]

    def at(
        self, change: Array, rate: Array, frequency: Array, inverse_q: Array, bryan_factor: float, harmonic: int = 2
    ) -> Array:
        """Zero-rate output (deg/h).

        B = Δ(1/τ) sin 2n(θ − θ_τ) / (2 n k) (averaged equations of Lynch 1995), 1/τ = π f/Q, plus Σ k fⁱ ḟʲ.

        Parameters
        ----------
        change, rate : arrays (N,), Hz and Hz/s
        frequency, inverse_q : arrays (N,), Hz and 1
        """
        angle = 2 * harmonic * (self.pattern_angle - self.damping_axis)
        spread = self.anisotropy * np.pi * frequency * inverse_q
        bias = self.offset + DEG_PER_H * spread * np.sin(angle) / (2 * harmonic * bryan_factor)
        for (power, rate_power), coefficient in self.terms.items():
            bias = bias + coefficient * change**power * rate**rate_power
        return np.asarray(bias)


def read_loss(table: Mapping[str, Any], where: str) -> LossModel:
    """Read a `[loss]` table."""
    section = Section(table, where, LOSS_KEYS)
    return LossModel(
        section.number("inverse_q", 1e-7, above=0.0),
        section.number("slope_per_K", 4e-3),
        section.number("curvature_per_K2", 0.0),
    )


def read_bias(table: Mapping[str, Any], where: str) -> BiasModel:
    """Read a `[bias]` table."""
    section = Section(table, where, BIAS_KEYS)
    return BiasModel(
        offset=section.number("offset_deg_per_h", 0.0),
        anisotropy=section.number("damping_anisotropy", 0.01, least=0.0),
        damping_axis=np.radians(section.number("damping_axis_deg", 0.0)),
        pattern_angle=np.radians(section.number("pattern_angle_deg", 22.5)),
        terms={powers: section.number(key) for key, powers in TERMS.items() if key in section},
    )
