r"""Modes of a resonator cut from a cubic crystal with its axis along [001], as silicon (100): harmonics n and n ± 4 together.

The energy density of a cubic crystal, with strains ε_a along its axes a = x, y, z, is

    2 U = C₁₂ (tr ε)² + 2 C₄₄ ε : ε + β Σ_a ε_a²,   β = C₁₁ - C₁₂ - 2 C₄₄.

The first two terms are isotropic. With A = ε_r + ε_θ and D = (ε_r - ε_θ) cos 2θ - γ_rθ sin 2θ, the third is
β (ε_z² + A²/2 + D²/2): strains P cos kθ of ε_r - ε_θ and Γ sin kθ of γ_rθ give D the waves

    D = ½ (P + Γ) cos (k + 2)θ + ½ (P - Γ) cos (k - 2)θ,

and the same with sines for the other mode of a pair. So k meets k ± 4, and 2 meets itself: the wave 0 has no sine, which
splits n = 2 in the first order. Pairs of odd harmonics stay whole, as the fourfold axis asks.
"""

from dataclasses import dataclass
from math import isfinite, pi, sqrt

import numpy as np

from shell.assembly import build_system
from shell.crystal import Crystal, hill
from shell.eigen import Factor, find_pattern, lowest_pairs
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.modes import solve_modes
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.system import System

REACH = 8  # harmonics above n that take part
LOWEST = 16  # modes of all harmonics together among which the pair is sought
LARGEST = 4000  # unknowns of all harmonics together


@dataclass(frozen=True)
class Cubic:
    """Elastic constants C₁₁, C₁₂, C₄₄ (Pa) and density (kg/m³) of a cubic crystal."""

    C11: float
    C12: float
    C44: float
    rho: float

    def __post_init__(self) -> None:
        values = (self.C11, self.C12, self.C44, self.rho)
        if not all(isfinite(v) for v in values) or not min(self.C44, self.C11 - self.C12, self.C11 + 2 * self.C12) > 0:
            raise ShellError("a cubic crystal is stable only with C44 > 0, C11 > C12 and C11 + 2 C12 > 0.")
        if not self.rho > 0:
            raise ShellError(f"density must be positive, not {self.rho:g} kg/m³.")

    @property
    def excess(self) -> float:
        """β, Pa; 0 where the crystal is isotropic."""
        return self.C11 - self.C12 - 2 * self.C44

    @property
    def isotropic(self) -> Elastic:
        """The mean over all directions (Voigt-Reuss-Hill)."""
        constants = {"C11": self.C11, "C12": self.C12, "C44": self.C44}
        return Elastic(*hill(Crystal("cubic", "[001]", 0.0, constants).stiffness()), self.rho)


@dataclass(frozen=True)
class CubicPair:
    """The two modes of a pair in the crystal."""

    harmonic: int
    # along_100, along_110: Hz, of the mode with an antinode along [100] and of the one turned by a quarter wave: for n
    # = 2 its antinodes lie along [110]
    along_100: float
    along_110: float
    relative_error_estimate: float  # of both

    @property
    def relative_split(self) -> float:
        """(f_110 - f_100) over their mean."""
        return 2 * (self.along_110 - self.along_100) / (self.along_110 + self.along_100)


def solve_cubic(resonator: Resonator, crystal: Cubic, harmonic: int = 2, tolerance: float = 1e-5) -> CubicPair:
    """The lowest pair of a harmonic n >= 2, not a multiple of 4, of a shell without stem, clamp or kink."""
    if harmonic < 2 or harmonic % 4 == 0:
        raise ShellError(f"a cubic crystal is solved for n >= 2 that do not couple with n = 0, not n = {harmonic}.")
    mean = crystal.isotropic
    (mode,) = solve_modes(resonator, mean, harmonic, tolerance=tolerance)
    first = harmonic % 4 if harmonic % 2 == 0 else 1
    harmonics = list(range(first, harmonic + REACH + 1, 4 if harmonic % 2 == 0 else 2))
    level = mode.solution.system.level
    systems = [build_system(mode.resonator, k, level, (0, harmonics[-1])) for k in harmonics]
    if len(systems[0].groups) > 1:
        raise ShellError("a cubic crystal is computed only for plain shells, without stem, clamp or kink.")
    if sum(system.constraint.shape[1] for system in systems) > LARGEST:
        raise ShellError(f"harmonic {harmonic} and those that the crystal couples to it have too many unknowns.")
    shift = 1e-2 * mean.G / mean.rho / resonator.size**2 if systems[0].rigid_motions else 0.0
    found, errors = [], []
    for sign in (1, -1):
        # the last harmonic shows what those beyond it would do
        fewer, all_ = (_lowest(systems[:k], harmonics[:k], crystal, harmonic, sign, shift) for k in (-1, len(systems)))
        found.append(all_)
        errors.append(abs(fewer / all_ - 1))
    return CubicPair(harmonic, found[0], found[1], mode.relative_error_estimate + max(errors))


