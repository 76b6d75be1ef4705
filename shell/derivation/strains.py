"""Strains of a thin shell of revolution from the Kirchhoff hypothesis: HRG paper eqs. (6), (8).

The printed eq. (8) stands beside the result, its twist as printed and as corrected, with proofs that the printed one is wrong.
"""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.displacements import Displacement, general_displacement
from shell.derivation.symbols import phi, r, theta, z


class Radii(NamedTuple):
    """Principal radii of curvature of the middle surface, along the meridian and around (m)."""

    rho_1: sp.Expr
    rho_2: sp.Expr


class LayerStrains(NamedTuple):
    """Strains at height z: three stretches, and three angles (engineering shears)."""

    e_phi: sp.Expr
    e_theta: sp.Expr
    e_z: sp.Expr
    gamma_phitheta: sp.Expr
    gamma_phiz: sp.Expr
    gamma_thetaz: sp.Expr


class Deformation(NamedTuple):
    """Strains of the middle surface (1), its changes of curvature and its twist (1/m)."""

    epsilon_phi: sp.Expr
    epsilon_theta: sp.Expr
    epsilon_phitheta: sp.Expr
    kappa_phi: sp.Expr
    kappa_theta: sp.Expr
    tau: sp.Expr


SPHERE = Radii(r, r)


@cache
def frame() -> sp.Matrix:
    """Return the unit vectors along the meridian, around and along the normal, as rows in Cartesian axes."""
    normal = sp.Matrix([[sp.sin(phi) * sp.cos(theta), sp.sin(phi) * sp.sin(theta), sp.cos(phi)]])
    around = sp.Matrix([[-sp.sin(theta), sp.cos(theta), 0]])
    return sp.Matrix.vstack(normal.diff(phi), around, normal)


@cache
def frame_rotation(coordinate: sp.Symbol) -> sp.Matrix:
    """Return the matrix Γ of ∂(frame)/∂(coordinate) = Γ · frame."""
    return (frame().diff(coordinate) * frame().T).applyfunc(sp.trigsimp)


def layer_strains(displacement: Displacement, radii: Radii = SPHERE) -> LayerStrains:
    """Return the exact linear strains of a body in (φ, θ, z), lengths (ρ₁+z) dφ, (ρ₂+z) sin φ dθ, dz: BVG eq. (6), HRG eq. (3)."""
    components = sp.Matrix([list(displacement)])
    along = (components.diff(phi) + components * frame_rotation(phi)) / (radii.rho_1 + z)
    around = (components.diff(theta) + components * frame_rotation(theta)) / ((radii.rho_2 + z) * sp.sin(phi))
    across = components.diff(z)
    return LayerStrains(
        along[0], around[1], across[2], along[1] + around[0], along[2] + across[0], around[2] + across[1]
    )


def kirchhoff_displacement(displacement: Displacement, radii: Radii = SPHERE) -> Displacement:
    """Return the displacement when normals stay normal, u + z β_φ, v + z β_θ, w; β from γ_φz = γ_θz = 0 on the middle surface."""
    beta_phi, beta_theta = sp.symbols("beta_phi beta_theta")
    tilted = Displacement(displacement.u + z * beta_phi, displacement.v + z * beta_theta, displacement.w)
    shears = layer_strains(tilted, radii)
    conditions = [shears.gamma_phiz.subs(z, 0), shears.gamma_thetaz.subs(z, 0)]
    rotation = sp.solve(conditions, [beta_phi, beta_theta], dict=True)[0]
    return Displacement(tilted.u.subs(rotation), tilted.v.subs(rotation), displacement.w)


def kirchhoff_strains(displacement: Displacement, radii: Radii = SPHERE) -> LayerStrains:
    """Return the strains at height z under the Kirchhoff hypothesis, the left-hand sides of HRG paper eq. (6)."""
    return layer_strains(kirchhoff_displacement(displacement, radii), radii)


