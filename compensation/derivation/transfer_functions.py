"""Transfer functions of the CVG paper on demodulated dynamics, eqs. (8)–(24), derived from its amplitude equations (7)."""

from functools import cache
from typing import NamedTuple

import sympy as sp

from compensation.derivation.demodulated import (
    A1,
    A2,
    amplitude_equations,
    g_2,
    k_1,
    k_2,
    q_10,
    rate,
    s,
    zeta_1,
    zeta_2,
)
from compensation.derivation.oscillator import omega, t

A_1, A_1R, A_1I = sp.symbols("A_1 A_1R A_1I")  # settled amplitude of the primary (m), and its real and imaginary part
lam = sp.Symbol("lambda", real=True)  # angular frequency of a rate that oscillates (rad/s)
k, zeta = sp.symbols("k zeta", positive=True)  # natural frequency (rad/s) and damping of two equal modes


class RealParts(NamedTuple):
    """Polynomials of (22): A₂ᵣ = (A₁ᵣ M_RR + A₁ᵢ M_RI) Ω/P and A₂ᵢ = (A₁ᵣ M_IR + A₁ᵢ M_II) Ω/P."""

    M_RR: sp.Expr
    M_RI: sp.Expr
    M_IR: sp.Expr
    M_II: sp.Expr
    P: sp.Expr


@cache
def settled_primary() -> sp.Expr:
    """Return A₁ at rest, eq. (8)."""
    still = amplitude_equations()[0].subs(A1(t), A_1).doit()
    return sp.solve(still, A_1)[0]


@cache
def settled_equation(slow: bool = False) -> sp.Expr:
    """Return left minus right of eq. (9), the second of (7) for a constant A₁; without Ä₂ where `slow`."""
    whole = amplitude_equations()[1].subs(A1(t), A_1).doit()
    return whole.subs(A2(t).diff(t, 2), 0) if slow else whole


@cache
def rate_to_secondary(slow: bool = False) -> sp.Expr:
    """Return W₂(s)/A₁ of (9) by Laplace's transformation, eq. (12); of its slow form eq. (16)."""
    image, wanted = sp.Symbol("image"), sp.exp(s * t)
    transformed = settled_equation(slow).subs({A2(t): image * wanted, rate: wanted}).doit()
    found = sp.solve(sp.expand(transformed / wanted), image)[0]
    top, bottom = sp.fraction(sp.together(found / A_1))
    return sp.collect(sp.expand(top), s) / sp.collect(sp.expand(bottom), s)


@cache
def poles() -> tuple[sp.Expr, ...]:
    """Return the poles of (12), eq. (15)."""
    ring, damped = sp.sqrt(zeta_2**2 - 1), sp.I * sp.sqrt(1 - zeta_2**2)
    found = sp.solve(sp.fraction(rate_to_secondary())[1], s)
    return tuple(sp.simplify(sp.expand(pole)).subs(ring, damped) for pole in found)


@cache
def slow_pole() -> sp.Expr:
    """Return the pole of (16), eq. (17)."""
    return sp.solve(sp.fraction(rate_to_secondary(slow=True))[1], s)[0]


@cache
def responses() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return W₂(jλ) = jq₁₀(λ + g₂ω)/(d₁d₂), eq. (13), and (14), A = q₁₀(λ + g₂ω)/√(|d₁|²|d₂|²), φ = atan2(Re d₁d₂, Im d₁d₂)."""
    shifted = lam + omega
    first = k_1**2 - omega**2 + 2 * sp.I * omega * zeta_1 * k_1
    second = k_2**2 - shifted**2 + 2 * sp.I * zeta_2 * k_2 * shifted
    top = q_10 * (lam + g_2 * omega)
    product = sp.expand_complex(first * second)
    sizes = [sp.re(one) ** 2 + sp.im(one) ** 2 for one in (first, second)]
    return sp.I * top / (first * second), top / sp.sqrt(sizes[0] * sizes[1]), sp.atan2(*product.as_real_imag())


@cache
def primary_parts() -> tuple[sp.Expr, sp.Expr]:
    """Return A₁ᵣ and A₁ᵢ, eq. (19)."""
    top, bottom = sp.fraction(settled_primary())
    real, imaginary = sp.expand(bottom).as_real_imag()
    size = real**2 + imaginary**2
    return sp.expand(top) * sp.factor(real) / size, -sp.expand(top) * sp.factor(imaginary) / size


@cache
def real_parts() -> RealParts:
    """Return the polynomials of (21), (22) from (20): A₂ = N D*/(a² + b²), D = a + jb, a = k₂² − ω² + 2k₂ζ₂s + s², b = 2ω(k₂ζ₂ + s)."""
    a = k_2**2 - omega**2 + 2 * k_2 * zeta_2 * s + s**2
    b = 2 * omega * (k_2 * zeta_2 + s)
    along, across = s * a + g_2 * omega * b, s * b - g_2 * omega * a
    return RealParts(along, across, -across, along, a**2 + b**2)


@cache
def tuned_gain() -> sp.Expr:
    """Return W₂₀(s), eq. (24): |A₁ jg₂ω/(2(kζ + jω))| over s + kζ, for equal modes and ω = k√(1 − 2ζ²)."""
    driven = k * sp.sqrt(1 - 2 * zeta**2)
    real, imaginary = sp.fraction(settled_primary())[1].subs({k_1: k, zeta_1: zeta}).as_real_imag()
    squared = 4 * (real**2 + imaginary**2) * ((k * zeta) ** 2 + omega**2)
    squared = sp.factor(sp.expand(squared.subs(omega, driven)))
    size = sp.refine(sp.sqrt(squared), sp.Q.negative(zeta - 1))
    return q_10 * g_2 * driven / (size * (s + k * zeta))
