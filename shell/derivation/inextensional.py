"""The inextensional mode: HRG paper eqs. (9)–(11), separated in P = U + V, M = U − V and integrated in T = tan(φ/2)."""

from functools import cache

import sympy as sp

from shell.derivation.displacements import AMPLITUDES, Displacement, U, V, W, harmonic_displacement, with_angles
from shell.derivation.strains import Deformation, corrected_deformation
from shell.derivation.symbols import C, in_half_angle, n, phi, r, tan_half, theta

P, M = sp.symbols("P M", cls=sp.Function)  # P = U + V and M = U − V


@cache
def inextensional_conditions() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return HRG paper eq. (9) for one harmonic, each expression to be zero: ε_φ, ε_θ, ε_φθ without their angles."""
    strain = corrected_deformation(with_angles(AMPLITUDES))
    return (
        sp.expand(r * strain.epsilon_phi / sp.cos(n * theta)),
        sp.expand(r * sp.sin(phi) * strain.epsilon_theta / sp.cos(n * theta)),
        sp.expand(r * sp.sin(phi) * strain.epsilon_phitheta / sp.sin(n * theta)),
    )


@cache
def eliminate_normal_displacement() -> tuple[sp.Expr, sp.Expr]:
    """Return the pair left when ε_φ = 0 gives W = −U′: sin φ U′ − cos φ U − nV = 0, sin φ V′ − cos φ V − nU = 0."""
    meridional, circumferential, shear = inextensional_conditions()
    normal = sp.solve(meridional, W(phi))[0]
    return -sp.expand(circumferential.subs(W(phi), normal)), sp.expand(shear)


@cache
def decoupled_equations() -> tuple[sp.Expr, sp.Expr]:
    """Return sum and difference of the pair: sin φ P′ − (cos φ + n) P = 0 and sin φ M′ − (cos φ − n) M = 0."""
    first, second = eliminate_normal_displacement()
    new = {U(phi): (P(phi) + M(phi)) / 2, V(phi): (P(phi) - M(phi)) / 2}
    return tuple(sp.expand((first + sign * second).subs(new).doit()) for sign in (1, -1))


@cache
def separated_rates() -> tuple[sp.Expr, sp.Expr]:
    """Return d ln P/dφ = (cos φ + n)/sin φ and d ln M/dφ = (cos φ − n)/sin φ: variables separated."""
    rates = []
    for equation, function in zip(decoupled_equations(), (P, M), strict=True):
        slope = sp.solve(equation, function(phi).diff(phi))[0]
        rates.append(sp.simplify(slope / function(phi)))
    return rates[0], rates[1]


@cache
def integrate_separated() -> tuple[sp.Expr, sp.Expr]:
    """Return ln P and ln M as functions of T = tan(φ/2), up to a constant, by dφ = 2 dT/(1+T²): (1 ± n) ln T − ln(1 + T²)."""
    logarithms = []
    for rate in separated_rates():
        by_half_angle = in_half_angle(rate) * 2 / (1 + tan_half**2)
        fractions = sp.apart(sp.cancel(by_half_angle), tan_half)
        logarithms.append(sum(sp.integrate(term, tan_half) for term in sp.Add.make_args(fractions)))
    return logarithms[0], logarithms[1]


@cache
def general_solution() -> tuple[sp.Expr, sp.Expr]:
    """Return P ∝ sin φ tanⁿ(φ/2) and M ∝ sin φ tan⁻ⁿ(φ/2), the exponentials of the two logarithms, by T/(1+T²) = ½ sin φ."""
    solutions = []
    for logarithm in integrate_separated():
        power = sp.expand(sp.powsimp(sp.exp(sp.expand(logarithm)))) * 2
        rest = sp.powsimp(sp.simplify(power * (1 + tan_half**2) / (2 * tan_half)))
        solutions.append(sp.sin(phi) * rest.subs(tan_half, sp.tan(phi / 2)))
    return solutions[0], solutions[1]


@cache
def pole_exponents() -> tuple[sp.Expr, sp.Expr]:
    """Return the powers of φ with which P and M start at the pole, 1 + n and 1 − n: for n ≥ 2 a closed pole asks for M = 0, U = V."""
    rates = separated_rates()
    return sp.limit(phi * rates[0], phi, 0), sp.limit(phi * rates[1], phi, 0)


@cache
def inextensional_mode() -> Displacement:
    """Return HRG paper eq. (10): U = V = C sin φ tanⁿ(φ/2), W = −U′ = −C (n + cos φ) tanⁿ(φ/2), by U′ = U (cos φ + n)/sin φ."""
    tangential = C * general_solution()[0]
    return Displacement(tangential, tangential, -tangential * separated_rates()[0])


@cache
def inextensional_displacement() -> Displacement:
    """Return HRG paper eq. (11): (10) in (1), with cos nθ, sin nθ and cos ωt."""
    return harmonic_displacement(inextensional_mode())


@cache
def mode_deformation() -> Deformation:
    """Return (8) of the mode (10) at maximum displacement: no strain, κ_φ = −κ_θ = k cos nθ, τ = −k sin nθ.

    k = C n(n²−1) tanⁿ(φ/2) / (r² sin²φ).
    """
    deformation = corrected_deformation(with_angles(inextensional_mode()))
    return Deformation(*(_simplify_in_half_angle(part) for part in deformation))


def _simplify_in_half_angle(expression: sp.Expr) -> sp.Expr:
    """Return the expression as (coefficient) · tanⁿ(φ/2)/sin²φ where the coefficient is free of φ."""
    profile = sp.tan(phi / 2) ** n / sp.sin(phi) ** 2
    coefficient = sp.factor(sp.simplify(in_half_angle(sp.expand(expression / profile))))
    if coefficient.has(tan_half):
        raise ValueError("the expression is not a multiple of tanⁿ(φ/2)/sin²φ")
    return coefficient * profile
