"""Loss inside the material by thermally activated processes."""

import numpy as np
from numpy.typing import ArrayLike

from shell.errors import ShellError
from shell.quadrature import Array

BOLTZMANN = 8.617333262e-5  # eV/K


def activated_loss(height: float, energy: float, peak: float, temperature: ArrayLike) -> Array:
    """Debye peak 1/Q = 2 H ωτ/(1 + (ωτ)²), τ = τ₀ exp(E/(k T)), E in eV: of height H at T_p (K), where ωτ = 1."""
    if not (energy > 0 and peak > 0):
        raise ShellError("an activated loss needs a positive activation energy and peak temperature.")
    z = energy / BOLTZMANN * (1 / np.asarray(temperature, dtype=float) - 1 / peak)
    return np.asarray(height / np.cosh(np.minimum(np.abs(z), 300.0)))


def activation_energy(peak: float, width: float) -> float:
    """E = k T_p²/w, eV: ln ωτ = (E/k)(1/T - 1/T_p) changes by one over the width w about the peak."""
    return BOLTZMANN * peak**2 / width
