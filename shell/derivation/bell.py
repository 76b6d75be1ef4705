"""The bell-shaped resonator: BVG paper eqs. (1)–(6) and (16)–(22), with illegible parts derived anew.

The meridian's radii, the strains of a body in shell coordinates, the assumed pattern (19) and how far it is from
stretching nothing, and the two-degree-of-freedom model (20), whose coefficients are ours (Galerkin by Lagrange's
equations, normals staying normal). Numbers come from `shell.bell_theory`.
"""

from functools import cache
from typing import NamedTuple

import sympy as sp

from shell.derivation.coriolis import p, pattern_coefficients, q, turning_kinetic_energy
from shell.derivation.displacements import AMPLITUDES, Displacement, U, V, W, integrate_around, with_angles
from shell.derivation.energies import surface_energy_of
from shell.derivation.strains import SPHERE, Deformation, LayerStrains, Radii, derive_deformation, layer_strains
from shell.derivation.symbols import E, h, n, nu, phi, r, rho, t, theta, z

R, L, S, R_b = sp.symbols("R L S R_b", positive=True)
"""Radius of hemisphere and cylinder, heights of cylinder and hyperbola, radius of the mouth (m)."""
x, axial = sp.symbols("x z_a", real=True)  # distance from the axis and height above the centre of the hemisphere (m)
phi_b = sp.Symbol("phi_b", positive=True)  # angle between normal and axis at the mouth (rad)
rho_1, rho_2 = sp.symbols("rho_1 rho_2", cls=sp.Function)
"""Principal radii of curvature along the meridian and around, functions of φ (m)."""


class GalerkinModel(NamedTuple):
    """m₀, b, c₀ of BVG paper eq. (20) per unit of φ, the integrands over the meridian; c₁ is zero."""

    m_0: sp.Expr
    b: sp.Expr
    c_0: sp.Expr


@cache
def meridian() -> tuple[sp.Eq, sp.Eq, sp.Eq]:
    """Return BVG paper eq. (1): hemisphere x² + z² = R², cylinder x = R, hyperbola below the waist z = −L."""
    hyperbola = x**2 / R**2 - (R_b**2 - R**2) * (axial + L) ** 2 / (R**2 * S**2)
    return sp.Eq(x**2 + axial**2, R**2), sp.Eq(x, R), sp.Eq(hyperbola, 1)


@cache
def point_of_hyperbola() -> tuple[sp.Expr, sp.Expr]:
    """Return x and z of the hyperbola where its normal makes the angle φ with the axis.

    The gradient of (1) is along the normal, (x/R², −(R_b²−R²)(z+L)/(R²S²)) ∝ (sin φ, cos φ); its length follows from (1).
    """
    slope = (R_b**2 - R**2) / (R**2 * S**2)
    length = sp.Symbol("length", positive=True)
    at = {x: length * R**2 * sp.sin(phi), axial: -length * sp.cos(phi) / slope - L}
    squared = sp.solve(meridian()[2].subs(at), length**2)[0]
    return tuple(coordinate.subs(at).subs(length, sp.sqrt(squared)) for coordinate in (x, axial))


@cache
def principal_radii() -> dict[str, Radii]:
    """Return BVG paper eq. (3): ρ₂ = x/sin φ and ρ₁ = (dx/dφ)/cos φ on each part.

    On the hyperbola ρ₁ = −R⁴S² √(R_b²−R²) q⁻³ᐟ², ρ₂ = R² √(R_b²−R²) q⁻¹ᐟ², q = (R_b²−R²) R² sin²φ − R²S² cos²φ:
    the roots and the minus sign are lost in print. The minus says that the mouth flares: φ falls towards it.
    """
    waist_to_mouth, _ = point_of_hyperbola()
    return {
        "hemisphere": Radii(R, R),
        "cylinder": Radii(sp.oo, R),
        "hyperbola": Radii(
            sp.simplify(waist_to_mouth.diff(phi) / sp.cos(phi)), sp.simplify(waist_to_mouth / sp.sin(phi))
        ),
    }


