r"""A mode of a spinning resonator: the second-order change of its frequency, in the frame of the body.

The initial state is static and axisymmetric, K_0 u_0 = f, with stresses σ. In the frame of the body the small motion obeys

    M ü - 2 Ω G u̇ + (K + K_σ - Ω² M_⊥) u = 0,      uᵀ K_σ u = ∫ σ_ij u_k,i u_k,j dV,   uᵀ M_⊥ u = ∫ ρ (u_r² + u_θ²) dV,

G of the waves that run around, uᵀ G v = ∫ ρ (u_r v_θ + u_θ v_r) dV. The two waves of a pair have ω = ω_0 ± Ω g + …, g = uᵀ G u/uᵀ M u,
which is Bryan's effect; their mean moves in the second order,

    2 ω_0 δω = [uᵀ K_σ u - Ω² uᵀ M_⊥ u]/uᵀ M u + Ω² g² - 4 Ω² ω_0² Σ_j (uᵀ G u_j)²/(ω_j² - ω_0²)

(stiffening, centrifugal softening, Coriolis within the pair, Coriolis with all other modes of the harmonic, of unit mass).
"""

from dataclasses import dataclass

import numpy as np

from shell.assembly import assemble, lay_resonator
from shell.cells import CellTable
from shell.eigen import Factor
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.kernel import shell_gradients
from shell.modes import Mode
from shell.quadrature import Array, at_gauss, gauss, legendre
from shell.solution import Solution, find_constants, total
from shell.system import Group, ShellGroup, System

STEPS = 60  # of the iterations for rigid motions and for the other modes
DONE = 1e-8


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
    """Second-order change of a mode's frequency by a constant spin about the axis, in the frame of the body.

    Parameters
    ----------
    mode : the lowest of a harmonic n >= 2 in the solid theory.
    elastic : the material it was solved with.

    Raises
    ------
    ShellError
        For other modes.
    """
    solution = _solid(mode)
    if mode.harmonic < 2 or mode.index:
        raise ShellError("the second-order effect of spin is computed for the lowest mode of a harmonic from 2 up.")
    system, mass, eigenvalue = solution.system, total(solution.kinetic), solution.eigenvalue
    rest = _axisymmetric(mode)
    pull = [
        -group.table.loads(
            np.zeros((*_shape(group), 6, _points(group))), elastic.rho * _radially(group, _radii(group, system))
        )
        for group in rest.groups
    ]
    stress = _settle(rest, elastic, mode, rest.gather(pull)).stress
    stiffening = geometric_stiffness(solution, stress) / mass
    around = [_radial_and_around(group, d) for group, d in zip(system.groups, solution.displacement, strict=True)]
    softening = sum(
        float(np.sum(elastic.rho * (r**2 + t**2) * group.table.volume))
        for group, (r, t) in zip(system.groups, around, strict=True)
    )
    forces = []
    for group, (r, t) in zip(system.groups, around, strict=True):
        force = _radially(group, elastic.rho * t)
        force[:, :, 1] = elastic.rho * r
        forces.append(-group.table.loads(np.zeros((*_shape(group), 6, _points(group))), force))
    load = system.gather(forces)
    g = float(solution.vector @ load) / mass
    others = _response(system, elastic, solution, load, mass)
    return SpinShift(
        stiffening / (2 * eigenvalue),
        -softening / mass / (2 * eigenvalue),
        g**2 / (2 * eigenvalue) - 2 * others / mass,
    )


def geometric_stiffness(solution: Solution, stress: list[Array]) -> float:
    """∫ σ_ij u_k,i u_k,j dV of a mode in axisymmetric stresses (elements, stations, 6, points) at its own points, over π."""
    found = 0.0
    for group, q, s in zip(solution.system.groups, solution.unknowns, stress, strict=True):
        along, around, across = np.moveaxis(displacement_gradients(solution.system, group, q), 2, 0)
        energy = (
            s[:, :, 0] * (along**2).sum(axis=2)
            + s[:, :, 1] * (around**2).sum(axis=2)
            + s[:, :, 2] * (across**2).sum(axis=2)
            + 2 * s[:, :, 4] * (along * across).sum(axis=2)
        )
        found += float(np.sum(energy * group.table.volume))
    return found


def displacement_gradients(system: System, group: Group, q: Array) -> Array:
    """∂_i u_k of element unknowns (elements, size): (elements, stations, i, k, points), i and k along the group's axes."""
    if isinstance(group, ShellGroup):
        level = system.level
        eta = gauss(max(level.through) + 2)
        u, v, w = (at_gauss(legendre, order, len(eta[0])) for order in level.through)
        table = shell_gradients(group.place.section, system.n, (u, v, w), eta)
        amplitudes = q.reshape(len(q), group.table.along.shape[2], -1)
        jets = np.moveaxis(group.table.along @ amplitudes[:, None], 1, 2)  # (elements, stations, 2, amplitudes)
        return np.asarray(np.einsum("esikpdm,esdm->esikp", table, jets))
    table_of_cells: CellTable = group.table
    count, _, _, functions = table_of_cells.gradients.shape
    g = table_of_cells.gradients @ q.reshape(count, 1, functions, 3)  # (cells, (r, z, over r), points, component)
    d_r, d_z, over_r = np.moveaxis(g, 1, 0)
    a, b, c = np.moveaxis(over_r, -1, 0)
    n = system.n
    around = np.stack([-n * a - b, a + n * b, -n * c], axis=-1)
    return np.asarray(np.stack([d_r, around, d_z], axis=1).transpose(0, 1, 3, 2)[:, None])


