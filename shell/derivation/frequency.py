"""Energies of the inextensional mode and its frequency: HRG paper eqs. (12)–(14), with I and J in closed form."""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.displacements import integrate_around, kinetic_energy
from shell.derivation.energies import surface_energy_of
from shell.derivation.inextensional import inextensional_displacement, inextensional_mode, mode_deformation
from shell.derivation.symbols import C, E, h, in_half_angle, n, nu, omega, phi, phi_1, phi_2, r, rho, t, tan_half

I, J = sp.symbols("I J", real=True)  # the shape integrals of bending and of mass


class LogDerivatives(NamedTuple):
    """Derivatives of ln f by ln E, ν, ln ρ, ln h, ln r (no unit) and φ₂ (1/rad)."""

    E: sp.Expr
    nu: sp.Expr
    rho: sp.Expr
    h: sp.Expr
    r: sp.Expr
    phi_2: sp.Expr


@cache
def mass_integrand() -> sp.Expr:
    """Return the integrand of J in (12): (U² + V² + W²) sin φ/C² = [(n + cos φ)² + 2 sin²φ] sin φ tan²ⁿ(φ/2)."""
    power = sp.tan(phi / 2) ** n
    profiles = (sp.simplify(-component / (C * power)) for component in inextensional_mode())
    return sum(profile**2 for profile in profiles) * sp.sin(phi) * power**2


@cache
def bending_integrand() -> sp.Expr:
    """Return the integrand of I, tan²ⁿ(φ/2)/sin³φ, from the bending energy (7) of the mode's curvatures."""
    return sp.powsimp(_bending_energy_density() / _bending_scale())


@cache
def maximum_kinetic_energy() -> sp.Expr:
    """Return HRG paper eq. (12), left: K_max = ½ π ρ h r² ω² C² J."""
    swinging = kinetic_energy(inextensional_displacement())
    integral = swinging.atoms(sp.Integral).pop()
    scale = sp.simplify(swinging.subs(integral, integral.function) / mass_integrand())
    return scale.subs(t, sp.pi / (2 * omega)) * J


@cache
def maximum_potential_energy() -> sp.Expr:
    """Return HRG paper eq. (12), right: U_max = π E h³ n²(n²−1)² C² I / (6 (1+ν) r²)."""
    return _bending_scale() * I


@cache
def omega_squared() -> sp.Expr:
    """Return HRG paper eq. (13), from K_max = U_max: ω² = n²(n²−1)² E h² I / (3 (1+ν) ρ r⁴ J)."""
    square = sp.Symbol("omega_squared")
    balance = maximum_kinetic_energy().subs(omega**2, square) - maximum_potential_energy()
    return sp.factor(sp.solve(balance, square)[0])


@cache
def frequency(harmonic: sp.Expr = n) -> sp.Expr:
    """Return f = ω/2π in Hz of (13) for any harmonic; with harmonic 2, HRG paper eq. (14)."""
    scale = n * (n**2 - 1) * h / r**2
    root = sp.sqrt(sp.simplify(omega_squared() / scale**2))
    return (scale * root / (2 * sp.pi)).subs(n, harmonic)


@cache
def bending_integral(harmonic: int, start: sp.Expr = sp.S.Zero, end: sp.Expr = sp.pi / 2) -> sp.Expr:
    """Return I in closed form over start ≤ φ ≤ end; on the hemisphere 7/24, 17/96, 31/240 for n = 2, 3, 4."""
    return integrate_in_half_angle(bending_integrand().subs(n, harmonic), start, end)


@cache
def mass_integral(harmonic: int, start: sp.Expr = sp.S.Zero, end: sp.Expr = sp.pi / 2) -> sp.Expr:
    """Return J in closed form over start ≤ φ ≤ end; on the hemisphere 20 ln 2 − 37/3 for n = 2."""
    return integrate_in_half_angle(mass_integrand().subs(n, harmonic), start, end)


def integrate_in_half_angle(integrand: sp.Expr, start: sp.Expr, end: sp.Expr) -> sp.Expr:
    """Return ∫ integrand dφ of a function rational in T = tan(φ/2), by partial fractions with dφ = 2 dT/(1+T²)."""
    rational = sp.cancel(in_half_angle(integrand) * 2 / (1 + tan_half**2))
    antiderivative = sp.integrate(sp.apart(rational, tan_half), tan_half)
    ends = [antiderivative.subs(tan_half, sp.tan(sp.sympify(angle) / 2)) for angle in (start, end)]
    return sp.expand(ends[1] - ends[0])


@cache
def log_derivatives() -> LogDerivatives:
    """Return d ln f by d ln E, dν, d ln ρ, d ln h, d ln r and dφ₂; ∂I/∂φ₂ is the integrand of I at φ₂ (Leibniz), the same for J."""
    logarithm = sp.log(frequency())
    by_logarithm = {symbol: sp.simplify(symbol * logarithm.diff(symbol)) for symbol in (E, rho, h, r)}
    at_rim = {one: integrand.subs(phi, phi_2) for one, integrand in ((I, bending_integrand()), (J, mass_integrand()))}
    rim = sum(sp.simplify(logarithm.diff(integral)) * slope for integral, slope in at_rim.items())
    return LogDerivatives(
        E=by_logarithm[E], nu=sp.factor(logarithm.diff(nu)), rho=by_logarithm[rho], h=by_logarithm[h],
        r=by_logarithm[r], phi_2=rim,
    )  # fmt: skip


@cache
def integral_definitions() -> tuple[sp.Integral, sp.Integral]:
    """Return I and J as integrals over the shell's range φ₁…φ₂ for any harmonic."""
    return (sp.Integral(bending_integrand(), (phi, phi_1, phi_2)), sp.Integral(mass_integrand(), (phi, phi_1, phi_2)))


@cache
def _bending_energy_density() -> sp.Expr:
    """Return the energy (7) of the mode per unit of φ, the integral over θ done."""
    return sp.factor(integrate_around(surface_energy_of(mode_deformation()))) * r**2 * sp.sin(phi)


@cache
def _bending_scale() -> sp.Expr:
    """Return what stands in front of I: the density over its profile tan²ⁿ(φ/2)/sin³φ, free of φ."""
    profile = sp.tan(phi / 2) ** (2 * n) / sp.sin(phi) ** 3
    scale = sp.factor(sp.simplify(_bending_energy_density() / profile))
    if scale.has(phi):
        raise ValueError("the bending energy is not a multiple of tan²ⁿ(φ/2)/sin³φ")
    return scale
