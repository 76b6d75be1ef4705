"""The two patterns of one harmonic as an oscillator in a plane: x along cos nθ, y along sin nθ.

    q̈ + (2/τ) q̇ + Δ(1/τ) S(ψ_τ) q̇ + ω² q + ω Δω S(ψ_ω) q − n k (2Ω J q̇ + Ω̇ J q) = f

with q = (x, y), J the quarter turn, S(α) = [[cos 2α, sin 2α], [sin 2α, −cos 2α]] (Lynch 1995, IEEE Std 1431 Annex B).
Angles ψ = n θ are those of the plane. ψ_τ is the axis that is damped most, Δ(1/τ) = 1/τ₁ − 1/τ₂; ψ_ω that of the higher
frequency, Δω = ω₁ − ω₂. Azimuth is counted in the sense in which a positive rate turns the wave, as in the CVG papers'
eq. (1), where n k = g/2; the BVG paper's eq. (23) counts the other way.
"""

from functools import cache

import sympy as sp

t = sp.Symbol("t", real=True)  # time (s)
omega, tau = sp.symbols("omega tau", positive=True)
"""Mean angular frequency (rad/s) and decay time of the amplitude (s)."""
delta_tau, delta_omega = sp.symbols("Delta_tau Delta_omega", real=True)  # Δ(1/τ) (1/s) and Δω (rad/s)
psi_tau, psi_omega = sp.symbols("psi_tau psi_omega", real=True)  # n times the azimuths of the two axes (rad)
n, k = sp.symbols("n k", positive=True)  # circumferential harmonic and Bryan factor
Omega = sp.Symbol("Omega", real=True)  # angular rate (rad/s)
J = sp.Matrix([[0, -1], [1, 0]])  # the quarter turn of the plane


def split(axis: sp.Expr) -> sp.Matrix:
    """Return S(α) = [[cos 2α, sin 2α], [sin 2α, −cos 2α]], an anisotropy with its axis at α."""
    cosine, sine = sp.cos(2 * axis), sp.sin(2 * axis)
    return sp.Matrix([[cosine, sine], [sine, -cosine]])


@cache
def damping() -> sp.Matrix:
    """Return the damping matrix (2/τ) 1 + Δ(1/τ) S(ψ_τ) of q̇ (1/s)."""
    return 2 / tau * sp.eye(2) + delta_tau * split(psi_tau)


@cache
def stiffness() -> sp.Matrix:
    """Return the stiffness matrix ω² 1 + ω Δω S(ψ_ω) of q (1/s²)."""
    return omega**2 * sp.eye(2) + omega * delta_omega * split(psi_omega)


@cache
def small_forces(position: sp.Matrix, velocity: sp.Matrix, force: sp.Matrix) -> sp.Matrix:
    """Return g of q̈ + ω² q = g for a constant rate: damping, detuning, rotation and drive."""
    rotation = 2 * n * k * Omega * J * velocity
    return rotation - damping() * velocity - (stiffness() - omega**2 * sp.eye(2)) * position + force
