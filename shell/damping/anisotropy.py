"""Damping anisotropy of a mode pair, from films and surfaces that vary over θ.

A part of the loss whose density goes as 1 + Σ a_k cos k(θ - θ_k) around meets the energies of a pattern at the azimuth θ₀: normal
strains, u and w as cos² n(θ - θ₀), twist and v as sin². Only the wave k = 2n is felt, to first order in a:

    1/Q(θ₀) = q [1 + ½ a κ cos 2n(θ₀ - θ_a)],   κ = (C - S)/(C + S),

C and S being the part's energies of the first and of the second kind. The parts add as Δ(1/Q) e^{2inθ_τ} = Σ q κ a e^{2inθ_a}, θ_τ
the azimuth of the pattern that is damped most; Δ(1/τ) = ω Δ(1/Q)/2 makes the drift Δ(1/τ)/(2 n k) sin 2n(θ - θ_τ).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shell.damping.budget import Budget
from shell.damping.faces import FreeFaces
from shell.damping.film import Film, film_energies
from shell.errors import ShellError
from shell.quadrature import Array

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Ripple:
    """How one part of the budget varies around: its name there, a and θ_a (rad) of the wave 2n, and κ of the mode."""

    part: str
    amplitude: float
    angle: float
    weight: float

    def __post_init__(self) -> None:
        if not 0 <= self.amplitude <= 1:
            raise ShellError(f"a loss that varies around by {self.amplitude:g} would be negative somewhere: at most 1.")


def damping_wave(budget: Budget, ripples: Sequence[Ripple], harmonic: int) -> Complex:
    """Δ(1/Q) exp(2 i n θ_τ) over the budget's temperatures."""
    parts = {part.name: part.inverse_q for part in budget.parts}
    total = np.zeros(len(budget.temperatures), dtype=complex)
    for ripple in ripples:
        if ripple.part not in parts:
            raise ShellError(f"the budget has no loss '{ripple.part}' that could vary around the circumference.")
        total += parts[ripple.part] * ripple.weight * ripple.amplitude * np.exp(2j * harmonic * ripple.angle)
    return total


def film_weight(film: Film, faces: tuple[FreeFaces, ...]) -> float:
    """κ of a film's own loss: its normal strains against its twist."""
    pairs = []
    for face in faces:
        cosine, sine = (face.integrate(film.carries(face) * part) for part in film_energies(film, face))
        pairs.append((cosine, sine))
    return _weight(pairs)


def surface_weight(surfaces: tuple[FreeFaces, ...]) -> float:
    """κ of the surface's loss; on roots the shears γ_12 and γ_23, about the axis, are those that vary as sine."""
    pairs = []
    for surface in surfaces:
        G = surface.E / (2 * (1 + surface.nu))
        sine = G * (surface.strain[3] ** 2 + surface.strain[5] ** 2)
        pairs.append((surface.integrate(surface.energy - sine), surface.integrate(sine)))
    return _weight(pairs)


def _weight(pairs: Sequence[tuple[float, float]]) -> float:
    cosine, sine = (float(np.sum(column)) for column in zip(*pairs, strict=True))
    return (cosine - sine) / (cosine + sine)


def describe_wave(wave: Complex, harmonic: int) -> tuple[Array, Array]:
    """Δ(1/Q) and the azimuth θ_τ (rad, 0 ... π/n) of a damping wave."""
    return np.abs(wave), np.asarray(np.angle(wave) / (2 * harmonic) % (np.pi / harmonic))
