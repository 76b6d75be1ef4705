r"""A mode of a spinning resonator: the second-order change of its frequency, in the frame of the body.

The initial state is static and axisymmetric, K_0 u_0 = f, with stresses σ. In the frame of the body the small motion obeys

    M ü - 2 Ω G u̇ + (K + K_σ - Ω² M_⊥) u = 0,      uᵀ M_⊥ u = ∫ ρ (u_r² + u_θ²) dV,

K_σ by the stresses and the shape that they give (shell.prestress), G of the waves that run around, uᵀ G v = ∫ ρ (u_r v_θ + u_θ v_r) dV. The two waves of a pair have ω = ω_0 ± Ω g + …, g = uᵀ G u/uᵀ M u,
which is Bryan's effect; their mean moves in the second order,

    2 ω_0 δω = [uᵀ K_σ u - Ω² uᵀ M_⊥ u]/uᵀ M u + Ω² g² - 4 Ω² ω_0² Σ_j (uᵀ G u_j)²/(ω_j² - ω_0²)

(stiffening, centrifugal softening, Coriolis within the pair, Coriolis with all other modes of the harmonic, of unit mass).
"""

from dataclasses import dataclass

import numpy as np

from shell.eigen import Factor
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.finite import solved_as_solid
from shell.kernel import NO_STRESS
from shell.loads import directed
from shell.modes import Mode
from shell.prestress import answer_without, mean_answer, neighbour
from shell.solution import radial, total


@dataclass(frozen=True)
class SpinShift:
    """Relative changes of the mean frequency of a pair per Ω² (s²/rad²): f(Ω) = f (1 + total Ω²)."""

    stress: float
    centrifugal: float
    coriolis: float

    @property
    def total(self) -> float:
        """All three together."""
        return self.stress + self.centrifugal + self.coriolis


def spin_shift(mode: Mode, elastic: Elastic) -> SpinShift:
    """Second-order change of a mode's frequency by a constant spin about the axis, in the frame of the body."""
    solution = solved_as_solid(mode)
    if mode.harmonic < 2 or mode.index:
        raise ShellError("the second-order effect of spin is computed for the lowest mode of a harmonic from 2 up.")
    system, mass, eigenvalue = solution.system, total(solution.kinetic), solution.eigenvalue
    rest = neighbour(mode, 0)
    pull = [-g.table.loads(NO_STRESS, elastic.rho * directed(g, g.places[0])) for g in rest.groups]
    stiffening = 4 * float(mean_answer(mode)[0].vector @ rest.gather(pull)) / mass
    around = [(radial(group, d), d[:, :, 1]) for group, d in zip(system.groups, solution.displacement, strict=True)]
    softening = sum(
        float(np.sum(elastic.rho * (r**2 + t**2) * group.table.volume))
        for group, (r, t) in zip(system.groups, around, strict=True)
    )
    forces = []
    for group, (r, t) in zip(system.groups, around, strict=True):
        force = directed(group, elastic.rho * t)
        force[:, :, 1] = elastic.rho * r
        forces.append(-group.table.loads(NO_STRESS, force))
    load = system.gather(forces)
    g = float(solution.vector @ load) / mass
    # (K - λ M)⁺ f without the mode itself, which all higher modes let converge
    K, M = system.operators(solution.constants)
    own = solution.vector / np.sqrt(mass)
    moved = answer_without(own[:, None], Factor(system.pattern, K), M, load, eigenvalue)
    others = float((load - M @ solution.vector * g) @ moved)
    return SpinShift(
        stiffening / (2 * eigenvalue), -softening / mass / (2 * eigenvalue), g**2 / (2 * eigenvalue) - 2 * others / mass
    )
