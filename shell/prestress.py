r"""Frequency shift of a mode by axisymmetric static stress: temperature gradients, thermal mismatch with the base, spin.

A static field u_0 changes the energy of the mode u by its stresses σ (geometric stiffness K_σ) and by its shape,

    uᵀ δK u = ∫ σ_ij u_k,i u_k,j dV + 2 ∫ σ_ij(u) u_k,i u_0k,j dV = 2 g · u_0,

g the quadratic force of the mode (shell.finite), with the material as it is per unit of strain (St Venant and Kirchhoff). A
body that is grown by 1 + β where it is warm, β = ∫ α dT, has σ = C (e(u_0) - β), and per volume before the growth C is less by β:

    δω² ∫ ρ u² dV = 2 g · u_0 - ∫ β [3 K tr q(u, u) + σ(u) : e(u)] dV,      K_0 u_0 = ∫ 3 K β tr e(ψ) dV.

With the answer y = K_0⁻¹ g of the harmonic 0, that is one number for each place of the meridian. For a free body of one
temperature the numbers add up to δ ln f = ½ β: lengths grow, the mass stays. A base that grows by ε more than the resonator
is a resonator that grows by ε less than its base.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shell.assembly import assemble, lay_resonator
from shell.eigen import Factor, lowest_pairs
from shell.errors import ShellError
from shell.finite import QuadraticForce, solved_as_solid
from shell.layout import Theory
from shell.modes import Mode
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.solution import Solution, total
from shell.system import ElementSum, ShellGroup, System

STEPS = 600  # of the iteration beside vectors that are left out
DONE = 1e-9


@dataclass(frozen=True, eq=False)
class Prestress:
    """Effect of thermal expansion on one mode through stress and shape, once, on demand; a shell and n = 0 have energies alone."""

    mode: Mode

    @cached_property
    def shares(self) -> Array:
        """`expansion_shares` at the stations of `mode.along`; with the base they add up to ½."""
        if self.is_solved:
            return expansion_shares(self.mode)
        along = self.mode.along
        return np.asarray(1.5 * along.kinetic - along.elastic)

    @property
    def is_solved(self) -> bool:
        """Whether stress and shape are in it."""
        return self.mode.theory == "solid" and self.mode.harmonic > 0

    @cached_property
    def by_base(self) -> float:
        """δ ln f over the growth of the base beyond the resonator's own; 0 where nothing is held."""
        if self.mode.resonator.support == "free" or not self.is_solved:
            return 0.0
        return 0.5 - float(self.shares.sum())

    @property
    def held(self) -> Array:
        """1 at the station next to the base, 0 at all others."""
        found = np.zeros(len(self.mode.along.position))
        found[-1 if self.mode.resonator.support == "clamped-rim" else 0] = 1.0
        return found


def expansion_shares(mode: Mode) -> Array:
    """Contributions of a thermal strain β(s) to δ ln f = Σ share β, the base unchanged, beside E, ν and ρ; ½ of a free resonator."""
    solution = solved_as_solid(mode)
    if mode.harmonic < 1:
        raise ShellError("the effect of stress is computed for pairs, harmonics from 1 up.")
    y, squares = mean_answer(mode)
    scale = 2 * solution.eigenvalue * total(solution.kinetic)
    position, shares = [], []
    for group, c, elastic, e, q in zip(
        solution.system.groups, solution.constants, solution.elastic, y.strain, squares, strict=True
    ):
        lam, G = c.lame
        dilation = 4 * e[:, :, :3].sum(axis=2) - 2 * q[:, :, :3].sum(axis=2)
        found = ((3 * lam + 2 * G) * np.sum(dilation * group.table.volume, axis=2) - elastic) / scale
        if isinstance(group, ShellGroup):
            position.append(group.table.position.ravel())
            shares.append(found.ravel())
        else:
            position.append(group.table.position[0])
            shares.append(np.array([found.sum()]))
    return np.concatenate(shares)[np.argsort(np.concatenate(position), kind="stable")]


def mean_answer(mode: Mode) -> tuple[Solution, list[Array]]:
    """The static answer y = K_0⁻¹ g of the harmonic 0 to the quadratic force of a mode, and the wave 0 of q(u, u).

    Forces f that hold a static field change ω² ∫ ρ u² dV by 4 y · f (integrals of n over π, of 0 over 2π).
    """
    solution = solved_as_solid(mode)
    system = neighbour(mode, 0)
    force = QuadraticForce.of(solution, system)
    return settle(system, mode, force.whole), force.squares


def neighbour(mode: Mode, harmonic: int) -> System:
    """Another harmonic on the elements of a mode."""
    solution, resonator = solved_as_solid(mode), mode.resonator
    level = solution.system.level
    return assemble(resonator, lay_resonator(resonator, mode.harmonic, level), harmonic, level)


def settle(system: System, mode: Mode, load: Array) -> Solution:
    """The static answer K⁻¹ f, without rigid motions: (K + s M) u = f + s M u, again and again, with what f does to them left out."""
    constants = solved_as_solid(mode).constants
    shift = system.shift(constants, mode.resonator.size)
    K, M = system.operators(constants, shift)
    factor = Factor(system.pattern, K)
    if not shift:
        return Solution(system, constants, factor.solve(np.asfortranarray(load[:, None]))[:, 0])
    motions, _ = lowest_pairs(factor, M, system.rigid_motions, DONE)
    return Solution(system, constants, answer_without(motions, factor, M, load, shift))


def answer_without(vectors: Array, factor: Factor, M: ElementSum, load: Array, shift: float) -> Array:
    """(A - shift M)⁻¹ f of a factor of A, M-orthonormal eigenvectors left out: u = A⁻¹ (f + shift M u), again and again."""
    heavy = M @ vectors
    f = load[:, None]
    f = f - heavy @ (vectors.T @ f)
    u = np.zeros_like(f)
    for _ in range(STEPS):
        before, u = u, factor.solve(np.asfortranarray(f + shift * (M @ u)))
        u = u - vectors @ (heavy.T @ u)
        if np.max(abs(u - before)) <= DONE * np.max(abs(u)):
            return np.asarray(u[:, 0])
    raise ShellError("a mode lies so near that the answer to a static field or to a spin does not converge.")


def check_mount(resonator: Resonator, theory: Theory, harmonic: int) -> None:
    """Refuse cases for which thermal mismatch with the base is not computed."""
    if resonator.support == "free":
        raise ShellError("a free resonator is not joined to a base: give it a support, or leave the mount out.")
    if theory != "solid" or harmonic < 1:
        raise ShellError("the stress from a base is computed in the solid theory, for harmonics from 1 up.")
