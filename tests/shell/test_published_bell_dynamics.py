"""BVG paper equations (7)–(15) and HRG paper equation (15): against textbook coordinates and motion in a fixed frame."""

import pytest
import sympy as sp

from shell.derivation import bell_dynamics as bell
from shell.derivation.symbols import E, Omega, h, nu, phi, r, rho, t, theta, z
from shell.derivation.temperature import (
    OVER_TEMPERATURE,
    G,
    alpha,
    free_expansion,
    frequency_over_temperature,
    temperature,
    temperature_parts,
)

R = sp.Symbol("R", positive=True)


def on(length, distance):
    """The equilibrium with ρ_z and r_z of a known surface."""
    lengths = {bell.rho_z: length, bell.r_z: distance}
    return [sp.expand(component.subs(lengths).doit()) for component in bell.equilibrium()]


def test_equilibrium_on_a_sphere_is_that_of_spherical_coordinates():
    """Timoshenko and Goodier, Theory of Elasticity: with radius a = R + υ, polar angle φ, azimuth θ."""
    a = R + z
    s = [[bell.stress(i, j) for j in range(3)] for i in range(3)]
    cotangent = sp.cos(phi) / sp.sin(phi)
    polar = (
        s[0][1].diff(z)
        + s[0][0].diff(phi) / a
        + s[0][2].diff(theta) / (a * sp.sin(phi))
        + ((s[0][0] - s[2][2]) * cotangent + 3 * s[0][1]) / a
    )
    radial = (
        s[1][1].diff(z)
        + s[0][1].diff(phi) / a
        + s[1][2].diff(theta) / (a * sp.sin(phi))
        + (2 * s[1][1] - s[0][0] - s[2][2] + s[0][1] * cotangent) / a
    )
    around = (
        s[1][2].diff(z)
        + s[0][2].diff(phi) / a
        + s[2][2].diff(theta) / (a * sp.sin(phi))
        + (3 * s[1][2] + 2 * s[0][2] * cotangent) / a
    )
    for found, expected in zip(on(a, a * sp.sin(phi)), (polar, radial, around), strict=True):
        assert sp.simplify(found - expected) == 0


def test_printed_equilibrium_holds_around_and_errs_along_the_meridian():
    along, normal, around = bell.equilibrium_defect()
    bend = bell.rho_1(phi).diff(phi)
    assert around == 0
    assert normal.subs(bend, 0) == 0
    left = sp.simplify(along.subs(bend, 0))
    assert sp.simplify(left - (bell.stress(0, 2) - bell.stress(0, 1)) * sp.sin(phi) / bell.r_z) == 0


def test_acceleration_is_the_second_derivative_in_a_fixed_frame():
    """A point of the body at distance a from the origin, moved by u, in a frame that turns about z by ∫Ω dt."""
    turn = sp.Function("psi")(t)
    u = [bell.moving(i) for i in range(3)]
    # z is minus the axis of the pole, so that φ, υ, θ are right-handed; the rate is about it
    meridian = sp.Matrix([sp.cos(phi), 0, sp.sin(phi)])
    normal = sp.Matrix([sp.sin(phi), 0, -sp.cos(phi)])
    around = meridian.cross(normal)
    body = u[0] * meridian + u[1] * normal + u[2] * around
    frame = sp.Matrix([[sp.cos(turn), -sp.sin(turn), 0], [sp.sin(turn), sp.cos(turn), 0], [0, 0, 1]])
    acceleration = frame.T * (frame * body).diff(t, 2)
    for found, axis in zip(bell.accelerations(), (meridian, normal, around), strict=True):
        expected = acceleration.dot(axis).subs(turn.diff(t), -bell.Omega_t).doit()
        assert sp.expand((expected - found).rewrite(sp.exp)) == 0


def test_printed_slow_acceleration_lacks_a_term_around():
    differences = [a - b for a, b in zip(bell.slow_accelerations(), bell.printed_slow_accelerations(), strict=True)]
    u_phi, u_upsilon, _ = (bell.moving(i).diff(t) for i in range(3))
    expected = -2 * Omega * (u_phi * sp.cos(phi) + u_upsilon * (sp.sin(phi) - sp.cos(phi)))
    assert sp.simplify(differences[0]) == 0
    assert sp.simplify(differences[1]) == 0
    assert sp.simplify(differences[2] - expected) == 0
    assert bell.inertial_forces()[2].coeff(bell.moving(2).diff(t, 2)) == rho * h


@pytest.mark.slow
def test_parts_of_the_temperature_coefficient_add_up_to_its_derivative():
    whole = sp.log(frequency_over_temperature()).diff(temperature)
    assert sp.simplify(whole - temperature_parts().total) == 0
    over = OVER_TEMPERATURE
    assert temperature_parts().r == -2 * over[r].diff(temperature) / over[r]
    assert sp.simplify(temperature_parts().nu + over[nu].diff(temperature) / (2 * (1 + over[nu]))) == 0
    assert over[E] in frequency_over_temperature().atoms(sp.Function)


@pytest.mark.slow
def test_free_expansion_leaves_half_of_the_shear_modulus_and_of_the_expansion():
    """Theory sheet, section 1: TCF = ½ G'/G + ½ α."""
    assert sp.simplify(free_expansion() - G(temperature).diff(temperature) / (2 * G(temperature)) - alpha / 2) == 0


def test_mouth_of_the_domain_lies_on_the_hyperbola():
    """(2): the normal at φ_b belongs to the point x = R_b, z = −L − S of (1)."""
    from shell.derivation.bell import L, R, R_b, S, domain, phi, point_of_hyperbola

    values = {R: 12.5, R_b: 15.0, S: 6.0, L: 10.0}
    mouth = sp.atan(domain()[-1].rhs.subs(values))
    at = [float(coordinate.subs(values).subs(phi, mouth)) for coordinate in point_of_hyperbola()]
    assert at == pytest.approx([15.0, -16.0], rel=1e-12)


def test_coriolis_euler_and_centripetal_terms_against_a_turning_frame():
    """(11): a point that rests in a frame turning about the axis has only Euler's and the centripetal acceleration, ε × r and −Ω² r."""
    relative, coriolis, euler, centripetal = bell.acceleration_parts()
    still = {bell.moving(i).diff(t, k): 0 for i in range(3) for k in (2, 1)}
    assert all(sp.simplify(x.subs(still)) == 0 for x in (*relative, *coriolis))
    x = [bell.moving(i) for i in range(3)]
    radial = x[0] * sp.cos(phi) + x[1] * sp.sin(phi)  # away from the axis; φ̂ and υ̂ lie in the plane of the meridian
    expected = [-(bell.Omega_t**2) * part for part in (radial * sp.cos(phi), radial * sp.sin(phi), x[2])]
    assert all(sp.simplify(a - b) == 0 for a, b in zip(centripetal, expected, strict=True))
    assert sp.simplify(euler.dot(euler) - bell.Omega_t.diff(t) ** 2 * (radial**2 + x[2] ** 2)) == 0
