"""The standing wave of a shell between its two patterns: decay, detuning, precession, and the rate errors that they cause.

    (Ẋ, Ẏ) = M (X, Y) + u,   M = n k Ω J − 1/τ − ½ Δ(1/τ) S(n θ_τ) + ½ i Δω S(n θ_ω),   S(α) = [[cos 2α, sin 2α], [sin 2α, −cos 2α]]

for x = Re{X e^{iωt}} along cos nθ and y along sin nθ; derived, and shown equal to the CVG paper's eqs. (7)–(25), in
`compensation.derivation`. u = −i F/(2ω) is the force per modal mass F = Re{F e^{iωt}}. Azimuths θ are physical angles on
the shell, counted in the sense in which a positive rate turns the wave.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array, Complex
from compensation.errors import CompensationError

PHYSICAL = ("omega", "tau", "damping_split", "damping_axis", "frequency_split", "frequency_axis")


@dataclass(frozen=True)
class StandingWave:
    """The n-th harmonic of a shell as a gyro; every value a number, or one per row of a run."""

    omega: float | Array  # rad/s, mean angular frequency of the two patterns
    tau: float | Array  # s, decay time of the amplitude, 2 Q/ω
    # 1/s, Δ(1/τ) = 1/τ₁ − 1/τ₂, of the axis `damping_axis` (rad) that is damped most.
    damping_split: float | Array = 0.0
    damping_axis: float | Array = 0.0
    # rad/s, Δω = ω₁ − ω₂, of the axis `frequency_axis` (rad) of the higher frequency.
    frequency_split: float | Array = 0.0
    frequency_axis: float | Array = 0.0
    # harmonic, bryan_factor: n and k: a rate Ω turns the wave with k Ω against the shell.
    harmonic: int = 2
    bryan_factor: float = 0.277

    def __post_init__(self) -> None:
        for name in ("omega", "tau"):
            if not np.all(np.asarray(getattr(self, name)) > 0):
                raise CompensationError(f"{name} of a standing wave must be positive.")
        if np.any(np.abs(self.damping_split) * np.asarray(self.tau) >= 2):
            raise CompensationError("the damping split leaves one axis undamped: Δ(1/τ) must be below 2/τ.")
        if not self.bryan_factor > 0:
            raise CompensationError(f"the Bryan factor must be positive, not {self.bryan_factor:g}.")

    @property
    def coupling(self) -> float:
        """N k, the precession of n θ per rate."""
        return self.harmonic * self.bryan_factor

    def decay(self, angle: ArrayLike) -> Array:
        """1/τ of a wave at the azimuth θ (1/s): 1/τ + ½ Δ(1/τ) cos 2n(θ − θ_τ)."""
        return np.asarray(1 / self.tau + self.damped(angle).real)

    def drift(self, angle: ArrayLike) -> Array:
        """Rate (rad/s) that damping feigns at the azimuth θ: Δ(1/τ)/(2 n k) sin 2n(θ − θ_τ)."""
        return np.asarray(-self.damped(angle).imag / self.coupling)

    def quadrature(self, angle: ArrayLike) -> Array:
        """Growth of the quadrature over the amplitude at the azimuth θ (1/s): ½ Δω sin 2n(θ − θ_ω)."""
        return np.asarray(-self.detuned(angle).imag)

    def detuning(self, angle: ArrayLike) -> Array:
        """Angular frequency of a wave at the azimuth θ less the mean (rad/s): ½ Δω cos 2n(θ − θ_ω)."""
        return np.asarray(self.detuned(angle).real)

    def damped(self, angle: ArrayLike = 0.0) -> Complex:
        """½ Δ(1/τ) e^{2in(θ_τ − θ)} of a wave at the azimuth θ (1/s)."""
        return np.asarray(self.damping_split / 2 * np.exp(2j * self.harmonic * (self.damping_axis - np.asarray(angle))))

    def detuned(self, angle: ArrayLike = 0.0) -> Complex:
        """½ Δω e^{2in(θ_ω − θ)} (rad/s)."""
        return np.asarray(
            self.frequency_split / 2 * np.exp(2j * self.harmonic * (self.frequency_axis - np.asarray(angle)))
        )

    def mean_rate(self, rate: float) -> float:
        """Mean rate (rad/s) of a free wave: sign(Ω) √(Ω² − Ω_d²), 0 where it locks, |Ω| ≤ Ω_d = Δ(1/τ)/(2 n k)."""
        most = abs(float(self.damping_split)) / (2 * self.coupling)
        return float(np.sign(rate) * np.sqrt(max(rate**2 - most**2, 0.0)))

    def envelope(self, rate: ArrayLike = 0.0, angle: ArrayLike = 0.0) -> Complex:
        """Return M (..., 2, 2) of the complex amplitudes (1/s), in the frame of a wave at the azimuth θ."""
        damped, detuned = self.damped(angle), self.detuned(angle)
        along, across = -damped.real + 1j * detuned.real, -damped.imag + 1j * detuned.imag
        decay, coriolis = -1 / np.asarray(self.tau), self.coupling * np.asarray(rate)
        M = np.array([[decay + along, across - coriolis], [across + coriolis, decay - along]])
        return np.moveaxis(M, (0, 1), (-2, -1))

    def over_rows(self, count: int) -> "StandingWave":
        """Return the wave with every physical value as an array of rows."""
        rows: dict[str, Any] = {name: np.broadcast_to(np.array(getattr(self, name), float), count) for name in PHYSICAL}
        return replace(self, **rows)

    def between(self, row: NDArray[np.intp], part: Array) -> "StandingWave":
        """Return the wave of rows at parts of the way from a row to the next: ω, 1/τ, ½ Δ(1/τ) e^{2inθ_τ} and ½ Δω e^{2inθ_ω} on straight lines."""
        later = np.minimum(row + 1, np.size(self.omega) - 1)

        def line(values: NDArray[Any]) -> NDArray[Any]:
            return np.asarray(values[row] + part * (values[later] - values[row]))

        damped, detuned = line(self.damped()), line(self.detuned())
        return replace(
            self, omega=line(np.asarray(self.omega)), tau=1 / line(1 / np.asarray(self.tau)),
            damping_split=2 * np.abs(damped), damping_axis=np.angle(damped) / (2 * self.harmonic),
            frequency_split=2 * np.abs(detuned), frequency_axis=np.angle(detuned) / (2 * self.harmonic),
        )  # fmt: skip

    def at_row(self, row: int) -> "StandingWave":
        """Return the wave at one of its rows, in numbers."""
        numbers: dict[str, Any] = {name: float(getattr(self, name)[row]) for name in PHYSICAL}
        return replace(self, **numbers)


def turn(angle: ArrayLike) -> Array:
    """Return the rotation R(ψ) of the plane (2, 2, ...)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def from_quality(
    frequency: float, quality: float, *, damping_anisotropy: float = 0.0, damping_axis: float = 0.0,
    frequency_split: float = 0.0, frequency_axis: float = 0.0, harmonic: int = 2, bryan_factor: float = 0.277,
) -> StandingWave:  # fmt: skip
    """Return the wave of a data sheet: frequencies (Hz), Q (1/τ = π f/Q), Δ(1/τ) over 1/τ, axes (rad)."""
    if not (frequency > 0 and quality > 0):
        raise CompensationError("frequency and quality factor must be positive.")
    decay = np.pi * frequency / quality
    return StandingWave(
        2 * np.pi * frequency, 1 / decay, damping_anisotropy * decay, damping_axis,
        2 * np.pi * frequency_split, frequency_axis, harmonic, bryan_factor,
    )  # fmt: skip
