"""Strain energy of the shell, from three-dimensional elasticity to the middle surface: HRG paper eqs. (3)–(5), (7)."""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.strains import Deformation, LayerStrains, thin_layer_strains
from shell.derivation.symbols import E, h, nu, z


class Stresses(NamedTuple):
    """Stresses in a layer of the shell (Pa); the normal one across the shell is zero."""

    sigma_phi: sp.Expr
    sigma_theta: sp.Expr
    sigma_phitheta: sp.Expr


STRAIN = LayerStrains(*sp.symbols("e_phi e_theta e_z gamma_phitheta gamma_phiz gamma_thetaz", real=True))
DEFORMATION = Deformation(
    *sp.symbols("epsilon_phi epsilon_theta epsilon_phitheta kappa_phi kappa_theta tau", real=True)
)


@cache
def full_energy_density() -> sp.Expr:
    """Return HRG paper eq. (3) per volume: ½ Σ (σᵢ eᵢ + τᵢ γᵢ), six stresses times six strains."""
    stresses = sp.symbols("sigma_phi sigma_theta sigma_z tau_phitheta tau_phiz tau_thetaz", real=True)
    return sum(stress * strain for stress, strain in zip(stresses, STRAIN, strict=True)) / 2


@cache
def hooke() -> Stresses:
    """Return HRG paper eq. (5), solved from e_φ = (σ_φ − νσ_θ)/E, e_θ = (σ_θ − νσ_φ)/E, γ = 2(1+ν) σ_φθ/E."""
    sigma = sp.symbols("sigma_phi sigma_theta sigma_phitheta", real=True)
    compliance = [
        (sigma[0] - nu * sigma[1]) / E - STRAIN.e_phi,
        (sigma[1] - nu * sigma[0]) / E - STRAIN.e_theta,
        2 * (1 + nu) * sigma[2] / E - STRAIN.gamma_phitheta,
    ]
    solution = sp.solve(compliance, sigma, dict=True)[0]
    return Stresses(*(sp.factor(solution[symbol]) for symbol in sigma))


@cache
def energy_density() -> sp.Expr:
    """Return HRG paper eq. (4) per volume with (5): ½ (σ_φ e_φ + σ_θ e_θ + σ_φθ γ_φθ).

    Kirchhoff's hypothesis has removed σ_z (no pressure across a thin shell) and γ_φz, γ_θz from (3).
    """
    stress = hooke()
    work = (
        stress.sigma_phi * STRAIN.e_phi
        + stress.sigma_theta * STRAIN.e_theta
        + stress.sigma_phitheta * STRAIN.gamma_phitheta
    )
    return work / 2


@cache
def surface_energy_density() -> sp.Expr:
    """Return HRG paper eq. (7) per area: the strains (6) in (4), (5), integrated over −h/2 ≤ z ≤ h/2.

    Membrane E h/(2(1−ν²)) [ε_φ² + ε_θ² + 2ν ε_φ ε_θ + (1−ν)/2 ε_φθ²] plus bending
    E h³/(24(1−ν²)) [κ_φ² + κ_θ² + 2ν κ_φ κ_θ + 2(1−ν) τ²].
    """
    through = energy_density().subs(dict(zip(STRAIN, thin_layer_strains(DEFORMATION), strict=True)))
    integral = sp.integrate(sp.expand(through), (z, -h / 2, h / 2))
    return sum(sp.factor(sp.expand(integral).coeff(h, power)) * h**power for power in (1, 3))


def surface_energy_of(deformation: Deformation) -> sp.Expr:
    """Return the energy per area (7) of a given deformation of the middle surface (J/m²)."""
    return surface_energy_density().subs(dict(zip(DEFORMATION, deformation, strict=True)), simultaneous=True)
