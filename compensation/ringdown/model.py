"""Free decay of a standing wave seen by two pick-offs: amplitudes, modes, axes.

With z = (X, Y) the complex amplitudes along cos nθ and sin nθ (`compensation.wave`, no rate and no force),

    ż = M z + (i κ − γ) |z|² z,    M = iδ − 1/τ − C·S + i W·S,    C·S = [[C₁, C₂], [C₂, −C₁]],

C = ½ Δ(1/τ) (cos 2nθ_τ, sin 2nθ_τ), W = ½ Δω (cos 2nθ_ω, sin 2nθ_ω), δ the mean frequency against the carrier of the
demodulation. κ (a cubic stiffness) and γ (a cubic damping) act on the amplitude common to both patterns; what they do to
the form of an ellipse is of the order of its eccentricity and left out. A slow drift of the temperature is ½ β t² of phase.
"""

from dataclasses import dataclass, fields

import numpy as np

from compensation.arrays import Array, Complex


@dataclass(frozen=True)
class Decay:
    """The rates of a free decay, all in 1/s (rad/s), about a carrier."""

    detuning: float  # detuning, decay: δ and 1/τ
    decay: float
    # damping_cos, damping_sin, stiffness_cos, stiffness_sin: C₁, C₂ and W₁, W₂; the stiffness pair alone is used
    # of a single channel with two modes
    damping_cos: float = 0.0
    damping_sin: float = 0.0
    stiffness_cos: float = 0.0
    stiffness_sin: float = 0.0
    hardening: float = 0.0  # hardening, thickening: κ and γ per squared amplitude
    thickening: float = 0.0
    chirp: float = 0.0  # β (rad/s²)

    @property
    def mean(self) -> complex:
        """Half the trace of M."""
        return complex(-self.decay, self.detuning)

    @property
    def matrix(self) -> Complex:
        """M without its mean: symmetric and without a trace."""
        a = complex(-self.damping_cos, self.stiffness_cos)
        b = complex(-self.damping_sin, self.stiffness_sin)
        return np.array([[a, b], [b, -a]])

    @property
    def rates(self) -> Complex:
        """The two eigenvalues of M, the higher frequency first."""
        a, b = self.matrix[0]
        s = np.sqrt(a * a + b * b)
        found = np.array([self.mean + s, self.mean - s])
        return found if found[0].imag >= found[1].imag else found[::-1]

    def vector(self, names: tuple[str, ...]) -> Array:
        """The named rates as an array."""
        return np.array([getattr(self, name) for name in names])


NAMES = tuple(field.name for field in fields(Decay))
ONE_MODE = ("detuning", "decay")
TWO_MODES = (*ONE_MODE, "damping_cos", "damping_sin", "stiffness_cos", "stiffness_sin")


def propagate(decay: Decay, time: Array, start: Complex) -> Complex:
    """Return z (channels, rows) at the times (s) after the start, where it is `start` (channels,).

    exp(M t) = e^{mt} (cosh st + (M − m) sinh(st)/s) with s² = C-W determinant, a scalar for one channel.
    """
    common = np.exp(decay.mean * time + 0.5j * decay.chirp * time**2)
    if start.size == 1:
        z = start[:, None] * common
    else:
        a, b = decay.matrix[0]
        s = np.sqrt(a * a + b * b + 0j)
        small = np.abs(s) * time < 1e-2
        up = np.exp(s * time)
        down, square = 1 / up, (s * time) ** 2
        ratio = np.where(small, time * (1 + square / 6 * (1 + square / 20)), (up - down) / (2 * (s or 1.0)))
        z = common * ((up + down) / 2 * start[:, None] + ratio * (decay.matrix @ start)[:, None])
    if decay.hardening or decay.thickening:
        # E = E₀/(1 + 2γ ∫E₀ dt) and the phase κ ∫E dt, E₀ = |z|² of the linear decay
        energy = np.sum(np.abs(z) ** 2, axis=0)
        shrink = 1 / np.sqrt(np.maximum(1 + 2 * decay.thickening * _integrate(time, energy), 1e-6))
        z = z * shrink * np.exp(1j * decay.hardening * _integrate(time, energy * shrink**2))
    return np.asarray(z)


def _integrate(time: Array, values: Array) -> Array:
    """Return the running integral from t = 0, exact for an exponential between two rows."""
    before = np.concatenate([[values[0]], values])
    steps = np.diff(time, prepend=0.0)
    logarithm = np.log(np.maximum(before[1:], 1e-300) / np.maximum(before[:-1], 1e-300))
    flat = np.abs(logarithm) < 1e-6
    mean = np.where(flat, (before[1:] + before[:-1]) / 2, np.diff(before) / np.where(flat, 1.0, logarithm))
    return np.cumsum(steps * mean)
