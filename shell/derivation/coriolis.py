"""The Bryan factor of the mode, from Lagrange's equations of the rotating shell's two patterns p(t), q(t), a quarter wave apart."""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.displacements import AMPLITUDES, Displacement, U, V, W, integrate_around
from shell.derivation.frequency import integrate_in_half_angle, mass_integral, mass_integrand
from shell.derivation.inextensional import inextensional_mode
from shell.derivation.strains import frame
from shell.derivation.symbols import Omega, n, phi, r, t, theta

p, q = sp.symbols("p q", cls=sp.Function)  # amplitudes of the two patterns, functions of time


class PatternCoefficients(NamedTuple):
    """Mass M and Coriolis coupling B per unit of φ, over ρ h: M p̈ − 2ΩB q̇ + … = 0, M q̈ + 2ΩB ṗ + … = 0."""

    M: sp.Expr
    B: sp.Expr


@cache
def two_patterns() -> Displacement:
    """Return u, w ∝ p cos nθ + q sin nθ and v ∝ p sin nθ − q cos nθ: the mode and itself turned by 90°/n."""
    cosine, sine = sp.cos(n * theta), sp.sin(n * theta)
    even, odd = p(t) * cosine + q(t) * sine, p(t) * sine - q(t) * cosine
    return Displacement(U(phi) * even, V(phi) * odd, W(phi) * even)


@cache
def turning_kinetic_energy() -> sp.Expr:
    """Return the kinetic energy per unit of φ over ρ h, to first order in Ω: quadratic terms of ½ ∫ |ḋ + Ω e_z × (x + d)|² dA."""
    displacement = sp.Matrix([list(two_patterns())])
    velocity = displacement.diff(t)
    axis = (frame() * sp.Matrix([0, 0, 1])).T
    coriolis = Omega * axis.dot(displacement.cross(velocity))
    density = velocity.dot(velocity) / 2 + coriolis
    return integrate_around(density) * r**2 * sp.sin(phi)


@cache
def pattern_coefficients() -> PatternCoefficients:
    """Return M = π (U² + V² + W²) r² sin φ and B = −2π V (U cos φ + W sin φ) r² sin φ by Lagrange's equation of p."""
    energy = turning_kinetic_energy()
    momentum_rate = sp.diff(energy, p(t).diff(t)).diff(t)
    inertia = sp.expand(momentum_rate - sp.diff(energy, p(t)))
    mass = inertia.coeff(p(t).diff(t, 2))
    coupling = -inertia.coeff(q(t).diff(t)) / (2 * Omega)
    return PatternCoefficients(sp.factor(mass), sp.factor(coupling))


@cache
def precession_rate() -> sp.Expr:
    """Return the rate of the pattern's azimuth over −Ω: K = B / (n M).

    With y = p + iq the two equations are M ÿ + 2iΩB ẏ + Mω² y = 0, and y = exp(iλt) has the rates
    λ = −ΩB/M ± ω (to first order): the (p, q) plane turns by −ΩB/M, and its turn by nα turns the pattern by α.
    """
    mass, coupling, natural = sp.symbols("M B omega", positive=True)
    rate = sp.Symbol("lambda", real=True)
    characteristic = -mass * rate**2 - 2 * Omega * coupling * rate + mass * natural**2
    forward, backward = sp.solve(characteristic, rate)
    drift = (forward + backward) / 2
    return sp.simplify(-drift / (n * Omega))


@cache
def coriolis_integrand() -> sp.Expr:
    """Return the integrand of N in K = N/J: B/(nM) of the inextensional mode gives 2 sin³φ tan²ⁿ(φ/2)."""
    mode = dict(zip(AMPLITUDES, inextensional_mode(), strict=True))
    coefficients = pattern_coefficients()
    mass = coefficients.M.subs(mode) / mass_integrand()
    ratio = sp.simplify(coefficients.B.subs(mode) / (n * sp.simplify(mass) * sp.tan(phi / 2) ** (2 * n)))
    return ratio * sp.tan(phi / 2) ** (2 * n)


@cache
def bryan_factor(harmonic: int, start: sp.Expr = sp.S.Zero, end: sp.Expr = sp.pi / 2) -> sp.Expr:
    """Return K = 2 ∫ sin³φ tan²ⁿ(φ/2) dφ / J in closed form; 0.27699 for n = 2 on the hemisphere."""
    coriolis = integrate_in_half_angle(coriolis_integrand().subs(n, harmonic), start, end)
    return coriolis / mass_integral(harmonic, start, end)
