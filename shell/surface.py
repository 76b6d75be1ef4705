"""The closed surface of a resonator: its outlines turned around the axis into triangles, with the mode on every vertex."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shell.outline import Outline, trace_outlines
from shell.quadrature import Array
from shell.resonator import Resonator

if TYPE_CHECKING:
    from shell.modes import Mode

Triangles = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles around the material, counterclockwise as seen from outside."""

    points: Array  # (N, 3) array, m, undeformed vertices; the axis of the resonator is z
    displacement: Array  # (N, 3) array, shape of the mode, its largest displacement 1; zero without a mode
    energy: Array  # (N,) array, J/m³, largest strain-energy density in a period per square metre of amplitude
    position: Array  # (N,) array, place on the meridian, 0 ... 1
    triangles: Triangles  # (F, 3) array, vertex numbers
    # (k, count) arrays, vertex numbers of every outline, point by point (rows) and around; on the axis a number repeats
    grids: tuple[Triangles, ...]
    harmonic: int  # n; column j lies at θ = 2 π j / count, and cos nθ = 0 falls on columns

    @property
    def size(self) -> float:
        """Largest extent, m."""
        return float(np.ptp(self.points, axis=0).max())

    @property
    def nodes(self) -> list[Triangles]:
        """Vertex numbers along the 2n meridians on which u_r and u_z vanish, where the mode moves the shell at all."""
        moved = np.linalg.norm(self.displacement, axis=1)
        lines = []
        for grid in self.grids:
            quarter = grid.shape[1] // (4 * self.harmonic) if self.harmonic else 0
            moving = moved[grid].max(axis=1) > 0.03
            lines += [grid[moving, quarter * k] for k in range(1, 4 * self.harmonic, 2)]
        return lines

    @property
    def antinodes(self) -> Triangles:
        """Vertex numbers of the 2n places where the displacement in the meridional plane is largest."""
        if not self.harmonic:
            return np.zeros(0, dtype=np.int64)
        outer = self.grids[0]
        at_zero = np.hypot(self.displacement[outer[:, 0], 0], self.displacement[outer[:, 0], 2])
        return outer[int(at_zero.argmax()), :: outer.shape[1] // (2 * self.harmonic)]


def build_surface(
    resonator: Resonator, mode: "Mode | None" = None, spacing: float | None = None, count: int | None = None
) -> Surface:
    """Turn the section of a resonator into its surface: points R/50 or `spacing` (m) apart, and `count` around, up to a multiple of 4n."""
    n = mode.harmonic if mode else 0
    around = 4 * max(n, 1) * int(np.ceil((count or 160) / (4 * max(n, 1))))
    return revolve(trace_outlines(resonator, spacing or resonator.size / 50, mode), around, n)


def revolve(outlines: Sequence[Outline], count: int, n: int) -> Surface:
    """Turn outlines around the axis; points on the axis become one vertex each, so the surface is watertight."""
    theta = 2 * pi * np.arange(count) / count
    # for n = 0 the torsional displacement varies as 1, not as sin 0
    cosine, sine = np.cos(n * theta), np.sin(n * theta) if n else np.ones(count)
    points, moved, energy, position, triangles, grids = [], [], [], [], [], []
    start = 0
    for line in outlines:
        on_axis = line.r == 0
        widths = np.where(on_axis, 1, count)
        first = start + np.concatenate([[0], np.cumsum(widths)[:-1]])
        grid = first[:, None] + np.where(on_axis[:, None], 0, np.arange(count))
        start += int(widths.sum())
        kept = ~on_axis[:, None] | (np.arange(count) == 0)
        u_r, u_t, u_z = line.displacement[:, :, None] * np.stack([cosine, sine, cosine])[:, None, :]
        x = np.stack(
            [line.r[:, None] * np.cos(theta), line.r[:, None] * np.sin(theta), line.z[:, None] + 0 * theta], axis=-1
        )
        u = np.stack(
            [u_r * np.cos(theta) - u_t * np.sin(theta), u_r * np.sin(theta) + u_t * np.cos(theta), u_z], axis=-1
        )
        density = line.energy[0][:, None] * cosine**2 + line.energy[1][:, None] * sine**2
        points.append(x[kept])
        moved.append(u[kept])
        energy.append(density[kept])
        position.append(np.broadcast_to(line.position[:, None], kept.shape)[kept])
        triangles.append(_triangulate(grid, closed=not line.on_axis))
        grids.append(grid)
    return Surface(
        np.concatenate(points), np.concatenate(moved), np.concatenate(energy), np.concatenate(position),
        np.concatenate(triangles), tuple(grids), n,
    )  # fmt: skip


def _triangulate(grid: Triangles, closed: bool) -> Triangles:
    """Two triangles for every cell of the grid, without those that the axis makes vanish."""
    here, there = (grid, np.roll(grid, -1, axis=0)) if closed else (grid[:-1], grid[1:])
    here_on, there_on = np.roll(here, -1, axis=1), np.roll(there, -1, axis=1)
    faces = np.concatenate(
        [np.stack([here, here_on, there_on], axis=-1), np.stack([here, there_on, there], axis=-1)]
    ).reshape(-1, 3)
    real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return np.asarray(faces[real])
