"""The bell's theory as one numbered chain of equations: BVG paper eqs. (1)–(22), beside what its copy prints."""

from collections.abc import Iterator

import sympy as sp
from sympy.core.function import AppliedUndef

from shell.derivation import bell, bell_dynamics, energies
from shell.derivation.chain import Row
from shell.derivation.coriolis import pattern_coefficients
from shell.derivation.symbols import n, omega, phi


def bell_steps() -> Iterator[Row]:
    """Yield the chain in the paper's order; a step that the copy prints otherwise says how."""
    yield from _body()
    yield from _motion()
    yield from _model()


def shorten(equation: sp.Expr) -> sp.Expr:
    """Return an expression with functions written without their arguments, and derivatives behind a comma: σ_φυ,z for ∂σ_φυ/∂z."""
    derivatives = {
        one: sp.Symbol(f"{one.expr.func.__name__},{''.join(v.name * int(times) for v, times in one.variable_count)}")
        for one in equation.atoms(sp.Derivative)
        if isinstance(one.expr, AppliedUndef)
    }
    plain = equation.xreplace(derivatives)
    return plain.xreplace({one: sp.Symbol(one.func.__name__) for one in plain.atoms(AppliedUndef)})


def _body() -> list[Row]:
    hooke, strain = bell.hooke_in_three_dimensions(), bell.strains_of_the_body()
    ends = "Ends of the domain: faces, a full turn, the mouth (the top is where the stem begins)"
    lengths = "Lengths per φ and around at the height υ (here z), and their derivatives"
    radii = "Principal radii of the hyperbola; roots and a minus sign are missing in print"
    divergence = "Divergence of the stress along φ, υ (here z) and θ; a comma is a derivative"
    printed = "terms in ∂ρ₁/∂φ, which vanish on hemisphere and cylinder only, and σ_φθ instead of σ_φυ once: difference from (7)"
    return [
        ("1", "Meridian: hemisphere, cylinder, hyperbola (height z_a)", None, bell.meridian()),
        ("2", ends, None, bell.domain()),
        ("3", radii, "rho_1 rho_2", bell.principal_radii()["hyperbola"]),
        ("4", lengths, "rho_z r_z rho_z,z rho_z,phi", bell.lengths()),
        ("5", "Hooke's law", " ".join(f"sigma_{name}" for name in hooke), hooke.values()),
        ("6", "Strains of the body (shears are twice the paper's)", " ".join(strain._fields), strain),
        ("7", divergence, _along("R"), bell_dynamics.equilibrium()),
        ("7 as printed", printed, _along("defect"), bell_dynamics.equilibrium_defect()),
    ]


def _motion() -> list[Row]:
    slow, printed = bell_dynamics.slow_accelerations(), bell_dynamics.printed_slow_accelerations()
    excess = [found - ours for found, ours in zip(printed, slow, strict=True)]
    _, *added = bell_dynamics.acceleration_parts()
    parts = "Acceleration of u, and the terms of the rate: Coriolis (C), Euler (E), centripetal (N)"
    force = "Inertial force per area; equated to (7) it gives (15)"
    rate = "Displacement u_φ, u_υ, u_θ along the three directions, and the rate"
    return [
        ("8-10", rate, _along("Omega"), bell_dynamics.rate_vector()),
        ("11", parts, _along("C", "E", "N"), [component for part in added for component in part]),
        ("12", "Acceleration of a point: their sum", _along("a"), bell_dynamics.accelerations()),
        ("13", "Acceleration at a slow, steady rate", _along("a"), slow),
        ("13 as printed", "cos φ instead of sin φ, and no u_φ in the third: difference from (13)", _along("d"), excess),
        ("14", force, _along("f"), bell_dynamics.inertial_forces()),
    ]


def _model() -> list[Row]:
    names, plain = "ε_φφ ε_θθ 2ε_φθ", bell.membrane_strains(with_factor=False)
    parity = "different parity along and around, which couples (c₁) two patterns on a perfect bell"
    stretch = "Zero for an inextensional pattern; on the hemisphere they are"
    model, (coupling, mass, stiffness) = bell.galerkin_model(), sp.symbols("b m_0 c_0", positive=True)
    energy = 2 * sp.pi * energies.surface_energy_density() * bell.rho_1(phi) * bell.rho_2(phi) * sp.sin(phi)
    ours = "Coefficients per unit of φ from Lagrange's equations (Galerkin), with the strain amplitudes of the middle surface; c₁ is zero on a perfect bell"
    printed = "m₀ = πρh W and b = πρh V (cos φ + sin φ) lack the integral and the square of the pattern; taken literally, k would be"
    return [
        ("19", "Assumed pattern: meridional, circumferential and normal", "U V W", bell.rayleigh_functions()),
        ("17, 18", stretch, names, bell.membrane_strains()),
        ("", "Without the factor cos(5πφ/φ_b)", names, plain),
        ("16 as printed", parity, "c_1", bell.coupling_stiffness(bell.printed_patterns())),
        ("20", "Two patterns on a rotating bell", bell.equations_of_motion(), 0),
        ("", ours, "m_0 b c_0", (model.m_0, model.b, energy)),
        ("20 as printed", printed, "k", bell.printed_precession_factor()),
        ("21", "Precession factor", "k", coupling / (n * mass)),
        ("22", "Frequency", omega**2, stiffness / mass),
        ("", "On the hemisphere, divided by ρh", "M B", pattern_coefficients()),
    ]


def _along(*letters: str) -> str:
    return " ".join(f"{letter}_{axis}" for letter in letters for axis in bell_dynamics.AXES)
