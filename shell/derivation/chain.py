"""The derivation as one numbered chain of equations: rows of number, title, left sides and right sides; 0 says that these vanish."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy as sp

from shell.derivation import coriolis, displacements, energies, frequency, inextensional, strains, temperature
from shell.derivation.symbols import n, omega, phi_2

Row: TypeAlias = tuple[str, str, Any, Any]


@dataclass(frozen=True)
class DerivedCase:
    """One harmonic and one polar range (exact angles, rad) for which the integrals are worked out."""

    harmonic: int = 2
    start: sp.Expr = sp.S.Zero
    end: sp.Expr = sp.pi / 2

    @classmethod
    def from_degrees(cls, harmonic: int, start: float, end: float) -> "DerivedCase":
        """Return the case of a range in degrees: multiples of 30° exactly, others with enough digits to subtract small differences."""

        def angle(degrees: float) -> sp.Expr:
            exact = sp.Rational(repr(degrees)) * sp.pi / 180
            return exact if degrees % 30 == 0 else exact.evalf(40 + 8 * harmonic)

        return cls(harmonic, angle(float(start)), angle(float(end)))

    @property
    def bending(self) -> sp.Expr:
        """The bending integral in closed form."""
        return frequency.bending_integral(self.harmonic, self.start, self.end)

    @property
    def mass(self) -> sp.Expr:
        """The mass integral in closed form."""
        return frequency.mass_integral(self.harmonic, self.start, self.end)

    @property
    def precession(self) -> sp.Expr:
        """The Bryan factor in closed form."""
        return coriolis.bryan_factor(self.harmonic, self.start, self.end)

    @property
    def rim_derivative(self) -> sp.Expr:
        """The derivative of ln f by φ₂ (1/rad) at the rim of this shell."""
        values = {n: self.harmonic, phi_2: self.end, frequency.I: self.bending, frequency.J: self.mass}
        return frequency.log_derivatives().phi_2.subs(values)


def steps(case: DerivedCase) -> Iterator[Row]:
    """Yield the whole chain, HRG paper eqs. (1)–(15), for any n, with the numbers of one case before (15)."""
    yield from _elasticity()
    yield from _mode()
    yield from _frequency(case)


def _elasticity() -> list[Row]:
    shape, strain, deformation = displacements.harmonic_displacement(), energies.STRAIN, energies.DEFORMATION
    layer = strains.thin_layer_strains(deformation)
    surface = strains.corrected_deformation(displacements.general_displacement())
    defect = strains.printed_twist_defect(), strains.printed_deformation(strains.rigid_motions()["shift along z"]).tau
    in_plane = ((one.e_phi, one.e_theta, one.gamma_phitheta) for one in (strain, layer))
    twist = "∂w/∂φ instead of ∂w/∂θ in the twist: the error, and the false twist of a rigid shift along the axis"
    return [
        ("1", "Displacements of harmonic n", "u v w", shape),
        ("2", "Kinetic energy", "K", displacements.kinetic_energy(shape)),
        ("3", "Strain energy per volume", "S_V", energies.full_energy_density()),
        ("4", "Strain energy of a thin shell whose normals stay normal", "S_V", energies.thin_energy_density()),
        ("5", "Hooke's law", energies.hooke().keys(), energies.hooke().values()),
        ("6", "Strains at height z, much smaller than r", next(in_plane), next(in_plane)),
        ("7", "Strain energy per area", "S_A", energies.surface_energy_density()),
        (
            "8",
            "Strains, curvature changes and twist of the middle surface, from the Kirchhoff hypothesis",
            deformation,
            surface,
        ),
        ("8 as printed", twist, "Δτ τ_shift", defect),
    ]


def _mode() -> list[Row]:
    bending = inextensional.mode_deformation()[3:]
    at_pole = "Powers of φ at the pole: M is infinite there for n > 1, so M = 0 and U = V"
    return [
        ("9", "Conditions of no stretching, for harmonic n", inextensional.inextensional_conditions(), 0),
        ("", "The first condition removes W", inextensional.eliminate_normal_displacement(), 0),
        (
            "",
            "Sum and difference of the conditions, with P = U + V and M = U - V",
            inextensional.decoupled_equations(),
            0,
        ),
        ("", "Separation of variables", "(lnP)′ (lnM)′", inextensional.separated_rates()),
        ("", "Integration with T = tan(φ/2)", "lnP lnM", inextensional.integrate_separated()),
        ("", "General solution, each with a free factor", "P M", inextensional.general_solution()),
        ("", at_pole, "p_P p_M", inextensional.pole_exponents()),
        ("10", "The inextensional mode", displacements.AMPLITUDES, inextensional.inextensional_mode()),
        ("11", "Displacements of the inextensional mode", "u v w", inextensional.inextensional_displacement()),
        ("", "Curvature changes and twist of the inextensional mode", energies.DEFORMATION[3:], bending),
    ]


def _frequency(case: DerivedCase) -> list[Row]:
    number, names = "14" if case.harmonic == 2 else "", f"I_{case.harmonic} J_{case.harmonic} K_{case.harmonic}"
    values = (case.bending, case.mass, case.precession)
    closed = [("", "Integrals and Bryan factor in closed form", names, values)]
    greatest = frequency.maximum_kinetic_energy(), frequency.maximum_potential_energy()
    by_logarithm = "∂lnf/∂lnE ∂lnf/∂ν ∂lnf/∂lnρ ∂lnf/∂lnh ∂lnf/∂lnr ∂lnf/∂φ₂"
    turning = "Two patterns on a shell rotating at Ω, per unit of φ and ρh: mass M, Coriolis coupling 2ΩB, Bryan factor K"  # fmt: skip
    return [
        (
            "12",
            "Maximum kinetic and potential energy, and their integrals",
            "K_max U_max I J",
            (*greatest, *frequency.integral_definitions()),
        ),
        ("13", "Frequency from equal maximum energies", omega**2, frequency.omega_squared()),
        ("", "Derivatives of ln f for design", by_logarithm, frequency.log_derivatives()),
        ("", turning, "M B K", (*coriolis.pattern_coefficients(), coriolis.precession_rate())),
        (number, f"Frequency in Hz for n = {case.harmonic}", "f", frequency.frequency(case.harmonic)),
        *([] if case.mass.has(sp.Float) else closed),
        ("", "Integrals and Bryan factor, numerical values", names, [sp.N(value, 17) for value in values]),
        ("", "Derivative of ln f with respect to the rim angle (1/rad)", "∂lnf/∂φ₂", sp.N(case.rim_derivative, 17)),
        ("15", "Frequency as a function of temperature", "f", temperature.frequency_over_temperature()),
        (
            "",
            "Temperature coefficient d ln f/dT and its parts from E, ν, ρ, h and r",
            "TCF_E TCF_ν TCF_ρ TCF_h TCF_r",
            temperature.temperature_parts(),
        ),
        ("", "Sum of the parts for free isotropic expansion α, E = 2 G (1 + ν)", "TCF", temperature.free_expansion()),
    ]
