"""The derivation as one numbered chain of equations, ready to be printed."""

from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from shell.derivation import coriolis, displacements, energies, frequency, inextensional, strains, temperature
from shell.derivation.displacements import U, V, W
from shell.derivation.symbols import n, omega, phi, phi_2, t


@dataclass(frozen=True)
class DerivedCase:
    """One harmonic and one polar range (exact angles, rad) for which the integrals are worked out."""

    harmonic: int = 2
    start: sp.Expr = sp.S.Zero
    end: sp.Expr = sp.pi / 2

    @classmethod
    def from_degrees(cls, harmonic: int, start: float, end: float) -> "DerivedCase":
        """Return the case of a range in degrees: multiples of 30° exactly, others with enough digits to subtract.

        The closed forms of a small cap are small differences, and nested radicals of 7.5° help nobody.
        """

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


@dataclass(frozen=True)
class Step:
    """One step of the derivation: its number in the HRG paper (empty where the paper has none) and its equations."""

    number: str
    title: str
    equations: tuple[sp.Eq, ...]


def steps(case: DerivedCase) -> list[Step]:
    """Return the whole chain, HRG paper eqs. (1)–(15), for any n, with the numbers of one case before (15)."""
    return [*_elasticity(), *_mode(), *_frequency(), *_numbers(case), *_temperature()]


def _elasticity() -> list[Step]:
    strain, deformation = energies.STRAIN, energies.DEFORMATION
    layer = strains.thin_layer_strains(deformation)
    in_plane = ("e_phi", "e_theta", "gamma_phitheta")
    surface = strains.corrected_deformation(displacements.general_displacement())
    shift = strains.rigid_motions()["shift along z"]
    return [
        Step("1", "Displacements of harmonic n", name_expressions("u v w", *displacements.harmonic_displacement())),
        Step(
            "2",
            "Kinetic energy",
            name_expressions("K", displacements.kinetic_energy(displacements.harmonic_displacement())),
        ),
        Step("3", "Strain energy per volume", name_expressions("S_V", energies.full_energy_density())),
        Step(
            "4",
            "the same of a thin shell, normals staying normal",
            name_expressions("S_V", energies.thin_energy_density()),
        ),
        Step("5", "Hooke's law", pair_up(energies.hooke().items())),
        Step(
            "6",
            "Strains at height z, much smaller than r",
            pair_up((getattr(strain, name), getattr(layer, name)) for name in in_plane),
        ),
        Step("7", "Strain energy per area", name_expressions("S_A", energies.surface_energy_density())),
        Step(
            "8",
            "Strains, curvature changes and twist of the middle surface, from the Kirchhoff hypothesis",
            pair_up(zip(deformation, surface, strict=True)),
        ),
        Step(
            "8 as printed",
            "has ∂w/∂φ for ∂w/∂θ in the twist: its error, and the twist it finds in a shell only shifted along its axis",
            name_expressions("Δτ τ_shift", strains.printed_twist_defect(), strains.printed_deformation(shift).tau),
        ),
    ]


def _mode() -> list[Step]:
    unknown = [function(phi) for function in (U, V, W)]
    bending = [part.subs(t, 0) for part in inextensional.mode_deformation()[3:]]
    return [
        Step("9", "No stretching, for harmonic n", set_to_zero(inextensional.inextensional_conditions())),
        Step("", "The first condition removes W", set_to_zero(inextensional.eliminate_normal_displacement())),
        Step(
            "",
            "Their sum, in P = U + V, and their difference, in M = U - V",
            set_to_zero(inextensional.decoupled_equations()),
        ),
        Step("", "Variables separated", name_expressions("(lnP)′ (lnM)′", *inextensional.separated_rates())),
        Step("", "Integrated in T = tan(φ/2)", name_expressions("lnP lnM", *inextensional.integrate_separated())),
        Step(
            "",
            "General solution, each with a factor of its own",
            name_expressions("P M", *inextensional.general_solution()),
        ),
        Step(
            "",
            "Powers of φ at the pole: M is infinite there for n > 1, so M = 0 and U = V",
            name_expressions("p_P p_M", *inextensional.pole_exponents()),
        ),
        Step(
            "10",
            "The mode that does not stretch",
            pair_up(zip(unknown, inextensional.inextensional_mode(), strict=True)),
        ),
        Step("11", "Its displacements", name_expressions("u v w", *inextensional.inextensional_displacement())),
        Step("", "Its curvature changes and twist", pair_up(zip(energies.DEFORMATION[3:], bending, strict=True))),
    ]


