"""The bell's own theory: what BVG paper eqs. (1)–(6), (16)–(22) say, and how wrong the assumed pattern (19) is."""

from math import pi, sqrt

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad

from shell.bell_theory import (
    inextensional_functions,
    rayleigh_functions,
    rayleigh_functions_without_factor,
    two_pattern_model,
)
from shell.derivation import bell as symbolic
from shell.derivation.coriolis import p, pattern_coefficients, q, two_patterns
from shell.derivation.displacements import Displacement, U, V, W
from shell.derivation.strains import SPHERE, kirchhoff_displacement
from shell.derivation.symbols import E, Omega, h, n, nu, phi, r, rho, t, theta, z
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.meridian import bell, hemisphere
from shell.modes import solve_modes
from shell.rayleigh import rayleigh_bryan_factor, rayleigh_frequency
from tests.shell.samples import DOME, SILICA

ALLOY = Elastic(E=190e9, nu=0.3, rho=8000.0)
BELL_SIZE = {"R": 12.5e-3, "L": 10e-3, "S": 6e-3, "R_b": 15e-3}
BELL = bell(radius=12.5e-3, thickness=0.8e-3, cylinder_height=10e-3, hyperbola_height=6e-3, mouth_radius=15e-3)


def sized(expression):
    return expression.subs({symbol: BELL_SIZE[symbol.name] for symbol in expression.free_symbols if symbol != phi})


def test_point_with_a_given_normal_lies_on_the_hyperbola_of_equation_1():
    x, height = symbolic.point_of_hyperbola()
    left = symbolic.meridian()[2].lhs.subs({symbolic.x: x, symbolic.axial: height})
    assert sp.simplify(left) == 1


@pytest.mark.slow
def test_radii_are_those_of_the_solvers_meridian():
    mouth = BELL.at(np.linspace(BELL.joints[1], BELL.length, 8)[1:], segment=2)
    radii = [sp.lambdify(phi, sized(radius)) for radius in symbolic.principal_radii()["hyperbola"]]
    angle = np.arctan2(mouth.normal_r, mouth.normal_z)
    assert 1 / radii[0](angle) == pytest.approx(mouth.curvature, rel=1e-9)
    assert 1 / radii[1](angle) == pytest.approx(mouth.normal_r / mouth.r, rel=1e-9)
    assert np.all(angle < pi / 2)
    assert np.all(mouth.curvature < 0)


def test_hooke_of_equation_5_returns_youngs_modulus_and_poissons_ratio():
    stress = symbolic.hooke_in_three_dimensions()
    strain = {str(symbol): symbol for law in stress.values() for symbol in law.free_symbols}
    unknown = [strain["epsilon_theta_theta"], strain["epsilon_upsilon_upsilon"]]
    free = sp.solve([stress["theta_theta"], stress["upsilon_upsilon"]], unknown, dict=True)[0]
    pulled = strain["epsilon_phi_phi"]
    assert sp.simplify(stress["phi_phi"].subs(free) - E * pulled) == 0
    assert sp.simplify(free[unknown[0]] + nu * pulled) == 0


def test_strains_of_the_body_are_equation_6():
    names = ("u_phi", "u_theta", "u_upsilon")
    u_phi, u_theta, u_upsilon = (sp.Function(name)(phi, theta, z) for name in names)
    rho_z = symbolic.rho_1(phi) + z
    r_z = (symbolic.rho_2(phi) + z) * sp.sin(phi)
    sine, cosine = sp.sin(phi), sp.cos(phi)
    expected = (
        (u_phi.diff(phi) + u_upsilon) / rho_z,
        (u_theta.diff(theta) + u_phi * cosine + u_upsilon * sine) / r_z,
        u_upsilon.diff(z),
        (u_phi.diff(theta) - u_theta * cosine) / r_z + u_theta.diff(phi) / rho_z,
        u_phi.diff(z) - (u_phi - u_upsilon.diff(phi)) / rho_z,
        (u_upsilon.diff(theta) - u_theta * sine) / r_z + u_theta.diff(z),
    )
    for derived, printed in zip(symbolic.strains_of_the_body(), expected, strict=True):
        assert sp.simplify(derived - printed) == 0


