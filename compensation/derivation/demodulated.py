"""The CVG paper on demodulated dynamics: amplitude equations (4)–(7), their agreement with the averaged ones, transfer functions (8)–(25).

The paper keeps the second derivative of the amplitudes; where they vary slowly, the leading order of its eqs. (7) is
dX/dt, dY/dt of `averaging` with both axes of the anisotropies along the primary, less one term: the Coriolis force of
the secondary on the primary, which the paper neglects by its assumption (3).
"""

from functools import cache
from typing import NamedTuple

import sympy as sp

from compensation.derivation.averaging import amplitude_rates, amplitudes
from compensation.derivation.oscillator import Omega, delta_omega, delta_tau, n, omega, psi_omega, psi_tau, t, tau
from compensation.derivation.oscillator import k as bryan_factor

A1, A2 = sp.symbols("A_1 A_2", cls=sp.Function)  # complex amplitudes of primary and secondary (m), functions of time
rate = sp.Function("Omega")(t)  # angular rate that varies (rad/s)
k_1, k_2 = sp.symbols("k_1 k_2", positive=True)  # natural frequencies of primary and secondary (rad/s)
zeta_1, zeta_2 = sp.symbols("zeta_1 zeta_2", positive=True)  # relative damping
g_2 = sp.Symbol("g_2", real=True)  # coefficient of the Coriolis force, 2 n k of a shell
q_10 = sp.Symbol("q_10", real=True)  # amplitude of the excitation (m/s²)
s = sp.Symbol("s")  # Laplace's variable (1/s)


@cache
def amplitude_equations() -> tuple[sp.Expr, sp.Expr]:
    """Return left minus right of eqs. (7), from the motion equations (4) by x = Im{A e^{jωt}}."""
    carrier = sp.exp(sp.I * omega * t)
    x1, x2 = A1(t) * carrier, A2(t) * carrier
    primary = x1.diff(t, 2) + 2 * zeta_1 * k_1 * x1.diff(t) + k_1**2 * x1 - q_10 * carrier
    secondary = (
        x2.diff(t, 2) + 2 * zeta_2 * k_2 * x2.diff(t) + k_2**2 * x2 - g_2 * rate * x1.diff(t) - rate.diff(t) * x1
    )
    return sp.expand(primary / carrier), sp.expand(secondary / carrier)


@cache
def slow_rates() -> sp.Matrix:
    """Return dA₁/dt, dA₂/dt to leading order in slow changes: damping 1/τ ± ½ Δ(1/τ), detuning ± ½ Δω, rate, drive."""
    order = sp.Symbol("epsilon", positive=True)
    slow = [sp.Symbol(f"{name}{dots}") for name in "XY" for dots in ("", "'", "''")]
    scaled = {
        A1(t).diff(t, 2): order**2 * slow[2], A2(t).diff(t, 2): order**2 * slow[5],
        A1(t).diff(t): order * slow[1], A2(t).diff(t): order * slow[4],
        rate.diff(t): order**2 * sp.Symbol("Omega'"), A1(t): slow[0], A2(t): slow[3], rate: order * Omega,
        q_10: order * q_10,
    }  # fmt: skip
    damping = order / tau, order * delta_tau / 2
    detuned = {k_1: omega + order * delta_omega / 2, k_2: omega - order * delta_omega / 2}
    rows = []
    for equation, zeta, sign, unknown in zip(
        amplitude_equations(), (zeta_1, zeta_2), (1, -1), (slow[1], slow[4]), strict=True
    ):
        natural = k_1 if zeta is zeta_1 else k_2
        given = equation.subs(zeta, (damping[0] + sign * damping[1]) / natural)
        for old, new in (scaled | detuned).items():
            given = given.subs(old, new)
        leading = sp.expand(given).coeff(order, 1)
        rows.append(sp.solve(leading, unknown)[0])
    X, Y, _, _ = amplitudes()
    return sp.Matrix(rows).subs({slow[0]: X, slow[3]: Y}).applyfunc(sp.expand)


@cache
def neglected() -> sp.Matrix:
    """Return the averaged rates less the paper's: (−½ g₂ Ω A₂, 0), the reaction that assumption (3) leaves out."""
    _, _, F, G = amplitudes()
    # the excitation Im{q₁₀ e^{jωt}} drives the primary only
    case = {psi_tau: 0, psi_omega: 0, F: q_10, G: 0, n: g_2 / (2 * bryan_factor)}
    return (amplitude_rates().subs(case) - slow_rates()).applyfunc(sp.simplify)


@cache
def measured_rate() -> sp.Expr:
    """Return W(s) = kζ/(s + kζ) of eq. (25), kζ = 1/τ, from the averaged equations: (s + 1/τ) Y = n k Ω X."""
    _, Y, _, G = amplitudes()
    tuned = {delta_tau: 0, delta_omega: 0, G: 0}
    secondary = sp.solve(s * Y - amplitude_rates()[1].subs(tuned), Y)[0]
    return sp.simplify(secondary / secondary.subs(s, 0))


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
