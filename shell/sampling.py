"""The shape of a mode on the cross-section, for pictures and meshes."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shell.cells import in_order
from shell.quadrature import Array, hierarchic, legendre, nodal
from shell.resonator import Resonator
from shell.solution import Solution
from shell.system import ShellGroup, SolidGroup


@dataclass(frozen=True, eq=False)
class ShapePatch:
    """A curved grid (i, j) of the cross-section: r, z in m, amplitudes of u_r, u_z (cos nθ) and u_theta (sin nθ)."""

    r: Array
    z: Array
    u_r: Array
    u_theta: Array
    u_z: Array


def sample_shape(resonator: Resonator, solution: Solution, points: int) -> tuple[ShapePatch, ...]:
    """The whole section as grids of `points` by `points`, one for each element."""
    x = np.linspace(-1, 1, points)
    found: list[ShapePatch] = []
    for group, q in zip(solution.system.groups, solution.unknowns, strict=True):
        if isinstance(group, ShellGroup):
            found += _shell_patches(resonator, group, solution.system.level.through, q, x)
        else:
            found += _solid_patches(group, q, x)
    return tuple(found)


def _shell_patches(
    resonator: Resonator, group: ShellGroup, orders: tuple[int, int, int], q: Array, x: Array
) -> list[ShapePatch]:
    along = nodal(group.table.along.shape[2] - 1, x).values
    through = [legendre(order, x).values for order in orders]
    splits = np.cumsum([order + 1 for order in orders])[:2]
    chain, found = group.place.chain, []
    for (one, two), segment, unknowns in zip(pairwise(chain.breaks), chain.segments, q, strict=True):
        at = resonator.at((one + two) / 2 + (two - one) / 2 * x, segment)
        amplitudes = along @ unknowns.reshape(along.shape[1], -1)
        u, v, w = (a @ modes.T for a, modes in zip(np.split(amplitudes, splits, axis=1), through, strict=True))
        zeta = at.thickness[:, None] / 2 * x
        t_r, t_z = at.tangent_r[:, None], at.tangent_z[:, None]
        found.append(
            ShapePatch(at.r[:, None] - zeta * t_z, at.z[:, None] + zeta * t_r, t_r * u - t_z * w, v, t_z * u + t_r * w)
        )
    return found


def _solid_patches(group: SolidGroup, q: Array, x: Array) -> list[ShapePatch]:
    degree = group.place.mesh.grid.shape[2] - 1
    place, move = nodal(degree, x).values, hierarchic(degree, x).values
    r, z = np.einsum("ia,geab,jb->geij", place, group.place.mesh.grid, place)
    i, j = in_order(degree)
    u = np.einsum("xk,yk,ekc->cexy", move[:, i], move[:, j], q.reshape(len(q), -1, 3))
    return [ShapePatch(*fields) for fields in zip(r, z, *u, strict=True)]