def test_pattern_19_without_its_cosine_only_shears_the_hemisphere():
    meridional, circumferential, shear = symbolic.membrane_strains(with_factor=False)
    assert (meridional, circumferential) == (0, 0)
    assert sp.simplify(shear + 3 * sp.sin(phi) ** 4 / r) == 0


@pytest.mark.slow
def test_coupling_c_1_comes_only_from_the_printed_parity_of_equation_16():
    assert symbolic.coupling_stiffness(two_patterns()) == 0
    printed = symbolic.coupling_stiffness(symbolic.printed_patterns())
    assert printed != 0
    assert printed.subs(U(phi), 0).doit() == 0


def test_lagranges_equations_are_equation_20_without_c_1():
    M, B = pattern_coefficients()
    c_0 = sp.Symbol("c_0")
    first, second = p(t), q(t)
    expected = (
        M * first.diff(t, 2) - 2 * Omega * B * second.diff(t) + c_0 * first,
        M * second.diff(t, 2) + 2 * Omega * B * first.diff(t) + c_0 * second,
    )
    for derived, printed in zip(symbolic.equations_of_motion(), expected, strict=True):
        assert sp.expand(derived - printed) == 0


@pytest.mark.slow
def test_numeric_coefficients_are_the_integrals_of_the_symbolic_ones():
    """Hemisphere and hyperbola by quadrature over φ; the cylinder, where φ does not move, by hand."""
    model = two_pattern_model(BELL, ALLOY, rayleigh_functions_without_factor)
    shape = dict(zip((U(phi), V(phi), W(phi)), symbolic.rayleigh_functions(with_factor=False), strict=True))
    material = {E: ALLOY.E, nu: ALLOY.nu, rho: ALLOY.rho, h: 0.8e-3, n: 2}
    R, L = BELL_SIZE["R"], BELL_SIZE["L"]
    rim = BELL.at(BELL.length, segment=2)
    mouth_angle = float(np.arctan2(rim.normal_r, rim.normal_z)[0])
    radii = symbolic.principal_radii()
    totals = []
    for coefficient in symbolic.galerkin_model():
        total = 0.0
        for part, start, end in (("hemisphere", 0.0, pi / 2), ("hyperbola", pi / 2, mouth_angle)):
            bent = coefficient.subs(material).subs(shape)
            bent = bent.subs({symbolic.rho_1(phi): radii[part].rho_1, symbolic.rho_2(phi): radii[part].rho_2}).doit()
            total += quad(sp.lambdify(phi, sized(bent)), start, end, epsrel=1e-10)[0]
        totals.append(total)
    area = 0.8e-3 * R * L
    totals[0] += pi * ALLOY.rho * area
    totals[2] += pi * ALLOY.G * area * (2 / R) ** 2
    assert model.mass == pytest.approx(totals[0], rel=1e-8)
    assert model.coupling == pytest.approx(totals[1], rel=1e-8)
    assert model.stiffness == pytest.approx(totals[2], rel=1e-8)


def test_inextensional_pattern_on_the_hemisphere_is_rayleighs():
    model = two_pattern_model(DOME, SILICA, inextensional_functions)
    expected = rayleigh_frequency(2, SILICA.E, SILICA.nu, SILICA.rho, 0.9e-3, 15e-3)
    assert model.frequency == pytest.approx(expected, rel=1e-7)
    assert model.bryan_factor == pytest.approx(rayleigh_bryan_factor(2), rel=1e-7)
    assert model.membrane_share < 1e-12


def satisfies_18_at_the_pole(v, w):
    """Whether no strain of u = sin³φ, v, w is left at the order φ² of the displacements."""
    amplitudes = symbolic.strain_amplitudes(Displacement(sp.sin(phi) ** 3, v, w), SPHERE)[:3]
    return all(sp.limit(strain.subs(n, 2) / phi**2, phi, 0) == 0 for strain in amplitudes)