def _frequency() -> list[Step]:
    return [
        Step(
            "12",
            "Greatest kinetic and potential energy, and their integrals",
            name_expressions("K_max U_max", frequency.maximum_kinetic_energy(), frequency.maximum_potential_energy())
            + name_expressions("I J", *frequency.integral_definitions()),
        ),
        Step("13", "Frequency, where both energies are equal", pair_up([(omega**2, frequency.omega_squared())])),
        Step(
            "",
            "Derivatives of ln f for design",
            name_expressions("∂lnf/∂lnE ∂lnf/∂ν ∂lnf/∂lnρ ∂lnf/∂lnh ∂lnf/∂lnr ∂lnf/∂φ₂", *frequency.log_derivatives()),
        ),
        Step(
            "",
            "Two patterns on a shell turning with Ω, per unit of φ and ρh: mass M and Coriolis coupling 2ΩB; "
            "the standing wave lags by K of the angle turned",
            name_expressions("M B K", *coriolis.pattern_coefficients(), coriolis.precession_rate()),
        ),
    ]


def _temperature() -> list[Step]:
    return [
        Step("15", "Frequency over temperature", name_expressions("f", temperature.frequency_over_temperature())),
        Step(
            "",
            "Its slope d ln f/dT by parts, from E, ν, ρ, h and r",
            name_expressions("TCF_E TCF_ν TCF_ρ TCF_h TCF_r", *temperature.temperature_parts()),
        ),
        Step(
            "",
            "their sum in free isotropic expansion α, E = 2 G (1 + ν)",
            name_expressions("TCF", temperature.free_expansion()),
        ),
    ]


def _numbers(case: DerivedCase) -> list[Step]:
    number, names = "14" if case.harmonic == 2 else "", f"I_{case.harmonic} J_{case.harmonic} K_{case.harmonic}"
    values = (case.bending, case.mass, case.precession)
    closed = (
        []
        if case.mass.has(sp.Float)
        else [Step("", "Its integrals and Bryan factor in closed form", name_expressions(names, *values))]
    )
    return [
        Step(
            number,
            f"Frequency in Hz for n = {case.harmonic}",
            name_expressions("f", frequency.frequency(case.harmonic)),
        ),
        *closed,
        Step(
            "",
            "Its integrals and Bryan factor as numbers",
            name_expressions(names, *(sp.N(value, 17) for value in values)),
        ),
        Step(
            "",
            "Derivative of ln f by the rim angle (1/rad)",
            name_expressions("∂lnf/∂φ₂", sp.N(case.rim_derivative, 17)),
        ),
    ]


def name_expressions(names: str, *expressions: sp.Expr) -> tuple[sp.Eq, ...]:
    """Return equations of names, parted by spaces, with expressions."""
    return pair_up(zip((sp.Symbol(name) for name in names.split()), expressions, strict=True))


def set_to_zero(expressions: Iterable[sp.Expr]) -> tuple[sp.Eq, ...]:
    """Return equations that say that expressions vanish."""
    return pair_up((expression, sp.S.Zero) for expression in expressions)


def pair_up(pairs: Iterable[tuple[sp.Expr, sp.Expr]]) -> tuple[sp.Eq, ...]:
    """Return equations of left with right sides, not worked out."""
    return tuple(sp.Eq(left, right, evaluate=False) for left, right in pairs)
