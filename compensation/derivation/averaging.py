"""From the oscillator to slow variables: complex amplitudes, then amplitude a, quadrature q, angle ψ and phase φ.

    x = Re{X e^{iωt}}, y = Re{Y e^{iωt}},     (X, Y) = R(ψ) (a, −i q) e^{iφ}

The orbit is an ellipse of half axes a and q at the angle ψ of the plane. Variation of parameters makes q̈ + ω² q = g
exact equations for X and Y; their mean over one cycle is the averaged dynamics, to first order in 1/(ωτ), Δω/ω, Ω/ω.
"""

from functools import cache
from typing import NamedTuple

import sympy as sp
from sympy.simplify.fu import TR8

from compensation.derivation.oscillator import Omega, k, n, omega, small_forces

a, q = sp.symbols("a q", real=True)  # half axes of the orbit (m): amplitude of the antinode, and quadrature
psi, phi = sp.symbols("psi phi", real=True)
"""Angle of the orbit in the plane, n θ, and phase of the vibration against ωt (rad)."""
u_a, u_phi, u_r, u_q = sp.symbols("u_a u_phi u_r u_q", real=True)
"""Forces of the four loops over 2ω (m/s): on amplitude, phase, rate and quadrature."""


class Rates(NamedTuple):
    """Rates of amplitude and quadrature (m/s), of the pattern's angle and of the phase (rad/s)."""

    a: sp.Expr
    q: sp.Expr
    psi: sp.Expr
    phi: sp.Expr


@cache
def amplitude_rates() -> sp.Matrix:
    """Return dX/dt, dY/dt by averaging over one cycle: Ẋ_c = −g sin ωt/ω, Ẋ_s = −g cos ωt/ω, with forces F = Re{F e^{iωt}}."""
    parts = {name: sp.symbols(f"{name}_c {name}_s", real=True) for name in "XYFG"}
    cosine, sine = sp.symbols("cosine sine", real=True)  # of ωt

    def oscillation(name: str, turned: bool = False) -> sp.Expr:
        c, s = parts[name]
        return -omega * (c * sine + s * cosine) if turned else c * cosine - s * sine

    position = sp.ImmutableMatrix([oscillation("X"), oscillation("Y")])
    velocity = sp.ImmutableMatrix([oscillation("X", True), oscillation("Y", True)])
    force = sp.ImmutableMatrix([oscillation("F"), oscillation("G")])
    g = small_forces(position, velocity, force)

    def mean(expression: sp.Expr) -> sp.Expr:
        terms = sp.Poly(sp.expand(expression), cosine, sine).terms()
        return sum((coefficient * mean_over_cycle(*powers) for powers, coefficient in terms), sp.S.Zero)

    rates = [mean(-g[row] * sine / omega) + sp.I * mean(-g[row] * cosine / omega) for row in (0, 1)]
    complex_names = dict(zip("XYFG", amplitudes(), strict=True))
    joined: dict[sp.Expr, sp.Expr] = {}
    for name, (c, s) in parts.items():
        whole = complex_names[name]
        joined |= {c: (whole + sp.conjugate(whole)) / 2, s: (whole - sp.conjugate(whole)) / (2 * sp.I)}
    return sp.Matrix([sp.expand(sp.expand(rate).subs(joined)) for rate in rates])


@cache
def mean_over_cycle(cosines: int, sines: int) -> sp.Expr:
    """Return the mean of cosᵐ ωt sinˡ ωt over one cycle."""
    angle = sp.Symbol("angle", real=True)
    return sp.integrate(sp.cos(angle) ** cosines * sp.sin(angle) ** sines, (angle, 0, 2 * sp.pi)) / (2 * sp.pi)


@cache
def amplitudes() -> tuple[sp.Symbol, ...]:
    """Return the complex amplitudes X, Y (m) of the motion and F, G (m/s²) of the force per modal mass."""
    return tuple(sp.symbols("X Y F G", complex=True))


@cache
def amplitude_matrix() -> sp.Matrix:
    """Return M of (Ẋ, Ẏ) = M (X, Y) − i (F, G)/(2ω): n k Ω J − 1/τ − ½ Δ(1/τ) S(ψ_τ) + ½ i Δω S(ψ_ω)."""
    X, Y, _, _ = amplitudes()
    return amplitude_rates().jacobian([X, Y])


@cache
def ellipse_rates() -> Rates:
    """Return ȧ, q̇, ψ̇, φ̇: Lynch's form, with the forces of the four loops.

    ȧ = −a/τ − ½ Δ(1/τ) a cos 2(ψ−ψ_τ) − ½ Δω q sin 2(ψ−ψ_ω) + u_a
    q̇ = −q/τ + ½ Δ(1/τ) q cos 2(ψ−ψ_τ) + ½ Δω a sin 2(ψ−ψ_ω) + u_q
    ψ̇ = n k Ω + [½ Δ(1/τ) (a²+q²) sin 2(ψ−ψ_τ) − Δω a q cos 2(ψ−ψ_ω) + a u_r − q u_φ] / (a²−q²)
    φ̇ = [½ Δω (a²+q²) cos 2(ψ−ψ_ω) − Δ(1/τ) a q sin 2(ψ−ψ_τ) + a u_φ − q u_r] / (a²−q²)

    With r = R(−ψ) e^{−iφ} (Ẋ, Ẏ): r₁ = ȧ + i (a φ̇ + q ψ̇), r₂ = −i q̇ + q φ̇ + a ψ̇, solved for the four rates. The
    loops' forces act in the frame of the wave: r₁ gains u_a + i u_φ, r₂ gains u_r − i u_q.
    """
    turn = sp.Matrix([[sp.cos(psi), -sp.sin(psi)], [sp.sin(psi), sp.cos(psi)]])
    orbit = sp.Matrix([a, -sp.I * q])
    turned = (turn.T * amplitude_matrix() * turn).applyfunc(lambda entry: sp.expand(TR8(sp.expand(entry))))
    r = turned * orbit + sp.Matrix([u_a + sp.I * u_phi, u_r - sp.I * u_q])
    (along, across), (along_i, across_i) = zip(*(sp.expand(entry).as_real_imag() for entry in r), strict=True)
    size, coriolis = a**2 - q**2, n * k * Omega
    angle = sp.expand(a * across - q * along_i - coriolis * size) / size
    phase = sp.expand(a * along_i - q * across) / size
    return Rates(along, sp.expand(-across_i), coriolis + angle, phase)
