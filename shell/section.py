"""The shape of a mode on the cross-section: sampled, and as a plain drawing where no three-dimensional picture is needed."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from shell.cells import in_order
from shell.quadrature import Array, hierarchic, legendre, nodal
from shell.resonator import Resonator
from shell.solution import Solution
from shell.system import ShellGroup

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SWING = 0.12  # of the largest extent, that the largest displacement is drawn as


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
            degree = group.mesh.grid.shape[2] - 1
            move, (i, j) = hierarchic(degree, x).values, in_order(degree)
            u = np.einsum("xk,yk,ekc->cexy", move[:, i], move[:, j], q.reshape(len(q), -1, 3))
            found += [ShapePatch(*fields) for fields in zip(*group.mesh.place(x, x), *u, strict=True)]
    return tuple(found)


def _shell_patches(
    resonator: Resonator, group: ShellGroup, orders: tuple[int, int, int], q: Array, x: Array
) -> list[ShapePatch]:
    along = nodal(group.table.along.shape[2] - 1, x).values
    through = [legendre(order, x).values for order in orders]
    splits = np.cumsum([order + 1 for order in orders])[:2]
    chain, found = group.chain, []
    for (one, two), segment, unknowns in zip(pairwise(chain.breaks), chain.segments, q, strict=True):
        at = resonator.at((one + two) / 2 + (two - one) / 2 * x, segment)
        amplitudes = along @ unknowns.reshape(along.shape[1], -1)
        u, v, w = (a @ modes.T for a, modes in zip(np.split(amplitudes, splits, axis=1), through, strict=True))
        t_r, t_z = at.tangent_r[:, None], at.tangent_z[:, None]
        found.append(ShapePatch(*at.at_heights(x), t_r * u - t_z * w, v, t_z * u + t_r * w))
    return found


def draw_section(patches: Sequence[ShapePatch], harmonic: int, title: str) -> "Figure":
    """Return the meridian section at rest and at full swing, (r, z) in mm, with θ = 0 on the right and 180° on the left."""
    from matplotlib.figure import Figure

    extent = max(float(max(np.max(p.r), np.ptp(p.z))) for p in patches)
    largest = max(float(np.max(np.hypot(p.u_r, p.u_z))) for p in patches)
    size = 0.0 if largest == 0.0 else SWING * extent / largest
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    axes = figure.subplots()
    for side, sign in ((1.0, 1.0), (-1.0, (-1.0) ** harmonic)):
        for move, colour, style in ((0.0, "#8a929c", "-"), (size, "#0072B2", "-"), (-size, "#0072B2", ":")):
            for p in patches:
                r, z = p.r + sign * move * p.u_r, p.z + sign * move * p.u_z
                for edge in ((0, slice(None)), (-1, slice(None)), (slice(None), 0), (slice(None), -1)):
                    axes.plot(1e3 * side * r[edge], 1e3 * z[edge], style, color=colour, linewidth=0.9)
    axes.set_aspect("equal")
    axes.set_xlabel("r (mm)")
    axes.set_ylabel("z (mm)")
    axes.set_title(f"{title} (displacement exaggerated)", fontsize=10, loc="left")
    return figure