def _solid(mode: Mode) -> Solution:
    if mode.theory != "solid" or mode.solution is None or mode.resonator is None:
        raise ShellError("initial stress is computed in the solid theory: solve the mode with it.")
    return mode.solution


def _axisymmetric(mode: Mode) -> System:
    """The harmonic 0 on the elements of the mode."""
    solution = _solid(mode)
    assert mode.resonator is not None
    level, resonator = solution.system.level, mode.resonator
    return assemble(
        resonator, lay_resonator(resonator, mode.harmonic, level), 0, level, 2 if resonator.support == "free" else 0
    )


def _settle(system: System, elastic: Elastic, mode: Mode, load: Array) -> Solution:
    """The static answer to a load that leaves rigid motions alone: (K + s M) u = f + s M u, again and again."""
    assert mode.resonator is not None
    constants = tuple(find_constants(g.table.position, elastic, False) for g in system.groups)
    shift = 1e-2 * elastic.G / elastic.rho / mode.resonator.size**2 if system.rigid_motions else 0.0
    lam, G, rho = (list(kind) for kind in zip(*((*c.lame, c.rho) for c in constants), strict=True))
    K, M = system.operators(lam, G, rho, True, shift)
    factor = Factor(system.pattern, K)
    u = np.zeros((len(load), 1), order="F")
    for _ in range(STEPS):
        before, u = u, factor.solve(np.asfortranarray(load[:, None] + (shift * (M @ u) if shift else 0.0)))
        if not shift or np.max(abs(u - before)) <= DONE * np.max(abs(u)):
            return Solution(system, constants, u[:, 0])
    raise ShellError("the initial stress did not settle: the load moves the resonator as a whole.")


def _response(system: System, elastic: Elastic, solution: Solution, load: Array, mass: float) -> float:
    """Fᵀ (K - λ M)⁺ f without the mode itself: z = K⁻¹ (f + λ M z), which all higher modes let converge."""
    lam, G, rho = (list(kind) for kind in zip(*((*c.lame, c.rho) for c in solution.constants), strict=True))
    K, M = system.operators(lam, G, rho, True)
    factor, own = Factor(system.pattern, K), solution.vector[:, None]
    heavy = M @ own
    f = load[:, None] - heavy * (float(own[:, 0] @ load) / mass)
    z = np.zeros_like(f)
    for _ in range(STEPS * 10):
        before = z
        z = factor.solve(np.asfortranarray(f + solution.eigenvalue * (M @ z)))
        z = z - own * (float(heavy[:, 0] @ z[:, 0]) / mass)
        if np.max(abs(z - before)) <= 1e-9 * np.max(abs(z)):
            return float(f[:, 0] @ z[:, 0])
    raise ShellError("the next mode lies so near that its share in the effect of spin does not converge.")


def _shape(group: Group) -> tuple[int, int]:
    return group.table.volume.shape[0], group.table.volume.shape[1]


def _points(group: Group) -> int:
    return int(group.table.volume.shape[2])


def _radii(group: Group, system: System) -> Array:
    """Distance of the points from the axis, (elements, stations, points)."""
    if not isinstance(group, ShellGroup):
        return group.table.radius[:, None]
    section = group.place.section
    eta = gauss(max(system.level.through) + 2)[0]
    return np.asarray(section.r[..., None] - section.tangent_z[..., None] * section.thickness[..., None] * eta / 2)


def _radially(group: Group, amount: Array) -> Array:
    """A vector field along r, in the axes of a group: (elements, stations, 3, points)."""
    field = np.zeros((*amount.shape[:2], 3, amount.shape[2]))
    if isinstance(group, ShellGroup):
        section = group.place.section
        field[:, :, 0], field[:, :, 2] = section.tangent_r[..., None] * amount, -section.tangent_z[..., None] * amount
    else:
        field[:, :, 0] = amount
    return field


def _radial_and_around(group: Group, d: Array) -> tuple[Array, Array]:
    """Displacements along r and θ at the points."""
    if isinstance(group, ShellGroup):
        section = group.place.section
        return section.tangent_r[..., None] * d[:, :, 0] - section.tangent_z[..., None] * d[:, :, 2], d[:, :, 1]
    return d[:, :, 0], d[:, :, 1]