@cache
def domain() -> tuple[sp.Eq, ...]:
    """Return the ends of BVG paper eq. (2): faces at υ = ∓h/2 (here z), a full turn, and φ from φ_t at the top to φ_b at the mouth.

    At the mouth x = R_b, z = −L − S the gradient of (1) gives tan φ_b = R_b S²/((R_b² − R²) S) = R_b S/(R_b² − R²).
    """
    lower, upper, whole = sp.symbols("z_1 z_2 theta_2")
    return (
        sp.Eq(lower, -h / 2, evaluate=False),
        sp.Eq(upper, h / 2, evaluate=False),
        sp.Eq(whole, 2 * sp.pi, evaluate=False),
        sp.Eq(sp.tan(phi_b), R_b * S / (R_b**2 - R**2), evaluate=False),
    )


@cache
def lengths() -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
    """Return BVG paper eq. (4): ρ_z = ρ₁ + υ, r_z = (ρ₂ + υ) sin φ, ∂ρ_z/∂υ and ∂ρ_z/∂φ."""
    along = rho_1(phi) + z
    return along, (rho_2(phi) + z) * sp.sin(phi), along.diff(z), along.diff(phi)


@cache
def hooke_in_three_dimensions() -> dict[str, sp.Expr]:
    """Return BVG paper eq. (5): σᵢᵢ = λε + 2Gεᵢᵢ, σᵢⱼ = 2Gεᵢⱼ with G = E/2(1+ν), λ = 2Gν/(1−2ν), ε = Σ εᵢᵢ."""
    shear = E / (2 * (1 + nu))
    lame = 2 * shear * nu / (1 - 2 * nu)
    names = ("phi_phi", "upsilon_upsilon", "theta_theta", "phi_upsilon", "phi_theta", "upsilon_theta")
    strain = {name: sp.Symbol(f"epsilon_{name}", real=True) for name in names}
    volume = sum(strain[name] for name in names[:3])
    return {name: 2 * shear * strain[name] + (lame * volume if name in names[:3] else 0) for name in names}


@cache
def strains_of_the_body() -> LayerStrains:
    """Return BVG paper eq. (6), for u_φ, u_θ, u_υ functions of φ, θ and z (the paper's υ); its ε_φθ, ε_υφ, ε_υθ are halves of the shears."""
    displacement = Displacement(*(sp.Function(name)(phi, theta, z) for name in ("u_phi", "u_theta", "u_upsilon")))
    return layer_strains(displacement, Radii(rho_1(phi), rho_2(phi)))


@cache
def rayleigh_functions(with_factor: bool = True) -> Displacement:
    """Return BVG paper eq. (19) for A_k = 1: U = cos(5πφ/φ_b) sin³φ, V = cos φ sin³φ, W = −3 cos φ sin²φ.

    U along the meridian, V around, W along the normal, the only order that the parity of (18) allows; (16)
    prints it otherwise. Exponents and the minus sign of W are lost in print. `with_factor=False` drops
    cos(5πφ/φ_b): then two of the three conditions (18) hold on the hemisphere.
    """
    factor = sp.cos(5 * sp.pi * phi / phi_b) if with_factor else sp.S.One
    sine, cosine = sp.sin(phi), sp.cos(phi)
    return Displacement(factor * sine**3, cosine * sine**3, -3 * cosine * sine**2)


def strain_amplitudes(shape: Displacement, radii: Radii) -> Deformation:
    """Return strains, curvature changes and twist over their cos nθ, cos nθ, sin nθ, of U cos nθ, V sin nθ, W cos nθ."""
    deformation = derive_deformation(with_angles(shape), radii)
    angles = (sp.cos(n * theta), sp.cos(n * theta), sp.sin(n * theta)) * 2
    return Deformation(*(sp.expand(part / angle) for part, angle in zip(deformation, angles, strict=True)))


