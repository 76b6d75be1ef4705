"""Strain energy of the shell, from three-dimensional elasticity to the middle surface: HRG paper eqs. (3)–(5), (7)."""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.strains import Deformation, LayerStrains, thin_layer_strains
from shell.derivation.symbols import E, h, nu, z


class Stresses(NamedTuple):
    """Stresses of a layer: three normal ones and three shears (Pa), in the order of `LayerStrains`."""

    sigma_phi: sp.Expr
    sigma_theta: sp.Expr
    sigma_z: sp.Expr
    sigma_phitheta: sp.Expr
    sigma_phiz: sp.Expr
    sigma_thetaz: sp.Expr


STRAIN = LayerStrains(*sp.symbols("e_phi e_theta e_z gamma_phi_theta gamma_phi_z gamma_theta_z", real=True))
STRESS = Stresses(*sp.symbols("sigma_phi sigma_theta sigma_z sigma_phi_theta sigma_phi_z sigma_theta_z", real=True))
DEFORMATION = Deformation(
    *sp.symbols("epsilon_phi epsilon_theta epsilon_phi_theta kappa_phi kappa_theta tau", real=True)
)


@cache
def full_energy_density() -> sp.Expr:
    """Return HRG paper eq. (3) per volume: ½ Σ σᵢ eᵢ, six stresses times six strains."""
    return sum(stress * strain for stress, strain in zip(STRESS, STRAIN, strict=True)) / 2


@cache
def thin_energy_density() -> sp.Expr:
    """Return HRG paper eq. (4) per volume: ½ (σ_φ e_φ + σ_θ e_θ + σ_φθ γ_φθ), with σ_z = 0 and γ_φz = γ_θz = 0 (Kirchhoff)."""
    return full_energy_density().subs({STRESS.sigma_z: 0, STRAIN.gamma_phiz: 0, STRAIN.gamma_thetaz: 0})


@cache
def hooke() -> dict[sp.Symbol, sp.Expr]:
    """Return HRG paper eq. (5), from e_φ = (σ_φ − νσ_θ)/E, e_θ = (σ_θ − νσ_φ)/E and γ_φθ = 2(1+ν) σ_φθ/E."""
    compliance = [
        (STRESS.sigma_phi - nu * STRESS.sigma_theta) / E - STRAIN.e_phi,
        (STRESS.sigma_theta - nu * STRESS.sigma_phi) / E - STRAIN.e_theta,
        2 * (1 + nu) * STRESS.sigma_phitheta / E - STRAIN.gamma_phitheta,
    ]
    solution = sp.solve(compliance, [STRESS.sigma_phi, STRESS.sigma_theta, STRESS.sigma_phitheta], dict=True)[0]
    plate = 1 - nu**2
    normal = {stress: sp.factor(solution[stress] * plate) / plate for stress in STRESS[:2]}
    return normal | {STRESS.sigma_phitheta: sp.factor(solution[STRESS.sigma_phitheta])}


@cache
def surface_energy_density() -> sp.Expr:
    """Return HRG paper eq. (7) per area: (5) and (6) in (4), integrated over −h/2 ≤ z ≤ h/2.

    Membrane E h/(2(1−ν²)) [ε_φ² + ε_θ² + 2ν ε_φ ε_θ + (1−ν)/2 ε_φθ²] plus bending
    E h³/(24(1−ν²)) [κ_φ² + κ_θ² + 2ν κ_φ κ_θ + 2(1−ν) τ²].
    """
    layer = thin_energy_density().subs(hooke()).subs(dict(zip(STRAIN, thin_layer_strains(DEFORMATION), strict=True)))
    integral = sp.expand(sp.integrate(sp.expand(layer), (z, -h / 2, h / 2)))
    membrane, bending = E * h / 2 / (1 - nu**2), E * h**3 / 24 / (1 - nu**2)
    brackets = [sp.expand(sp.cancel(integral.coeff(h, p) * h**p / scale)) for p, scale in ((1, membrane), (3, bending))]
    shears = [DEFORMATION.epsilon_phitheta**2, DEFORMATION.tau**2]
    stretching, curving = (sp.collect(bracket, shears) for bracket in brackets)
    return membrane * stretching + bending * curving


def surface_energy_of(deformation: Deformation) -> sp.Expr:
    """Return the energy per area (7) of a given deformation of the middle surface (J/m²)."""
    return surface_energy_density().subs(dict(zip(DEFORMATION, deformation, strict=True)), simultaneous=True)