def derive_deformation(displacement: Displacement, radii: Radii = SPHERE) -> Deformation:
    """Return the right-hand side of HRG paper eq. (8), derived.

    Exactly, (1+z/ρ₁) e_φ = ε_φ + z κ_φ, (1+z/ρ₂) e_θ = ε_θ + z κ_θ and
    (1+z/ρ₁)(1+z/ρ₂) γ = ε_φθ (1 − z²/ρ₁ρ₂) + 2zτ (1 + z/2ρ₁ + z/2ρ₂): values and slopes at z = 0.
    For z ≪ ρ these are HRG paper eq. (6): e = ε + zκ, γ = ε_φθ + 2zτ.
    """
    strains = kirchhoff_strains(displacement, radii)
    stretch_1, stretch_2 = 1 + z / radii.rho_1, 1 + z / radii.rho_2
    scaled = [stretch_1 * strains.e_phi, stretch_2 * strains.e_theta, stretch_1 * stretch_2 * strains.gamma_phitheta]
    epsilon = [sp.expand(expression.subs(z, 0)) for expression in scaled]
    slope = [sp.expand(expression.diff(z).subs(z, 0)) for expression in scaled]
    return Deformation(epsilon[0], epsilon[1], epsilon[2], slope[0], slope[1], slope[2] / 2)


def thin_layer_strains(deformation: Deformation) -> LayerStrains:
    """Return HRG paper eq. (6): e_φ = ε_φ + z κ_φ, e_θ = ε_θ + z κ_θ, γ_φθ = ε_φθ + 2zτ; the rest vanishes."""
    return LayerStrains(
        deformation.epsilon_phi + z * deformation.kappa_phi,
        deformation.epsilon_theta + z * deformation.kappa_theta,
        sp.S.Zero,
        deformation.epsilon_phitheta + 2 * z * deformation.tau,
        sp.S.Zero,
        sp.S.Zero,
    )


def corrected_deformation(displacement: Displacement) -> Deformation:
    """Return HRG paper eq. (8) with the twist corrected: its second term is ∂w/∂θ · ctg φ."""
    return _equation_8(displacement, sp.diff(displacement.w, theta))


def printed_deformation(displacement: Displacement) -> Deformation:
    """Return HRG paper eq. (8) as printed: the second term of the twist is ∂w/∂φ · ctg φ, which is wrong."""
    return _equation_8(displacement, sp.diff(displacement.w, phi))


def _equation_8(displacement: Displacement, twisting_slope: sp.Expr) -> Deformation:
    u, v, w = displacement
    sine, cosine = sp.sin(phi), sp.cos(phi)
    return Deformation(
        epsilon_phi=(w + u.diff(phi)) / r,
        epsilon_theta=(v.diff(theta) / sine + u * cosine / sine + w) / r,
        epsilon_phitheta=(u.diff(theta) / sine + v.diff(phi) - v * cosine / sine) / r,
        kappa_phi=(u.diff(phi) - w.diff(phi, 2)) / r**2,
        kappa_theta=(-w.diff(theta, 2) / sine + v.diff(theta) - w.diff(phi) * cosine + u * cosine) / (r**2 * sine),
        tau=(-w.diff(phi, theta) + twisting_slope * cosine / sine + u.diff(theta) + v.diff(phi) * sine - v * cosine)
        / (r**2 * sine),
    )


@cache
def printed_twist_defect() -> sp.Expr:
    """Return derived minus printed twist for arbitrary u, v, w: (∂w/∂θ − ∂w/∂φ) ctg φ / (r² sin φ), not zero."""
    general = general_displacement()
    return sp.factor(sp.simplify(derive_deformation(general).tau - printed_deformation(general).tau))


@cache
def rigid_motions() -> dict[str, Displacement]:
    """Return the six rigid motions of the sphere r, a shift a = (1, 0, 0)… or a turn a × x, in the shell's frame."""
    position = r * frame()[2, :]
    motions = {}
    for k, axis in enumerate("xyz"):
        unit = sp.eye(3)[k, :]
        for name, field in (("shift along", unit), ("turn about", unit.cross(position))):
            components = (frame() * field.T).applyfunc(sp.trigsimp)
            motions[f"{name} {axis}"] = Displacement(*components)
    return motions
