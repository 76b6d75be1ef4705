r"""A mode at large amplitude: geometric shift of its frequency with the square of the amplitude (Duffing's coefficient).

With Green's strain the motion u = a φ cos ωt drives fields of the second order, of the waves 0 and 2n, constant and at 2ω,

    u = a φ cos ωt + ½ a² (z + z_d cos 2ωt),      K z = -g,      (K - 4 ω² M) z_d = -g,

g the quadratic force of φ (shell.finite). They relieve the stretching that the bent shape asks for, and the inertia of z_d
loads the mode. The terms at ω of the third order give (Lindstedt; Nayfeh and Mook, Nonlinear Oscillations, 1979)

    (ω² - ω_0²) ∫ ρ φ² dV = a² [3/2 S - 2 ω_0² zᵀ M z_d],      S = ∫ (½ q + e(z)) : C : (½ q + e(z)) + 2 σ_ij φ_k,i z_k,j dV.

S is what the relief leaves of the energy, written without the cancellation of large terms. Not in it: elastic constants of the
third and fourth order, which add of the order of the squared strain, and the springs of electrodes.
"""

import warnings
from dataclasses import dataclass

import numpy as np

from shell.errors import ShellError
from shell.finite import QuadraticForce, solved_as_solid
from shell.modes import Mode, TheoryRangeWarning
from shell.prestress import neighbour, settle
from shell.quadrature import Array
from shell.solution import Solution, total
from shell.sparse import PIVOTING, factor_symmetric

NEAR = 0.01  # of twice the frequency, by which it is moved to see whether another mode lies near
SETTLED = 0.1  # share of the coefficient that this may change


@dataclass(frozen=True)
class AmplitudeShift:
    """δf/f = (static + inertial) w² of a standing wave whose largest displacement is w, m: both in 1/m²."""

    static: float  # by the energy of the bent shape, its stretching relieved
    inertial: float  # by the motion at 2ω that relieves it

    @property
    def total(self) -> float:
        """Both together."""
        return self.static + self.inertial


def amplitude_shift(mode: Mode) -> AmplitudeShift:
    """Shift of the frequency of a standing wave with its squared amplitude; warns of a mode of 0 or 2n near twice the frequency."""
    solution = solved_as_solid(mode)
    if mode.harmonic < 2:
        raise ShellError("the effect of the amplitude is computed for harmonics from 2 up.")
    eigenvalue, static, inertial, moved = solution.eigenvalue, 0.0, 0.0, 0.0
    for harmonic, weight in ((0, 2.0), (2 * mode.harmonic, 1.0)):  # integrals over 2π and π
        system = neighbour(mode, harmonic)
        force = QuadraticForce.of(solution, system)
        z = settle(system, mode, -force.whole)
        left = 2 * float(force.turn @ z.vector)
        for group, c, q, e in zip(system.groups, z.constants, force.squares, z.strain, strict=True):
            rest = e + q / 2
            left += float(np.sum((c.stress(group.table, rest) * rest).sum(axis=2) * group.table.volume))
        joint, slope = _inertia(z, -force.whole, 4 * eigenvalue)
        static += 1.5 * weight * left
        inertial -= 2 * weight * eigenvalue * joint
        moved += abs(2 * weight * eigenvalue * slope * 4 * eigenvalue * 2 * NEAR)
    if moved > SETTLED * (abs(static) + abs(inertial)):
        warnings.warn(
            f"a mode of harmonic 0 or {2 * mode.harmonic} lies near twice the frequency of n = {mode.harmonic}: the effect of the "
            "amplitude depends on their distance, and the two modes may exchange energy.",
            TheoryRangeWarning,
            stacklevel=2,
        )
    scale = 2 * eigenvalue * total(solution.kinetic) * mode.largest_displacement**2
    return AmplitudeShift(static / scale, inertial / scale)


def _inertia(z: Solution, force: Array, driven: float) -> tuple[float, float]:
    """Return zᵀ M z_d with (K - Λ M) z_d = f at Λ = `driven`, and its derivative by Λ."""
    elements, M = z.system.operators(z.constants, -driven)
    solve = factor_symmetric(z.system.pattern.assemble(elements), PIVOTING)
    heavy = M @ z.vector
    z_d, other = solve(force), solve(heavy)
    return float(heavy @ z_d), float(other @ (M @ z_d))
