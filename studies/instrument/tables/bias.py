"""`[bias]`: the zero-rate output of the gyro (HRG paper eqs. 21, 22)."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, Note, number

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


class Bias(Keys, frozen=True, kw_only=True):
    """Zero-rate output: offset, damping anisotropy, and the paper's polynomial in f and its rate."""

    offset_deg_per_h: Annotated[float, number("at the reference temperature", sd=10.0)] = 0.0
    damping_anisotropy: Annotated[float, number("Δ(1/τ) over the mean 1/τ = π f/Q", least=0.0, relative_sd=1.0)] = 0.01
    damping_axis_deg: Annotated[
        float, number("θ_τ, of most damping; ± 26 means unknown (its period is 90°)", sd=26.0)
    ] = 0.0
    pattern_angle_deg: Annotated[float, number("θ of the standing wave, as commanded")] = 22.5
    k1_deg_per_h_per_Hz: Annotated[float, number("of f, the change of frequency from the reference", sd=1.0)] = 0.0
    k2_deg_per_h_per_Hz2: Annotated[float, number("of f²", sd=0.1)] = 0.0
    k3_deg_per_h_per_Hz3: Annotated[float, number("of f³", sd=0.01)] = 0.0
    k4_deg_per_h_s_per_Hz: Annotated[float, number("of ḟ, its rate")] = 0.0
    k5_deg_per_h_s2_per_Hz2: Annotated[float, number("of ḟ²")] = 0.0
    k6_deg_per_h_s3_per_Hz3: Annotated[float, number("of ḟ³")] = 0.0
    k7_deg_per_h_s_per_Hz2: Annotated[float, number("of f ḟ")] = 0.0
    k8_deg_per_h_s_per_Hz3: Annotated[float, number("of f² ḟ")] = 0.0
    k9_deg_per_h_s2_per_Hz3: Annotated[float, number("of f ḟ²")] = 0.0
    note: Note = ""

    @property
    def terms(self) -> dict[tuple[int, int], float]:
        """The polynomial's coefficients that are not 0, by their powers of f and of its rate."""
        return {powers: k for key, powers in TERMS.items() if (k := getattr(self, key))}

    def at(
        self, change: Array, rate: Array, frequency: Array, inverse_q: Array, bryan_factor: float, harmonic: int = 2,
        pattern_angle: Array | None = None, wave: NDArray[np.complex128] | None = None,
    ) -> Array:  # fmt: skip
        """Zero-rate output (deg/h) at changes and rates (N,) of frequency, Hz and Hz/s, and losses.

        B = Δ(1/τ) sin 2n(θ − θ_τ) / (2 n k) (averaged equations of Lynch 1995), 1/τ = π f/Q, plus Σ k fⁱ ḟʲ. `wave`,
        (N,), is Δ(1/Q) exp(2inθ_τ) of the parts of a loss budget, in place of this table's anisotropy.
        """
        theta = np.radians(self.pattern_angle_deg) if pattern_angle is None else pattern_angle
        if wave is None:
            axis = np.exp(2j * harmonic * np.radians(self.damping_axis_deg))
            wave = np.asarray(self.damping_anisotropy * inverse_q * axis)
        turned = np.imag(np.conj(wave) * np.exp(2j * harmonic * theta))  # Δ(1/Q) sin 2n(θ − θ_τ)
        drift = np.pi * frequency * turned / (2 * harmonic * bryan_factor)
        return np.asarray(self.polynomial(change, rate) + DEG_PER_H * drift)

    def polynomial(self, change: Array, rate: Array) -> Array:
        """Return the offset and Σ k fⁱ ḟʲ (deg/h) of the change of frequency (Hz) and its rate (Hz/s)."""
        bias: Array | float = self.offset_deg_per_h
        for (power, rate_power), coefficient in self.terms.items():
            bias = bias + coefficient * change**power * rate**rate_power
        return np.asarray(bias)


TABLE = CardTable("bias", Bias)
