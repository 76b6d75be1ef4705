"""The bell's theory as one numbered chain of equations: BVG paper eqs. (1)–(22), beside what its copy prints."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import sympy as sp
from sympy.core.function import AppliedUndef

from shell.derivation import bell, bell_dynamics, energies
from shell.derivation.chain import Step, name_expressions, pair_up, set_to_zero
from shell.derivation.coriolis import pattern_coefficients
from shell.derivation.symbols import n, omega, phi


@cache
def bell_steps() -> tuple[Step, ...]:
    """Return the chain in the paper's order; a step that the copy prints otherwise says how."""
    whole = (*_shape(), *_elasticity(), *_motion(), *_pattern(), *_model())
    return tuple(
        replace(step, equations=pair_up((shorten(one.lhs), shorten(one.rhs)) for one in step.equations))
        for step in whole
    )


def shorten(equation: sp.Expr) -> sp.Expr:
    """Return an expression with functions written without their arguments, and derivatives behind a comma: σ_φυ,z for ∂σ_φυ/∂z."""
    derivatives = {
        one: sp.Symbol(f"{one.expr.func.__name__},{''.join(v.name * int(times) for v, times in one.variable_count)}")
        for one in equation.atoms(sp.Derivative)
        if isinstance(one.expr, AppliedUndef)
    }
    plain = equation.xreplace(derivatives)
    return plain.xreplace({one: sp.Symbol(one.func.__name__) for one in plain.atoms(AppliedUndef)})


def _shape() -> list[Step]:
    radii = bell.principal_radii()
    return [
        Step("1", "Meridian: hemisphere, cylinder, hyperbola (height z_a)", bell.meridian()),
        Step(
            "2", "Ends of the domain: faces, a full turn, the mouth (the top is where the stem begins)", bell.domain()
        ),
        Step(
            "3",
            "Principal radii of the hyperbola; its roots and the minus are lost in print",
            name_expressions("rho_1 rho_2", *radii["hyperbola"]),
        ),
        Step(
            "4",
            "Lengths per φ and around at the height υ (here z), and their derivatives",
            name_expressions("rho_z r_z rho_z,z rho_z,phi", *bell.lengths()),
        ),
    ]


def _elasticity() -> list[Step]:
    hooke = bell.hooke_in_three_dimensions()
    strain = bell.strains_of_the_body()
    stresses = [(sp.Symbol(f"sigma_{name}"), value) for name, value in hooke.items()]
    strains = [(sp.Symbol(name), value) for name, value in strain._asdict().items()]
    defects = [sp.Symbol(f"defect_{axis}") for axis in bell_dynamics.AXES]
    return [
        Step("5", "Hooke's law", pair_up(stresses)),
        Step("6", "Strains of the body (shears are twice the paper's)", pair_up(strains)),
        Step(
            "7",
            "Divergence of the stress along φ, υ (here z) and θ; a comma is a derivative",
            _along("R", bell_dynamics.equilibrium()),
        ),
        Step(
            "7 as printed",
            "has terms in ∂ρ₁/∂φ, which vanish on hemisphere and cylinder only, and σ_φθ for σ_φυ once: its excess",
            pair_up(zip(defects, bell_dynamics.equilibrium_defect(), strict=True)),
        ),
    ]


def _motion() -> list[Step]:
    printed = (
        found - ours
        for found, ours in zip(
            bell_dynamics.printed_slow_accelerations(), bell_dynamics.slow_accelerations(), strict=True
        )
    )
    _, coriolis, euler, centripetal = bell_dynamics.acceleration_parts()
    return [
        Step(
            "8-10",
            "Displacement u_φ, u_υ, u_θ along the three directions, and the rate",
            _along("Omega", bell_dynamics.rate_vector()),
        ),
        Step(
            "11",
            "Acceleration: that of u, and what the rate adds: Coriolis (C), Euler (E), centripetal (N)",
            (*_along("C", coriolis), *_along("E", euler), *_along("N", centripetal)),
        ),
        Step("12", "Acceleration of a point, their sum", _along("a", bell_dynamics.accelerations())),
        Step("13", "The same of a slow, steady rate", _along("a", bell_dynamics.slow_accelerations())),
        Step("13 as printed", "has cos φ for sin φ and lacks u_φ in the third: its excess", _along("d", printed)),
        Step(
            "14", "Inertial force per area; set equal to (7) it is (15)", _along("f", bell_dynamics.inertial_forces())
        ),
    ]


def _pattern() -> list[Step]:
    shape = bell.rayleigh_functions()
    return [
        Step("19", "The assumed pattern, along the meridian, around and normal", name_expressions("U V W", *shape)),
        Step(
            "17, 18",
            "would be zero if it did not stretch; on the hemisphere they are",
            name_expressions("ε_φφ ε_θθ 2ε_φθ", *bell.membrane_strains()),
        ),
        Step(
            "",
            "and without the factor cos(5πφ/φ_b)",
            name_expressions("ε_φφ ε_θθ 2ε_φθ", *bell.membrane_strains(with_factor=False)),
        ),
        Step(
            "16 as printed",
            "has another parity around than along; from it comes a coupling c₁ of two patterns on a perfect bell",
            name_expressions("c_1", bell.coupling_stiffness(bell.printed_patterns())),
        ),
    ]


def _model() -> list[Step]:
    model = bell.galerkin_model()
    coupling, mass, stiffness = sp.symbols("b m_0 c_0", positive=True)
    ratio = sp.Symbol("k")
    on_sphere = pattern_coefficients()
    energy = 2 * sp.pi * energies.surface_energy_density() * bell.rho_1(phi) * bell.rho_2(phi) * sp.sin(phi)
    k_printed = bell.printed_precession_factor()
    return [
        Step("20", "Two patterns on a turning bell", set_to_zero(bell.equations_of_motion())),
        Step(
            "",
            "Their coefficients per unit of φ, ours (Galerkin by Lagrange's equations), with the amplitudes of the middle surface's"
            " strains; c₁ is zero on a perfect bell",
            name_expressions("m_0 b c_0", model.m_0, model.b, energy),
        ),
        Step(
            "20 as printed",
            "m₀ = πρh W and b = πρh V (cos φ + sin φ) have no integral and the first power of the pattern; read so, k would be",
            pair_up([(ratio, k_printed)]),
        ),
        Step("21", "Precession factor", pair_up([(ratio, coupling / (n * mass))])),
        Step("22", "Frequency", pair_up([(omega**2, stiffness / mass)])),
        Step(
            "",
            "On the hemisphere, over ρh",
            pair_up([(sp.Symbol("M"), on_sphere.M), (sp.Symbol("B"), on_sphere.B)]),
        ),
    ]


def _along(letter: str, expressions: Iterable[sp.Expr]) -> tuple[sp.Eq, ...]:
    names = " ".join(f"{letter}_{axis}" for axis in bell_dynamics.AXES)
    return name_expressions(names, *expressions)
