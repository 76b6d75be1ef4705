"""Displacements of a vibrating shell of revolution and their kinetic energy: HRG paper eqs. (1), (2)."""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.symbols import h, n, omega, phi, phi_1, phi_2, r, rho, t, theta

U, V, W = sp.symbols("U V W", cls=sp.Function)
"""Amplitudes along the meridian, around the axis and along the outward normal, functions of φ."""


class Displacement(NamedTuple):
    """Displacement u along the meridian, v around the axis, w along the outward normal (m)."""

    u: sp.Expr
    v: sp.Expr
    w: sp.Expr


@cache
def general_displacement() -> Displacement:
    """Return u, v, w as unknown functions of φ and θ."""
    return Displacement(*(sp.Function(name)(phi, theta) for name in "uvw"))


AMPLITUDES = Displacement(U(phi), V(phi), W(phi))


def with_angles(shape: Displacement) -> Displacement:
    """Return U cos nθ, V sin nθ, W cos nθ of amplitudes U, V, W."""
    cosine, sine = sp.cos(n * theta), sp.sin(n * theta)
    return Displacement(shape.u * cosine, shape.v * sine, shape.w * cosine)


@cache
def harmonic_displacement(shape: Displacement = AMPLITUDES) -> Displacement:
    """Return HRG paper eq. (1): u = U(φ) cos nθ cos ωt, v = V(φ) sin nθ cos ωt, w = W(φ) cos nθ cos ωt."""
    return Displacement(*(part * sp.cos(omega * t) for part in with_angles(shape)))


def kinetic_energy(displacement: Displacement) -> sp.Expr:
    """Return HRG paper eq. (2): K = ½ ρ h ∫∫ (u̇² + v̇² + ẇ²) r² sin φ dθ dφ, the integral over θ done."""
    speed_squared = sum(sp.diff(component, t) ** 2 for component in displacement)
    around = sp.factor(integrate_around(speed_squared))
    return rho * h * r**2 / 2 * sp.Integral(around * sp.sin(phi), (phi, phi_1, phi_2))


def integrate_around(density: sp.Expr) -> sp.Expr:
    """Return ∫₀^{2π} of a quadratic form in cos nθ and sin nθ, for which ∫cos² = ∫sin² = π and ∫sin·cos = 0."""
    cosine, sine = sp.symbols("cosine sine")
    form = sp.expand(sp.expand(density).subs({sp.cos(n * theta): cosine, sp.sin(n * theta): sine}))
    polynomial = sp.Poly(form, cosine, sine)
    if form.has(theta) or any(sum(powers) != 2 for powers in polynomial.monoms()):
        raise ValueError("the density is not a quadratic form in cos nθ and sin nθ")
    return sp.pi * (polynomial.coeff_monomial(cosine**2) + polynomial.coeff_monomial(sine**2))
