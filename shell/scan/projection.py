"""Projection of measured points onto the shell: position along the meridian, azimuth, distance from the middle surface."""

from dataclasses import dataclass

import numpy as np
import scipy

from shell.errors import ShellError
from shell.quadrature import Array
from shell.resonator import Resonator

FINE = 8001  # samples of the meridian; between them the distance is exact to (spacing)² κ/8
CELLS = 300  # cells of the table of nearest samples along the longer side
COARSE = 10  # samples per entry of the table
CHUNK = 500_000  # points at a time
FEWEST = 20  # points of a face


@dataclass(frozen=True, eq=False)
class Places:
    """Points on the shell: position 0 ... 1, azimuth (rad), height ζ above the middle surface (m), nominal thickness (m)."""

    position: Array
    azimuth: Array
    height: Array
    thickness: Array


class Projector:
    """Finds the nearest place of the middle surface: a table of the (r, z) plane, then the curve's own tangent and curvature."""

    def __init__(self, resonator: Resonator) -> None:
        self.resonator = resonator
        self.line = line = resonator.sample(FINE)
        reach = 3 * float(line.thickness.max()) + 0.1 * resonator.size
        cell = (max(np.ptp(line.r), np.ptp(line.z)) + 2 * reach) / CELLS
        axes = [np.arange(x.min() - reach, x.max() + reach + cell, cell) for x in (line.r, line.z)]
        tree = scipy.spatial.cKDTree(np.stack([line.r, line.z], axis=1)[::COARSE])
        nearest = COARSE * np.asarray(tree.query(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))[1])
        self.nearest = scipy.interpolate.RegularGridInterpolator(
            axes, nearest, method="nearest", bounds_error=False, fill_value=0
        )
        self.step = resonator.length / (FINE - 1)

    def place(self, points: Array) -> Places:
        """The places of points (count, 3), m."""
        found = [self._place(points[k : k + CHUNK]) for k in range(0, max(len(points), 1), CHUNK)]
        return Places(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def _place(self, points: Array) -> tuple[Array, Array, Array, Array]:
        line, x, y, z = self.line, points[:, 0], points[:, 1], points[:, 2]
        r = np.hypot(x, y)
        s = line.arc_length[self.nearest((r, z)).astype(np.intp)]
        for _ in range(3):
            k = np.clip(np.rint(s / self.step).astype(np.intp), 0, FINE - 1)
            d_r, d_z = r - line.r[k], z - line.z[k]
            height = d_z * line.tangent_r[k] - d_r * line.tangent_z[k]
            bent = 1 + line.curvature[k] * height
            along = (d_r * line.tangent_r[k] + d_z * line.tangent_z[k]) / bent
            s = line.arc_length[k] + along
        # the curve leaves its tangent by κ s²/2, towards the side where ζ < 0
        height = height + line.curvature[k] * along**2 * bent / 2
        return s / self.resonator.length, np.arctan2(y, x), height, line.thickness[k]


def check_unit(points: Array, resonator: Resonator, name: str) -> None:
    """Refuse points whose size is not that of the resonator."""
    line = resonator.sample(401)
    nominal = max(2 * float(line.r.max()), float(np.ptp(line.z)))
    low, high = np.percentile(points[:: max(1, len(points) // 20000)], [0.5, 99.5], axis=0)
    measured = float((high - low).max())
    if len(points) < FEWEST:
        raise ShellError(f"{name}: {len(points)} points are too few to fit a face; at least {FEWEST} are needed.")
    if not 0.45 * nominal < measured < 2.2 * nominal:
        ratio = measured / nominal
        guess = {
            3: "µm read as mm, or mm as m",
            -3: "mm read as µm, or m as mm",
            6: "µm read as m",
            -6: "m read as µm",
            1: "mm against cm",
            -1: "cm against mm",
        }
        power = round(np.log10(ratio)) if ratio > 0 else 0
        hint = f" ({guess[power]}?)" if power in guess else ""
        raise ShellError(
            f"{name}: the points span {1e3 * measured:.4g} mm, the resonator of the card {1e3 * nominal:.4g} mm{hint}; "
            "state the unit of the file (--unit), or use the card of this resonator."
        )