@pytest.mark.slow
def test_only_the_reading_of_19_that_is_used_satisfies_18_at_the_pole():
    """The print leaves open two signs and, by (16), the order of the last two components: eight readings."""
    used = symbolic.rayleigh_functions(with_factor=False)
    small, large = sp.cos(phi) * sp.sin(phi) ** 3, 3 * sp.cos(phi) * sp.sin(phi) ** 2
    readings = [
        (j * first, k * last) for first, last in ((small, large), (large, small)) for j in (1, -1) for k in (1, -1)
    ]
    assert [reading for reading in readings if satisfies_18_at_the_pole(*reading)] == [(used.v, used.w)]


@pytest.mark.parametrize("theory", ["shell", "solid"])
def test_on_the_hemisphere_19_is_an_upper_bound_and_useless(theory):
    """Rayleigh's principle: any admissible pattern lies above the true frequency; (19) 68 times, Rayleigh's by 11 %."""
    (mode,) = solve_modes(DOME, SILICA, harmonic=2, theory=theory)
    inextensional = two_pattern_model(DOME, SILICA, inextensional_functions)
    assert mode.frequency < inextensional.frequency < 1.12 * mode.frequency
    assert two_pattern_model(DOME, SILICA, rayleigh_functions).frequency > 60 * mode.frequency
    assert two_pattern_model(DOME, SILICA, rayleigh_functions_without_factor).frequency > 15 * mode.frequency
    assert abs(two_pattern_model(DOME, SILICA, rayleigh_functions).bryan_factor / mode.bryan_factor - 1) > 0.4
    assert inextensional.bryan_factor == pytest.approx(mode.bryan_factor, rel=0.03)


@pytest.mark.slow
def test_pattern_19_folds_the_bell_where_the_cylinder_begins():
    """The normal turns by (u − dw/dφ)/R = −2/R at the foot of the dome, and not at all on the cylinder.

    There φ and so w stand still along the meridian and ρ₁ is infinite; (19) is no smooth trial function of a bell.
    """
    shape = symbolic.rayleigh_functions(with_factor=False)
    tilted = kirchhoff_displacement(shape)
    rotation = sp.expand(tilted.u - shape.u) * r / z
    assert sp.simplify(rotation.subs(phi, sp.pi / 2)) == -2
    assert symbolic.principal_radii()["cylinder"].rho_1 == sp.oo


def test_an_open_pole_is_refused():
    with pytest.raises(ShellError, match="pole"):
        two_pattern_model(hemisphere(radius=15e-3, thickness=0.9e-3, pole_angle=0.2), SILICA, rayleigh_functions)


def bell_of(thickness):
    return bell(radius=12.5e-3, thickness=thickness, cylinder_height=10e-3, hyperbola_height=6e-3, mouth_radius=15e-3)


def test_on_the_bell_19_is_wrong_by_two_orders_in_frequency_and_half_in_precession():
    """(19) folds the bell at both ends of the cylinder, so it is no bound there; the inextensional pattern is one."""
    shell = bell_of(0.8e-3)
    (mode,) = solve_modes(shell, ALLOY, harmonic=2, theory="shell")
    inextensional = two_pattern_model(shell, ALLOY, inextensional_functions)
    assert mode.frequency < inextensional.frequency < 1.3 * mode.frequency
    assert inextensional.bryan_factor == pytest.approx(mode.bryan_factor, rel=0.02)
    assert two_pattern_model(shell, ALLOY, rayleigh_functions).frequency > 100 * mode.frequency
    assert two_pattern_model(shell, ALLOY, rayleigh_functions).bryan_factor < 0.5 * mode.bryan_factor


@pytest.mark.slow
def test_inextensional_pattern_of_the_bell_closes_on_the_solver_like_the_root_of_the_thickness():
    """The free edge costs √(h/R) with a coefficient near 0.27, as on the hemisphere; precession agrees much sooner."""
    excess = []
    for thickness in (0.05e-3, 0.0125e-3):
        shell = bell_of(thickness)
        (mode,) = solve_modes(shell, ALLOY, harmonic=2, theory="shell")
        model = two_pattern_model(shell, ALLOY, inextensional_functions)
        excess.append((model.frequency / mode.frequency - 1) / sqrt(thickness / 12.5e-3))
        assert model.bryan_factor == pytest.approx(mode.bryan_factor, abs=2e-5)
    assert 0.2 < excess[1] < excess[0] < 0.35