@cache
def membrane_strains(with_factor: bool = True) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return ε_φφ, ε_θθ, 2ε_φθ of (19) on the hemisphere over cos 2θ, sin 2θ: (17) says zero; 0, 0, −3 sin⁴φ/r without the factor."""
    amplitudes = strain_amplitudes(rayleigh_functions(with_factor), SPHERE)[:3]
    return tuple(sp.factor(sp.trigsimp(strain.subs(n, 2))) for strain in amplitudes)


@cache
def printed_patterns() -> Displacement:
    """Return BVG paper eq. (16) as printed: u_φ = U (p cos + q sin), u_θ = W (p cos + q sin), u_υ = V (p sin + q cos).

    Along the meridian and along the normal a pattern must be even in θ together, and around it odd; this is not.
    """
    cosine, sine = sp.cos(n * theta), sp.sin(n * theta)
    even, odd = p(t) * cosine + q(t) * sine, p(t) * sine + q(t) * cosine
    return Displacement(U(phi) * even, W(phi) * even, V(phi) * odd)


@cache
def coupling_stiffness(patterns: Displacement) -> sp.Expr:
    """Return the membrane part of c₁ = ∂²(energy)/∂p∂q of two patterns on the hemisphere, per unit of φ.

    Zero by the symmetry of a perfect shell. From (16) as printed it is not, and has only terms with U, as c₁ in
    the paper: the coupling there comes from the misprinted parity.
    """
    deformation = derive_deformation(patterns)
    stretching = Deformation(*deformation[:3], sp.S.Zero, sp.S.Zero, sp.S.Zero)
    energy = integrate_around(surface_energy_of(stretching)) * r**2 * sp.sin(phi)
    return sp.factor(sp.diff(sp.expand(energy), p(t), q(t)))


@cache
def galerkin_model() -> GalerkinModel:
    """Return the coefficients of BVG paper eq. (20) per unit of φ, for any principal radii and n.

    m₀ = πρh (U² + V² + W²), b = −2πρh V (U cos φ + W sin φ), and c₀ twice π the energy (7) of the HRG paper of
    the strains' amplitudes, each times ρ₁ρ₂ sin φ. Then (21) k = b/(n m₀) and (22) ω² = c₀/m₀ of their integrals.
    """
    on_sphere, radii = pattern_coefficients(), Radii(rho_1(phi), rho_2(phi))
    area = radii.rho_1 * radii.rho_2 * sp.sin(phi)
    inertia = rho * h * area / (r**2 * sp.sin(phi))
    amplitudes = strain_amplitudes(AMPLITUDES, radii)
    stiffness = 2 * sp.pi * surface_energy_of(amplitudes) * area
    return GalerkinModel(on_sphere.M * inertia, on_sphere.B * inertia, stiffness)


@cache
def equations_of_motion() -> tuple[sp.Expr, sp.Expr]:
    """Return M p̈ − 2ΩB q̇ + c₀ p and M q̈ + 2ΩB ṗ + c₀ q of BVG paper eq. (20), per unit of φ and over ρh (`pattern_coefficients`)."""
    c_0 = sp.Symbol("c_0")
    lagrangian = turning_kinetic_energy() - c_0 * (p(t) ** 2 + q(t) ** 2) / 2
    equations = (sp.diff(lagrangian, y.diff(t)).diff(t) - sp.diff(lagrangian, y) for y in (p(t), q(t)))
    return tuple(sp.expand(equation) for equation in equations)


@cache
def printed_precession_factor() -> sp.Expr:
    """Return k = b/(2 m₀) of m₀ = πρh W and b = πρh V (cos φ + sin φ) as printed: from 0 at the pole to −1/6 at the waist."""
    shape = rayleigh_functions()
    return sp.simplify(shape.v * (sp.cos(phi) + sp.sin(phi)) / (2 * shape.w))
