"""The sensitive element of a Coriolis vibratory gyro: two oscillators coupled by the angular rate.

Symbols, as in the papers on demodulated dynamics and on cross-damping: x₁, x₂ primary and secondary motion;
k₁, k₂ natural frequencies (rad/s); ζ₁, ζ₂ relative damping; Ω angular rate (rad/s); ω excitation frequency (rad/s);
q₁₀ excitation acceleration (m/s²); d, g dimensionless coefficients of the design.
"""

import math
from dataclasses import dataclass

from compensation.errors import CompensationError


@dataclass(frozen=True)
class SensitiveElement:
    """Parameters of the motion equations (1) of both CVG papers."""

    k1: float  # k1, k2: natural frequencies of the primary and secondary motion (rad/s)
    k2: float
    zeta1: float  # zeta1, zeta2: relative damping (1), 1/(2 Q)
    zeta2: float
    omega: float  # excitation frequency (rad/s)
    q10: float = 1.0  # amplitude of the excitation (m/s²)
    # d1, d2, d3, g1, g2: coefficients of the design (1); the defaults are those of a vibrating cylinder
    d1: float = 1.0
    d2: float = 1.0
    d3: float = 1.0
    g1: float = 2.0
    g2: float = 2.0

    def __post_init__(self) -> None:
        for name in ("k1", "k2", "omega"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise CompensationError(f"{name} must be a positive angular frequency in rad/s.")
        for name in ("zeta1", "zeta2"):
            if not 0 < getattr(self, name) < math.sqrt(0.5):
                raise CompensationError(f"{name} = {getattr(self, name):g} must lie between 0 and 0.707.")
        if not self.g2:
            raise CompensationError("g2 must not be zero: without it the gyro does not sense rate.")

    @property
    def primary_amplitude(self) -> complex:
        """A₁ = q₁₀ / (k₁² − ω² + 2 j k₁ ζ₁ ω), the settled primary motion (m), demodulated-dynamics eq. (8)."""
        return self.q10 / (self.k1**2 - self.omega**2 + 2j * self.k1 * self.zeta1 * self.omega)


def tune(k: float, zeta: float, *, q10: float = 1.0) -> SensitiveElement:
    """Return the tuned element k₁ = k₂ = k, ζ₁ = ζ₂ = ζ, driven at ω = k √(1 − 2ζ²), for which eqs. (9), (23)–(25) hold."""
    if not 0 < zeta < math.sqrt(0.5):
        raise CompensationError(f"zeta = {zeta:g} must lie between 0 and 0.707.")
    return SensitiveElement(k, k, zeta, zeta, omega=k * math.sqrt(1 - 2 * zeta**2), q10=q10)


def translate(
    frame: float, proof_mass: float, k: tuple[float, float], zeta: tuple[float, float], omega: float, *,
    q10: float = 1.0,
) -> SensitiveElement:  # fmt: skip
    """Return a proof mass in a decoupling frame, eq. (1): d₁ = d₂ = 1, d₃ = m₂/(m₁ + m₂), g₁ = 2 m₂/(m₁ + m₂), g₂ = 2."""
    if not (frame >= 0 and proof_mass > 0):
        raise CompensationError(f"the proof mass must be positive, the frame 0 or more: {proof_mass:g}, {frame:g} kg.")
    share = proof_mass / (frame + proof_mass)
    return SensitiveElement(k[0], k[1], zeta[0], zeta[1], omega, q10, d1=1.0, d2=1.0, d3=share, g1=2 * share, g2=2.0)
