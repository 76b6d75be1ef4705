"""The amplitude equations of the CVG paper on demodulated dynamics, eqs. (4)–(25), and their agreement with the averaged ones.

The paper keeps the second derivative of the amplitudes; where they vary slowly, the leading order of its eqs. (7) is
dX/dt, dY/dt of `averaging` with both axes of the anisotropies along the primary, less one term: the Coriolis force of
the secondary on the primary, which the paper neglects by its assumption (3).
"""

from functools import cache

import sympy as sp

from compensation.derivation.averaging import amplitude_rates, amplitudes
from compensation.derivation.oscillator import Omega, delta_omega, delta_tau, k, n, omega, psi_omega, psi_tau, t, tau

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
    case = {psi_tau: 0, psi_omega: 0, F: q_10, G: 0, n: g_2 / (2 * k)}
    return (amplitude_rates().subs(case) - slow_rates()).applyfunc(sp.simplify)


@cache
def measured_rate() -> sp.Expr:
    """Return W(s) = kζ/(s + kζ) of eq. (25), kζ = 1/τ, from the averaged equations: (s + 1/τ) Y = n k Ω X."""
    _, Y, _, G = amplitudes()
    tuned = {delta_tau: 0, delta_omega: 0, G: 0}
    secondary = sp.solve(s * Y - amplitude_rates()[1].subs(tuned), Y)[0]
    return sp.simplify(secondary / secondary.subs(s, 0))
