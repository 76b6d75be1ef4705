"""Equilibrium and acceleration in shell coordinates: BVG paper eqs. (7)–(15), derived, beside what is printed.

The coordinates are φ (angle between normal and axis), υ (height along the normal) and θ (around), with the lengths
ρ_z = ρ₁ + υ, 1 and r_z = (ρ₂ + υ) sin φ per unit of them, and ∂r_z/∂φ = ρ_z cos φ (Codazzi).
"""

from functools import cache

import sympy as sp

from shell.derivation.bell import rho_1
from shell.derivation.symbols import Omega, h, phi, rho, t, theta, z

AXES = ("phi", "upsilon", "theta")
COORDINATES = (phi, z, theta)
rho_z = sp.Function("rho_z")(phi, z)  # length per unit of φ, ρ₁ + υ (m)
r_z = sp.Function("r_z")(phi, z)  # distance from the axis, (ρ₂ + υ) sin φ (m)
Omega_t = sp.Function("Omega")(t)  # rate about the axis (rad/s), a function of time


def stress(i: int, j: int) -> sp.Expr:
    """Return σ_ij, a function of φ, υ and θ (Pa)."""
    first, second = sorted((i, j))
    return sp.Function(f"sigma_{AXES[first]}_{AXES[second]}")(*COORDINATES)


def moving(i: int) -> sp.Expr:
    """Return the displacement u_i, a function of time (m)."""
    return sp.Function(f"u_{AXES[i]}")(t)


@cache
def equilibrium() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return the left-hand sides of BVG paper eq. (7): the divergence of the stress along φ, υ and θ (N/m³).

    (∇·σ)_i = (1/√g) Σ_j ∂_j(√g σ_ij/h_j) + Σ_j [σ_ij ∂_j h_i − σ_jj ∂_i h_j]/(h_i h_j), h = (ρ_z, 1, r_z), √g = ρ_z r_z.
    """
    lengths = (rho_z, sp.S.One, r_z)
    volume = rho_z * r_z
    # of the lengths: ∂ρ_z/∂υ = 1, ∂r_z/∂φ = ρ_z cos φ, ∂r_z/∂υ = sin φ
    known = {rho_z.diff(z): 1, r_z.diff(phi): rho_z * sp.cos(phi), r_z.diff(z): sp.sin(phi)}
    found = []
    for i in range(3):
        total = sp.S.Zero
        for j in range(3):
            flow = (volume * stress(i, j) / lengths[j]).diff(COORDINATES[j]) / volume
            turn = stress(i, j) * lengths[i].diff(COORDINATES[j]) - stress(j, j) * lengths[j].diff(COORDINATES[i])
            total += flow + turn / (lengths[i] * lengths[j])
        found.append(sp.expand(total.doit().subs(known)))
    return tuple(found)


@cache
def printed_equilibrium() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return BVG paper eq. (7) as printed, its fraction bars restored: with terms in ∂ρ₁/∂φ, and σ_φθ sin φ in the first."""
    s = [[stress(i, j) for j in range(3)] for i in range(3)]
    sine, cosine, bend = sp.sin(phi), sp.cos(phi), rho_1(phi).diff(phi)
    return (
        s[0][1].diff(z)
        + ((s[0][0] - s[2][2]) * cosine + s[0][2].diff(theta) + s[0][2] * sine) / r_z
        + (s[0][0].diff(phi) + 2 * s[0][1]) / rho_z
        - 2 * s[0][0] * bend / rho_z**2,
        s[1][1].diff(z)
        + ((s[1][1] - s[2][2]) * sine + s[1][2].diff(theta) + s[0][1] * cosine) / r_z
        + (s[0][1].diff(phi) + s[1][1] - s[0][0]) / rho_z
        - s[0][1] * bend / rho_z**2,
        s[1][2].diff(z)
        + (3 * s[0][2] * cosine + 2 * s[1][2] * sine + s[2][2].diff(theta)) / r_z
        + (s[1][2] + s[0][2].diff(phi) - s[0][2] * cosine * rho_z / r_z) / rho_z,
    )


@cache
def equilibrium_defect() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return (7) as printed minus the divergence: zero around; along φ and υ terms in ∂ρ₁/∂φ, and σ_φθ for σ_φυ once.

    The terms in ∂ρ₁/∂φ vanish on the hemisphere and the cylinder, not on the hyperbola.
    """
    return tuple(
        sp.factor(sp.expand(printed - ours), deep=False)
        for printed, ours in zip(printed_equilibrium(), equilibrium(), strict=True)
    )


@cache
def rate_vector() -> sp.Matrix:
    """Return BVG paper eq. (10), Ω = Ω (cos φ υ̂ − sin φ φ̂), along φ, υ, θ."""
    return sp.ImmutableMatrix(Omega_t * sp.Matrix([-sp.sin(phi), sp.cos(phi), 0]))


@cache
def acceleration_parts() -> tuple[sp.Matrix, sp.Matrix, sp.Matrix, sp.Matrix]:
    """Return the terms of BVG paper eq. (11), for the displacement u = u_φ φ̂ + u_υ υ̂ + u_θ θ̂ of (8), (9).

    Relative ü, Coriolis' 2 Ω×u̇, Euler's Ω̇×u and the centripetal Ω×(Ω×u); right-handed along φ, υ, θ as the paper's signs are.
    """
    turn, u = rate_vector(), sp.ImmutableMatrix([moving(i) for i in range(3)])
    return u.diff(t, 2), 2 * turn.cross(u.diff(t)), turn.diff(t).cross(u), turn.cross(turn.cross(u))


@cache
def accelerations() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return BVG paper eq. (12), the sum of (11) along φ, υ, θ; minus signs and dots are lost in print."""
    whole = sum(acceleration_parts(), sp.zeros(3, 1))
    along, normal, around = (sp.expand(component) for component in whole)
    return along, normal, sp.expand(around.subs(sp.sin(phi) ** 2, 1 - sp.cos(phi) ** 2))


@cache
def slow_accelerations() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return BVG paper eq. (13): (12) without Ω̇ and Ω², small against the vibration's ω."""
    steady = (sp.expand(component.subs(Omega_t, Omega).doit()) for component in accelerations())
    return tuple(component.coeff(Omega, 0) + Omega * component.coeff(Omega, 1) for component in steady)


@cache
def printed_slow_accelerations() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return BVG paper eq. (13) as printed: its third has −2Ω u̇_υ cos φ alone."""
    u = [moving(i) for i in range(3)]
    sine, cosine = sp.sin(phi), sp.cos(phi)
    return (
        u[0].diff(t, 2) + 2 * Omega * u[2].diff(t) * cosine,
        u[1].diff(t, 2) + 2 * Omega * u[2].diff(t) * sine,
        u[2].diff(t, 2) - 2 * Omega * u[1].diff(t) * cosine,
    )


@cache
def inertial_forces() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return BVG paper eq. (14), ρ h a per area (N/m²); with (7) integrated over the thickness it is (15)."""
    return tuple(sp.expand(rho * h * component) for component in slow_accelerations())