def _lowest(systems: list[System], harmonics: list[int], crystal: Cubic, n: int, sign: int, shift: float) -> float:
    """The lowest frequency with most of its motion in harmonic n; `sign` is 1 for cosines, -1 for sines."""
    sizes = [system.constraint.shape[1] for system in systems]
    ends = np.cumsum([0, *sizes])
    lam, G = crystal.C12, crystal.C44
    part = Elastic(G * (3 * lam + 2 * G) / (lam + G), lam / (2 * (lam + G)), crystal.rho)
    K, M = np.zeros((ends[-1], ends[-1])), np.zeros((ends[-1], ends[-1]))
    waves: dict[int, Array] = {}
    for system, k, a, b in zip(systems, harmonics, ends, ends[1:], strict=False):
        # K with λ = C₁₂ and G = C₄₄, and M, of the free unknowns of one harmonic
        elements, mass = system.operators(system.constants(part))
        elastic = system.pattern.assemble(elements).toarray()
        axial, around, across, shear = _strains(system)
        K[a:b, a:b] = elastic + crystal.excess * (axial.T @ axial + around.T @ around / 2)
        M[a:b, a:b] = mass @ np.eye(b - a)
        for m, wave in ((k + 2, (across + shear) / 2), (k - 2, (across - shear) / 2)):
            whole = waves.setdefault(abs(m), np.zeros((len(axial), ends[-1])))
            whole[:, a:b] += (sign if m < 0 else 1) * wave
    for m, wave in waves.items():
        K += crystal.excess / 2 * (1.0 if m else 1.0 + sign) * (wave.T @ wave)
    factor = Factor(find_pattern([np.arange(len(K))], len(K)), [(K + shift * M) / crystal.rho])
    vectors, _ = lowest_pairs(factor, M / crystal.rho, LOWEST, 1e-11)
    at = harmonics.index(n)
    own = vectors[ends[at] : ends[at + 1]]
    share = np.einsum("ik,ik->k", own, M[ends[at] : ends[at + 1], ends[at] : ends[at + 1]] @ own)
    share /= np.einsum("ik,ik->k", vectors, M @ vectors)
    if not np.any(share > 0.5):
        raise ShellError(f"harmonic {n} is not among the lowest {LOWEST} modes of the crystal, or is mixed.")
    x = vectors[:, int(np.argmax(share > 0.5))]
    return sqrt(float(x @ K @ x) / float(x @ M @ x)) / (2 * pi)


def _strains(system: System) -> tuple[Array, Array, Array, Array]:
    """ε_z, ε_r + ε_θ, ε_r - ε_θ and γ_rθ at all points, times the root of their volume, per free unknown: (points, unknowns)."""
    (group,) = system.chains.values()
    place, table = group.section, group.table
    t_r, t_z = place.tangent_r[..., None], place.tangent_z[..., None]
    n_r, n_z = -t_z, t_r
    root = np.sqrt(table.volume)
    columns = []
    for one in np.eye(system.constraint.shape[1]):
        s, theta, zeta, s_theta, s_zeta, theta_zeta = np.moveaxis(table.strains(system.spread(one)[0]), 2, 0)
        r = t_r**2 * s + n_r**2 * zeta + t_r * n_r * s_zeta
        z = t_z**2 * s + n_z**2 * zeta + t_z * n_z * s_zeta
        columns.append([(f * root).ravel() for f in (z, r + theta, r - theta, t_r * s_theta + n_r * theta_zeta)])
    axial, around, across, shear = np.array(columns).transpose(1, 2, 0)
    return axial, around, across, shear
