r"""Finite displacements: the quadratic part of Green's strain, for a wave around the axis.

With E_ij = ½ (u_i,j + u_j,i + u_k,i u_k,j) = e + ½ q and the energy ½ ∫ E : C : E dV, three fields meet in

    ½ ∫ q(u, u) : C : e(ψ) dV + ∫ σ_ij(u) u_k,i ψ_k,j dV = g · ψ,      q_ij(u, u) = u_k,i u_k,j.

Of u ~ cos nθ both q and g have the waves 0 and 2n. The same g says what a static field ψ does to the mode (shell.prestress:
the work of its prestress, 2 g · ψ) and what the mode at finite amplitude does to itself (shell.duffing).
"""

from dataclasses import dataclass

import numpy as np

from shell.cells import CellTable, derivatives
from shell.errors import ShellError
from shell.kernel import NO_FORCE, PAIRS, TENSOR, shell_gradients
from shell.modes import Mode
from shell.quadrature import Array, gauss
from shell.solution import Solution
from shell.system import Group, ShellGroup, System

AROUND = np.array([[(i == 1) != (k == 1) for k in range(3)] for i in range(3)])  # what varies as sin nθ


def solved_as_solid(mode: Mode) -> Solution:
    """The solution of a mode of the solid theory."""
    if mode.theory != "solid":
        raise ShellError("initial stress and large amplitudes need a mode of the solid theory.")
    return mode.solution


def displacement_gradients(system: System, group: Group, q: Array) -> Array:
    """∂_i u_k of element unknowns (elements, size): (elements, stations, i, k, points), i and k along the group's axes."""
    if isinstance(group, ShellGroup):
        amplitudes = q.reshape(len(q), group.table.along.shape[2], -1)
        jets = np.moveaxis(group.table.along @ amplitudes[:, None], 1, 2)  # (elements, stations, 2, amplitudes)
        return np.asarray(np.einsum("esikpdm,esdm->esikp", _table(system, group), jets, optimize=True))
    table: CellTable = group.table
    count, _, _, functions = table.gradients.shape
    g = table.gradients @ q.reshape(count, 1, functions, 3)  # (cells, (r, z, over r), points, component)
    flat = derivatives(system.n).reshape(9, 9) @ g.transpose(0, 1, 3, 2).reshape(count, 9, -1)
    return np.asarray(flat.reshape(count, 1, 3, 3, -1))


def gradient_loads(system: System, group: Group, P: Array) -> Array:
    """∫ P_ik ∂_i ψ_k dV of all functions ψ of a group, for P (elements, stations, i, k, points)."""
    if isinstance(group, ShellGroup):
        weighted = P * group.table.volume[:, :, None, None]
        jets = np.einsum("esikp,esikpdm->esdm", weighted, _table(system, group), optimize=True)
        return np.asarray(np.einsum("dsf,esdm->efm", group.table.along, jets))
    table: CellTable = group.table
    weighted = (P * table.volume[:, :, None, None]).reshape(len(P), 9, -1)
    dual = (derivatives(system.n).reshape(9, 9).T @ weighted).reshape(len(P), 3, 3, -1)
    return np.asarray((np.swapaxes(table.gradients, 2, 3) @ np.swapaxes(dual, 2, 3)).sum(axis=1))


def squared(H: Array, doubled: bool) -> Array:
    """The wave 0, or 2n if `doubled`, of q(u, u) with the gradients H of u ~ cos nθ: engineering strains (…, 6, points)."""
    q = _meet(np.swapaxes(H, 2, 3), np.swapaxes(H, 2, 3), doubled)  # q_ij = Σ_k H_ik H_jk
    return np.stack([q[:, :, i, j] * (1.0 if i == j else 2.0) for i, j in PAIRS], axis=2)


@dataclass(frozen=True, eq=False)
class QuadraticForce:
    """The force g of u ~ cos nθ on the wave 0 or 2n with the same elements: integrals over the π of cos² 2nθ, or over 2π."""

    stretch: Array  # stretch, turn: its two terms, ½ q : C : e(ψ) and σ_ij u_k,i ψ_k,j
    turn: Array
    # q(u, u) of that wave at the points of every group, engineering strains (elements, stations, 6, points)
    squares: list[Array]

    @classmethod
    def of(cls, solution: Solution, system: System) -> "QuadraticForce":
        """On a system of the harmonic 0 or 2n."""
        doubled = system.n != 0
        stretch, turn, squares = [], [], []
        for group, partner, q, stress, c in zip(
            solution.system.groups, system.groups, solution.unknowns, solution.stress, solution.constants, strict=True
        ):
            H = displacement_gradients(solution.system, group, q)
            squares.append(squared(H, doubled))
            stretch.append(partner.table.loads(c.stress(partner.table, squares[-1]) / 2, NO_FORCE))
            turn.append(gradient_loads(system, partner, _meet(stress[:, :, TENSOR], H, doubled)))
        return cls(system.gather(stretch), system.gather(turn), squares)

    @property
    def whole(self) -> Array:
        """Both terms."""
        return self.stretch + self.turn


def _meet(A: Array, B: Array, doubled: bool) -> Array:
    """Σ_i A_ij B_ik of two tensors ~ cos nθ (sin nθ with one index around): its wave 2n, or 0, as (…, j, k, points)."""
    both = AROUND[:, :, None] & AROUND[:, None, :]  # sin · sin = ½ (1 - cos 2nθ)
    sign = np.where(both, -0.5, 0.5) if doubled else np.where(np.broadcast_to(AROUND, (3, 3, 3)), 0.0, 0.5)
    return np.asarray(np.einsum("ijk,esijp,esikp->esjkp", sign, A, B, optimize=True))


def _table(system: System, group: ShellGroup) -> Array:
    through = system.level.through
    return shell_gradients(group.section, system.n, through, gauss(max(through) + 2)[0])[0]
