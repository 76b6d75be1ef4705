"""The sensitive element of a Coriolis vibratory gyro and its full motion, equations (1) and (2) of the CVG papers.

Two oscillators x₁, x₂ (primary and secondary) of natural frequencies k₁, k₂ (rad/s) and relative damping ζ₁, ζ₂, coupled by the
angular rate Ω; ω excitation frequency (rad/s), q₁₀ excitation acceleration (m/s²), d, g coefficients of the design.

`propagate_envelope` solves them for the complex amplitudes x = Im{A e^{jωt}} by matrix exponentials, so its step need not
resolve the carrier; the rate comes as samples, linear in between. `demodulate` turns a measured carrier into what it gives.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array, Complex
from compensation.errors import CompensationError
from compensation.samples import check_time, read_columns, require_regular


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


@dataclass(frozen=True)
class Motion:
    """Primary and secondary motion (m) over time (s): real displacements, or complex amplitudes."""

    time: Array
    primary: NDArray[Any]
    secondary: NDArray[Any]


def write_dynamics(
    element: SensitiveElement, rate: ArrayLike, rate_slope: ArrayLike, zeta12: ArrayLike = 0.0, zeta21: ArrayLike = 0.0
) -> Array:
    """Return the matrices M of ẏ = M y + (0, 0, q₁, 0, 0), y = (x₁, x₂, ẋ₁, ẋ₂, 1): CVG cross-damping eq. (2)."""
    e = element
    Omega, slope, cross12, cross21 = np.broadcast_arrays(
        *(np.asarray(values, dtype=float) for values in (rate, rate_slope, zeta12, zeta21))
    )
    M = np.zeros((*Omega.shape, 5, 5))
    M[..., 0, 2] = M[..., 1, 3] = 1.0
    M[..., 2, 0] = -(e.k1**2 - e.d1 * Omega**2)
    M[..., 2, 2] = -2 * e.zeta1 * e.k1
    M[..., 2, 3] = -(e.g1 * Omega + 2 * cross21 * e.k1)
    M[..., 2, 1] = -e.d3 * slope
    M[..., 3, 1] = -(e.k2**2 - e.d2 * Omega**2)
    M[..., 3, 3] = -2 * e.zeta2 * e.k2
    M[..., 3, 2] = e.g2 * Omega + 2 * cross12 * e.k2
    M[..., 3, 0] = slope
    return M


def propagate_envelope(
    element: SensitiveElement, time: ArrayLike, rate: ArrayLike, *, zeta12: ArrayLike | None = None,
    zeta21: ArrayLike | None = None, from_rest: bool = False,
) -> Motion:  # fmt: skip
    """Propagate the complex amplitudes of equation (2), x = Im{A e^{jωt}}, from one sample to the next, nothing neglected.

    ẏ = (M(t) − jω) y + (0, 0, q₁₀, 0) by matrix exponentials: where the rate changes, by the fourth-order Magnus
    expansion h M(mid) + h³/12 [M′, M(mid)] while h ω < 1, by M(mid) alone for longer steps.
    """
    from scipy.linalg import expm

    zeta12, zeta21 = (np.zeros(np.shape(time)) if one is None else one for one in (zeta12, zeta21))
    t, Omega, cross12, cross21 = read_columns(time=time, rate=rate, zeta12=zeta12, zeta21=zeta21)
    check_time(t)
    h = np.diff(t)
    rise = np.diff(Omega) / h
    middle = [(values[:-1] + values[1:]) / 2 for values in (Omega, cross12, cross21)]
    carrier = 1j * element.omega * np.diag([1, 1, 1, 1, 0])
    M = write_dynamics(element, middle[0], rise, middle[1], middle[2]) - carrier
    M[:, 2, 4] = element.q10
    # (Ω²)′ at the middle of a step is 2 Ω Ω′, and M depends on Ω otherwise linearly.
    drift = np.zeros_like(M)
    drift[:, 2, 0] = 2 * element.d1 * middle[0] * rise
    drift[:, 3, 1] = 2 * element.d2 * middle[0] * rise
    drift[:, 2, 3] = -element.g1 * rise - 2 * element.k1 * np.diff(cross21) / h
    drift[:, 3, 2] = element.g2 * rise + 2 * element.k2 * np.diff(cross12) / h
    hh = h[:, None, None]
    resolved = hh * element.omega < 1
    exponents = hh * M + np.where(resolved, hh**3 / 12, 0.0) * (drift @ M - M @ drift)
    as_bytes = exponents.reshape(len(h), -1).view((np.void, exponents[0].nbytes)).ravel()
    _, first, kind = np.unique(as_bytes, return_index=True, return_inverse=True)
    steps = expm(exponents[first])
    y = np.empty((len(t), 5), dtype=complex)
    A1 = 0j if from_rest else element.primary_amplitude
    y[0] = [A1, 0, 1j * element.omega * A1, 0, 1]
    for n, k in enumerate(kind):
        y[n + 1] = steps[k] @ y[n]
    return Motion(t, y[:, 0], y[:, 1])


def demodulate(time: ArrayLike, displacement: ArrayLike, omega: float) -> tuple[Array, Complex]:
    """Return the complex amplitude A of x = Im{A e^{jωt}} by synchronous detection over two carrier periods, one lost at either end."""
    t, x = read_columns(time=time, displacement=displacement)
    step = require_regular(t, "synchronous demodulation")
    period = 2 * np.pi / omega / step
    m = round(period)
    if m < 4 or abs(period - m) > 1e-6 * m:
        raise CompensationError(f"a carrier period holds {period:.6g} samples; it must be a whole number, at least 4.")
    window = np.convolve(np.full(m, 1 / m), np.full(m, 1 / m))
    if len(t) < len(window):
        raise CompensationError(f"demodulation needs two carrier periods, {len(window)} rows, not {len(t)}.")
    mixed = 2j * x * np.exp(-1j * omega * t)
    return t[m - 1 : len(t) - m + 1], np.convolve(mixed, window, mode="valid")
