"""The derivation meets the HRG paper's equations and the published closed forms."""

import csv
from pathlib import Path

import pytest
import sympy as sp

from shell.derivation import coriolis, displacements, energies, frequency, inextensional, strains
from shell.derivation.symbols import (
    C,
    E,
    Omega,
    h,
    in_half_angle,
    n,
    nu,
    omega,
    phi,
    phi_2,
    r,
    rho,
    t,
    tan_half,
    theta,
    z,
)

REFERENCE = Path(__file__).parents[1] / "reference" / "rayleigh_integrals_exact.csv"
T = sp.tan(phi / 2)


def vanishes(expression):
    return sp.simplify(in_half_angle(sp.expand_trig(expression))) == 0


def reference_rows():
    lines = [line for line in REFERENCE.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def test_kinetic_energy_is_equation_2():
    U, V, W = (function(phi) for function in (displacements.U, displacements.V, displacements.W))
    integrand = displacements.kinetic_energy(displacements.harmonic_displacement()).atoms(sp.Integral).pop().function
    expected = sp.pi * omega**2 * sp.sin(omega * t) ** 2 * (U**2 + V**2 + W**2) * sp.sin(phi)
    assert sp.simplify(integrand - expected) == 0


def test_quadratic_forms_around_the_axis_agree_with_direct_integration():
    def density(harmonic):
        return (3 * sp.cos(harmonic * theta) + 5 * sp.sin(harmonic * theta)) ** 2

    assert displacements.integrate_around(density(n)) == sp.integrate(density(2), (theta, 0, 2 * sp.pi))


@pytest.mark.slow
def test_kirchhoff_hypothesis_gives_equation_8_with_the_corrected_twist():
    general = displacements.general_displacement()
    pairs = zip(strains.derive_deformation(general), strains.corrected_deformation(general), strict=True)
    assert [sp.simplify(derived - corrected) for derived, corrected in pairs] == [0] * 6


def test_layer_strains_are_exactly_those_that_equation_6_approximates():
    general = displacements.general_displacement()
    layer, surface = strains.kirchhoff_strains(general), strains.derive_deformation(general)
    thin = strains.thin_layer_strains(surface)
    stretch = 1 + z / r
    assert sp.simplify(stretch * layer.e_phi - thin.e_phi) == 0
    assert sp.simplify(stretch * layer.e_theta - thin.e_theta) == 0
    shear = surface.epsilon_phitheta * (1 - z**2 / r**2) + 2 * z * surface.tau * stretch
    assert sp.simplify(stretch**2 * layer.gamma_phitheta - shear) == 0
    assert [sp.simplify(part) for part in (layer.e_z, layer.gamma_phiz, layer.gamma_thetaz)] == [0, 0, 0]


@pytest.fixture(scope="module")
def motions():
    return strains.rigid_motions()


@pytest.mark.parametrize("motion", [f"{kind} {axis}" for kind in ("shift along", "turn about") for axis in "xyz"])
def test_rigid_motions_neither_stretch_nor_bend_with_the_corrected_twist(motion, motions):
    displacement = motions[motion]
    assert all(sp.simplify(part) == 0 for part in strains.corrected_deformation(displacement))


def test_printed_twist_differs_from_the_derived_one_in_one_derivative():
    w = displacements.general_displacement().w
    expected = (w.diff(theta) - w.diff(phi)) * sp.cos(phi) / (r**2 * sp.sin(phi) ** 2)
    assert sp.simplify(strains.printed_twist_defect() - expected) == 0


def test_hooke_is_equation_5():
    stress, law, strain = energies.STRESS, energies.hooke(), energies.STRAIN
    plate = E / (1 - nu**2)
    assert sp.simplify(law[stress.sigma_phi] - plate * (strain.e_phi + nu * strain.e_theta)) == 0
    assert sp.simplify(law[stress.sigma_theta] - plate * (strain.e_theta + nu * strain.e_phi)) == 0
    assert sp.simplify(law[stress.sigma_phitheta] - E / (2 * (1 + nu)) * strain.gamma_phitheta) == 0


def test_plane_stress_is_three_dimensional_hooke_without_pressure_across():
    """With σ_z = λ(e_φ + e_θ + e_z) + 2G e_z = 0 the full law of the BVG paper, eq. (5), becomes eq. (5) here."""
    stress, law, strain = energies.STRESS, energies.hooke(), energies.STRAIN
    G = E / (2 * (1 + nu))
    lame = 2 * G * nu / (1 - 2 * nu)
    across = sp.solve(lame * (strain.e_phi + strain.e_theta + strain.e_z) + 2 * G * strain.e_z, strain.e_z)[0]
    volume = strain.e_phi + strain.e_theta + across
    assert sp.simplify(lame * volume + 2 * G * strain.e_phi - law[stress.sigma_phi]) == 0
    assert sp.simplify(lame * volume + 2 * G * strain.e_theta - law[stress.sigma_theta]) == 0


def test_thin_energy_is_equation_4():
    stress, strain = energies.STRESS, energies.STRAIN
    expected = stress.sigma_phi * strain.e_phi + stress.sigma_theta * strain.e_theta
    expected += stress.sigma_phitheta * strain.gamma_phitheta
    assert sp.simplify(energies.thin_energy_density() - expected / 2) == 0
    assert len(sp.Add.make_args(sp.expand(energies.full_energy_density()))) == 6


def test_thickness_integral_is_equation_7():
    d = energies.DEFORMATION
    membrane = d.epsilon_phi**2 + d.epsilon_theta**2 + 2 * nu * d.epsilon_phi * d.epsilon_theta
    membrane += (1 - nu) / 2 * d.epsilon_phitheta**2
    bending = d.kappa_phi**2 + d.kappa_theta**2 + 2 * nu * d.kappa_phi * d.kappa_theta + 2 * (1 - nu) * d.tau**2
    expected = (E * h * membrane + E * h**3 / 12 * bending) / (2 * (1 - nu**2))
    assert sp.simplify(energies.surface_energy_density() - expected) == 0


@pytest.mark.slow
def test_both_separated_solutions_satisfy_the_inextensional_conditions():
    for sign, tangential in zip((1, -1), inextensional.general_solution(), strict=True):
        shape = {
            displacements.V(phi): sign * tangential,
            displacements.W(phi): -sp.diff(tangential, phi),
            displacements.U(phi): tangential,
        }
        for condition in inextensional.inextensional_conditions():
            assert vanishes(condition.subs(shape).doit() / T**n)


def test_integrals_of_the_separated_equations_differentiate_back_to_their_rates():
    for logarithm, rate in zip(inextensional.integrate_separated(), inextensional.separated_rates(), strict=True):
        in_phi = logarithm.subs(tan_half, T)
        assert vanishes(in_phi.diff(phi) - rate)


def test_only_one_solution_is_finite_at_the_pole():
    assert inextensional.pole_exponents() == (1 + n, 1 - n)


def test_mode_is_equation_10():
    mode = inextensional.inextensional_mode()
    assert sp.simplify(mode.u - C * sp.sin(phi) * T**n) == 0
    assert mode.v == mode.u
    assert sp.simplify(mode.w + C * (n + sp.cos(phi)) * T**n) == 0


@pytest.mark.slow
def test_mode_does_not_stretch_and_bends_as_published():
    bend = C * n * (n**2 - 1) * T**n / (r**2 * sp.sin(phi) ** 2)
    deformation = inextensional.mode_deformation()
    assert deformation[:3] == (0, 0, 0)
    assert sp.simplify(deformation.kappa_phi - bend * sp.cos(n * theta)) == 0
    assert sp.simplify(deformation.kappa_theta + bend * sp.cos(n * theta)) == 0
    assert sp.simplify(deformation.tau + bend * sp.sin(n * theta)) == 0


def test_energies_are_equation_12_and_frequency_equations_13_and_14():
    I, J = frequency.I, frequency.J
    kinetic = sp.pi / 2 * rho * h * r**2 * omega**2 * C**2 * J
    potential = sp.pi * E * h**3 * n**2 * (n**2 - 1) ** 2 * C**2 * I / (6 * (1 + nu) * r**2)
    assert sp.simplify(frequency.maximum_kinetic_energy() - kinetic) == 0
    assert sp.simplify(frequency.maximum_potential_energy() - potential) == 0
    square = n**2 * (n**2 - 1) ** 2 * E * h**2 * I / (3 * (1 + nu) * rho * r**4 * J)
    assert sp.simplify(frequency.omega_squared() - square) == 0
    assert sp.simplify(frequency.frequency(2) ** 2 - square.subs(n, 2) / (2 * sp.pi) ** 2) == 0


@pytest.mark.parametrize("row", reference_rows(), ids=lambda row: f"n={row['n']}")
def test_closed_forms_on_the_hemisphere_are_the_published_ones(row):
    harmonic = int(row["n"])
    exact = sp.sympify(row["J_exact"].replace("ln2", "*log(2)").replace(" *", "*"))
    assert frequency.bending_integral(harmonic) == sp.Rational(row["I_exact"])
    assert sp.simplify(frequency.mass_integral(harmonic) - exact) == 0
    assert float(frequency.mass_integral(harmonic)) == pytest.approx(float(row["J"]), rel=1e-14)
    if row["bryan_k"]:
        assert float(coriolis.bryan_factor(harmonic)) == pytest.approx(float(row["bryan_k"]), abs=1e-8)


def test_coriolis_energy_gives_the_two_pattern_equations():
    U, V, W = (function(phi) for function in (displacements.U, displacements.V, displacements.W))
    coefficients = coriolis.pattern_coefficients()
    area = r**2 * sp.sin(phi)
    assert sp.simplify(coefficients.M - sp.pi * (U**2 + V**2 + W**2) * area) == 0
    assert sp.simplify(coefficients.B + 2 * sp.pi * V * (U * sp.cos(phi) + W * sp.sin(phi)) * area) == 0
    assert sp.simplify(coriolis.coriolis_integrand() - 2 * sp.sin(phi) ** 3 * T ** (2 * n)) == 0


def test_a_ring_that_moves_in_its_plane_precesses_as_bryan_found():
    """An inextensional ring (φ = 90°, W = −nV, U = 0) has K = 2/(n²+1): Bryan (1890)."""
    shape = {displacements.U(phi): 0, displacements.V(phi): 1, displacements.W(phi): -n}
    mass, coupling = (part.subs(shape).subs(phi, sp.pi / 2) for part in coriolis.pattern_coefficients())
    rate = coriolis.precession_rate()
    symbols = {symbol.name: symbol for symbol in rate.free_symbols}
    assert Omega not in rate.free_symbols
    assert sp.simplify(rate.subs({symbols["B"]: coupling, symbols["M"]: mass}) - 2 / (n**2 + 1)) == 0


def test_log_derivatives_follow_the_frequency_formula():
    derivatives = frequency.log_derivatives()
    half = sp.Rational(1, 2)
    assert (derivatives.E, derivatives.rho, derivatives.h, derivatives.r) == (half, -half, 1, -2)
    assert sp.simplify(derivatives.nu + 1 / (2 * (1 + nu))) == 0
    integrals = frequency.integral_definitions()
    leibniz = sum(
        sign * integral.diff(phi_2) / (2 * symbol)
        for sign, integral, symbol in zip((1, -1), integrals, (frequency.I, frequency.J), strict=True)
    )
    assert sp.simplify(derivatives.phi_2 - leibniz) == 0
