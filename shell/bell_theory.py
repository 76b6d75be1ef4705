"""The bell's own theory: the two-degree-of-freedom model of the BVG paper, eqs. (16)–(22), in numbers.

The paper puts two assumed patterns p(t), q(t) into the equations of motion and integrates (Galerkin). Its printed
integrals have lost fraction bars, signs and ranges, so m₀, b, c₀ here are ours: from the Rayleigh functions (19),
the strains (5), (6) with normals that stay normal, and Lagrange's equations (`shell.derivation.bell`). c₁ is zero
on a perfect bell. Frequency (22) and precession factor (21) can then be held against the shell solver.

(19) as it can be read: u_φ = cos(5πφ/φ_b) sin³φ cos 2θ, u_θ = cos φ sin³φ sin 2θ, u_υ = −3 cos φ sin²φ cos 2θ. The
order of the components in (16) is mended by parity; the sign and the exponents by regularity at the pole. φ is the
angle between normal and axis: constant on the cylinder, and falling again along the hyperbola.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np
import scipy

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.points import MeridianPoints
from shell.quadrature import Array, gauss, legendre
from shell.resonator import Resonator

ORDER = 32  # Gauss points on each smooth piece of the meridian
N = 2  # the harmonic of the paper's pattern


class Amplitudes(NamedTuple):
    """Displacement along the meridian (∝ cos nθ), around (∝ sin nθ) and along the normal (∝ cos nθ) at points."""

    u: Array
    v: Array
    w: Array


class Strains(NamedTuple):
    """Stretches and shear of the middle surface (1), changes of curvature and twist (1/m), at points."""

    epsilon_s: Array
    epsilon_theta: Array
    gamma: Array
    kappa_s: Array
    kappa_theta: Array
    tau: Array


@dataclass(frozen=True)
class Piece:
    """One smooth piece of the meridian: its end (m), its Gauss points, their weights ds (m) and d/ds (1/m)."""

    end: float
    points: MeridianPoints
    weights: Array
    derivative: Array


Pattern: TypeAlias = Callable[[Resonator, Sequence[Piece]], list[Amplitudes]]


@dataclass(frozen=True)
class TwoPatternModel:
    """BVG paper eq. (20): m₀ p̈ − 2Ωb q̇ + c₀ p = 0, m₀ q̈ + 2Ωb ṗ + c₀ q = 0 (c₁ = 0), for unit amplitude in m."""

    mass: float  # m₀, kg
    coupling: float  # b, kg
    stiffness: float  # c₀, N/m
    # part of the strain energy that goes into stretching the middle surface, 0 … 1; 0 if (17) were true
    membrane_share: float

    @property
    def frequency(self) -> float:
        """Natural frequency in Hz, BVG paper eq. (22): ω² = c₀/m₀."""
        return sqrt(self.stiffness / self.mass) / (2 * pi)

    @property
    def bryan_factor(self) -> float:
        """Precession factor, BVG paper eq. (21): k = b/(2 m₀)."""
        return self.coupling / (2 * self.mass)


def two_pattern_model(resonator: Resonator, elastic: Elastic, pattern: Pattern) -> TwoPatternModel:
    """Return m₀, b and c₀ of BVG paper eq. (20) for an assumed pattern with n = 2.

    m₀ = πρ ∫ h (u² + v² + w²) r ds,  b = −2πρ ∫ h v (u cos φ + w sin φ) r ds,
    c₀ = π ∫ E h/(1−ν²) [ε_s² + ε_θ² + 2ν ε_s ε_θ + (1−ν)/2 γ²] + E h³/(12(1−ν²)) [κ_s² + κ_θ² + 2ν κ_s κ_θ
    + 2(1−ν) τ²] r ds (HRG paper eq. (7)).
    """
    if not resonator.starts_on_axis:
        raise ShellError("the bell's theory needs a meridian that starts at the pole; close the opening.")
    pieces = _cut(resonator)
    mass = coupling = membrane = bending = 0.0
    plate = elastic.E / (1 - elastic.nu**2)
    for piece, shape in zip(pieces, pattern(resonator, pieces), strict=True):
        points, strain = piece.points, strains(piece, shape)
        area, h = points.r * piece.weights, points.thickness
        radial = shape.u * points.normal_z + shape.w * points.normal_r
        mass += pi * elastic.rho * np.sum(h * (shape.u**2 + shape.v**2 + shape.w**2) * area)
        coupling -= 2 * pi * elastic.rho * np.sum(h * shape.v * radial * area)
        membrane += pi * plate * np.sum(h * _form(strain[:3], elastic.nu, 0.5) * area)
        bending += pi * plate / 12 * np.sum(h**3 * _form(strain[3:], elastic.nu, 2.0) * area)
    energy = membrane + bending
    return TwoPatternModel(float(mass), float(coupling), float(energy), float(membrane / energy))


def rayleigh_functions(resonator: Resonator, pieces: Sequence[Piece]) -> list[Amplitudes]:
    """Return BVG paper eq. (19): U = cos(5πφ/φ_b) sin³φ, V = cos φ sin³φ, W = −3 cos φ sin²φ, at the points (m).

    φ_b is the angle at the mouth. The factor cos(5πφ/φ_b) breaks even the first condition of (18).
    """
    rim = resonator.at(resonator.length, len(pieces) - 1)
    phi_b = _polar_angle(rim)
    plain = rayleigh_functions_without_factor(resonator, pieces)
    return [
        shape._replace(u=shape.u * np.cos(5 * pi * _polar_angle(piece.points) / phi_b))
        for piece, shape in zip(pieces, plain, strict=True)
    ]


def rayleigh_functions_without_factor(resonator: Resonator, pieces: Sequence[Piece]) -> list[Amplitudes]:
    """Return (19) with U = sin³φ: then ε_φφ = ε_θθ = 0 on the hemisphere, and only the shear −3 sin⁴φ/R is left (m)."""
    shapes = []
    for piece in pieces:
        sine, cosine = piece.points.normal_r, piece.points.normal_z
        shapes.append(Amplitudes(sine**3, cosine * sine**3, -3 * cosine * sine**2))
    return shapes


def inextensional_functions(resonator: Resonator, pieces: Sequence[Piece]) -> list[Amplitudes]:
    """Return the pattern n = 2 that satisfies (17), (18) along this meridian, regular at the pole (m).

    u′ = −κ w and v′ = (n u + v cos φ)/r with w = −(n v + u cos φ)/sin φ, integrated from the pole, where
    u = v ∝ sⁿ⁺¹; on a hemisphere this is HRG paper eq. (10).
    """
    shapes, start, state = [], 1e-6 * float(pieces[0].points.r.max()), np.array([1.0, 1.0])
    for k, piece in enumerate(pieces):

        def rate(s: float, state: Array, segment: int = k) -> Array:
            here = resonator.at(s, segment)
            u, v = state[:1], state[1:]
            w = _unstretched_normal(here, u, v)
            return np.concatenate([-here.curvature * w, (N * u + v * here.normal_z) / here.r])

        stops = np.append(piece.points.arc_length, piece.end)
        path = scipy.integrate.solve_ivp(
            rate, (start, piece.end), state, method="DOP853", t_eval=stops, rtol=1e-12, atol=1e-30
        )
        u, v = path.y[:, :-1]
        shapes.append(Amplitudes(u, v, _unstretched_normal(piece.points, u, v)))
        start, state = piece.end, path.y[:, -1]
    size = max(float(np.max(np.abs(shape.w))) for shape in shapes)
    return [Amplitudes(shape.u / size, shape.v / size, shape.w / size) for shape in shapes]


def strains(piece: Piece, shape: Amplitudes) -> Strains:
    """Return the amplitudes of the middle surface's strains and curvature changes, BVG paper eq. (6) at υ = 0.

    With β_s = κu − w′, β_θ = (v sin φ + n w)/r of the Kirchhoff hypothesis; HRG paper eq. (8) on any meridian.
    """
    points, along = piece.points, piece.derivative
    sine, cosine, r, kappa = points.normal_r, points.normal_z, points.r, points.curvature
    u, v, w = shape
    beta_s, beta_theta = kappa * u - along @ w, (v * sine + N * w) / r
    turning = (N * u + v * cosine) / r
    twice_tau = along @ beta_theta - (N * beta_s + beta_theta * cosine) / r + along @ v * sine / r - kappa * turning
    return Strains(
        epsilon_s=along @ u + kappa * w,
        epsilon_theta=(N * v + u * cosine + w * sine) / r,
        gamma=along @ v - turning,
        kappa_s=along @ beta_s,
        kappa_theta=(N * beta_theta + beta_s * cosine) / r,
        tau=twice_tau / 2,
    )


def _unstretched_normal(points: MeridianPoints, u: Array, v: Array) -> Array:
    """The normal displacement that makes ε_θθ = 0."""
    return -(N * v + u * points.normal_z) / points.normal_r


def _form(strain: tuple[Array, ...], nu: float, shear: float) -> Array:
    first, second, third = strain
    return np.asarray(first**2 + second**2 + 2 * nu * first * second + shear * (1 - nu) * third**2)


def _polar_angle(points: MeridianPoints) -> Array:
    return np.asarray(np.arctan2(points.normal_r, points.normal_z))


def _cut(resonator: Resonator) -> list[Piece]:
    bounds = [0.0, *resonator.joints, resonator.length]
    nodes, weights = gauss(ORDER)
    basis = legendre(ORDER - 1, nodes)
    derivative = basis.slopes @ np.linalg.inv(basis.values)
    pieces = []
    for k, (start, end) in enumerate(pairwise(bounds)):
        half = (end - start) / 2
        points = resonator.at(start + half * (1 + nodes), k)
        pieces.append(Piece(end, points, half * weights, derivative / half))
    return pieces
