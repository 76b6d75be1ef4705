"""The parts of one resonator in a picture."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shell.quadrature import Array
from shell.surface import Surface

AZIMUTHS = ("0°", "90°")
EXAGGERATION = 0.12  # largest displacement in a picture over the size of the resonator


@dataclass(frozen=True, eq=False)
class Scene:
    """One resonator in a picture."""

    # (N, 3) arrays, m, vertices and what is added to them at the largest swing, already exaggerated
    points: Array
    displacement: Array
    triangles: NDArray[np.int64]  # (F, 3) array
    values: Array  # (N,) array, what the colour shows
    legend: str  # quantity and unit of the values
    title: str  # a line above the resonator; a second line stands below it as a remark
    nodes: NDArray[np.int64]  # (L, k) array, vertex numbers along each nodal line, -1 after its end
    antinodes: NDArray[np.int64]  # (A,) array, vertex numbers
    opens_up: bool  # whether the open end is at the larger z, from where it is then seen
    # (A, 2, 3) array, m, lines across the rim: axes of the slower mode of a split pair, then as many of the faster
    axes: Array = field(default_factory=lambda: np.zeros((0, 2, 3)))

    @property
    def azimuths(self) -> Array:
        """Where the azimuths 0° (x) and 90° (y) lie, beyond the ends of the axes, (2, 3) in m; none where there are no axes."""
        if not len(self.axes):
            return np.zeros((0, 3))
        x, y, z = self.axes[0, 0]
        return np.array([[1.08 * np.hypot(x, y), 0.0, z], [0.0, 1.08 * np.hypot(x, y), z]])

    @property
    def reach(self) -> Array:
        """All that must be seen, (M, 3) in m: the swinging resonator, the axes and the marks."""
        swinging = [self.points + sign * self.displacement for sign in (-1, 1)]
        return np.concatenate([*swinging, self.axes.reshape(-1, 3), self.azimuths])


def compose_scene(surface: Surface, values: Array, legend: str, title: str = "", axes: Array | None = None) -> Scene:
    """Compose a picture of a mode: nodal meridians and antinodes marked, the displacement exaggerated to a visible size."""
    lines = surface.nodes
    nodes = np.full((len(lines), max(map(len, lines), default=0)), -1, dtype=np.int64)
    for k, line in enumerate(lines):
        nodes[k, : len(line)] = line
    rim = surface.position > 0.98
    opens_up = bool(surface.points[rim, 2].mean() > surface.points[:, 2].mean()) if rim.any() else False
    swing = surface.displacement * EXAGGERATION * surface.size
    return Scene(
        surface.points, swing, surface.triangles, np.asarray(values, dtype=float), legend, title, nodes,
        surface.antinodes, opens_up, np.zeros((0, 2, 3)) if axes is None else axes,
    )  # fmt: skip
