"""Filters in symbols: the optimal ones of the paper on demodulated dynamics, and the tuned gyro's of that on cross-damping."""

from dataclasses import dataclass
from functools import cache
from typing import Literal

import sympy as sp

from compensation.derivation.demodulated import s

k, zeta, gamma, B = sp.symbols("k zeta gamma B", positive=True)
"""Natural frequency (rad/s) and damping of both modes; noise over signal, and the band B (rad/s) of the rate."""
g_2 = sp.Symbol("g_2", positive=True)  # coefficient of the Coriolis force


@dataclass(frozen=True)
class WienerDerivation:
    """The factor Δ of the output's density, the optimum G, and G renormalised."""

    factor: sp.Expr
    optimum: sp.Expr
    renormalised: sp.Expr


@cache
def derive_wiener_filter(noise: Literal["white", "high-pass"]) -> WienerDerivation:
    """Derive eq. (35) or (36): Δ Δ* = p s⁴ − q s² + r has Δ = √p s² + √(q + 2√(p r)) s + √r, the causal part is a residue at −B."""
    a = k * zeta
    square = (B * a) ** 2 + gamma**2 * (a**2 - s**2) * (B**2 - s**2 if noise == "white" else -(s**2))
    p, _, q, _, r = sp.Poly(sp.expand(square), s).all_coeffs()
    root_r = sp.sqrt(sp.factor(r))
    Delta = sp.sqrt(p) * s**2 + sp.sqrt(sp.factor(2 * sp.sqrt(p) * root_r - q)) * s + root_r
    # Here t d_b is constant for both noises: with (29) the factor B + s of d_b cancels one of Δ.
    residue = sp.simplify(B**2 * a / Delta.subs(s, -s).subs(s, -B))
    optimum = residue * (s + a) / Delta
    return WienerDerivation(Delta, optimum, sp.simplify(optimum / optimum.subs(s, 0)))


@cache
def tuned_cross_damping() -> sp.Expr:
    """Return eq. (9) of the paper on cross-damping, rate per ζ₁₂, from its (8) under ω = k √(1 − 2ζ²) and equal modes."""
    omega = k * sp.sqrt(1 - 2 * zeta**2)
    stiffness, j = k**2 - omega**2, sp.I
    general = (
        2
        * k
        * (stiffness + 2 * j * k * omega * zeta)
        / (g_2 * (stiffness + 2 * k * zeta * s + 2 * j * omega * (s + k * zeta)))
    )
    return sp.factor(sp.simplify(sp.expand(general)))
