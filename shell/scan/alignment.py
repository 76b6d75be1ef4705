r"""The rigid motion from the frame of a measurement to that of the resonator.

Points of a face lie off it by δ; a motion by t and a small rotation ω changes δ by (t + ω x p) · n. The motion with the least
Σ ρ(δ), ρ robust, is found by repeated linear steps; what the shape does not tell (the azimuth about the axis; the tilts of
a part of a sphere) stays as it is. A dome's tilt is then taken from its edge: its points must end at one position all around.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shell.curves import Arc
from shell.errors import ShellError
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.scan.projection import Projector

UNTOLD = 1e-4  # singular value over the largest from which on the shape does not tell a direction of motion
SETTLED = 8  # steps after which points count alike, those far off left out
SAMPLE = 20_000  # points that the motion is found from
EDGE_SAMPLE = 1_000_000  # and its edge
SECTORS = 72  # azimuths of the edge
REACHED = 0.98  # position beyond which points end at the rim
LOOSE = 0.2  # scatter over the wall from which on points do not lie on a face
GIVEN = np.deg2rad(0.1)  # error of an axis that is taken as it is given


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """p -> rotation p + offset; `told` which of the shifts x, y, z (m) and turns about x, y are known, `tilt_error` (rad) else."""

    rotation: Array
    offset: Array
    told: tuple[bool, bool, bool, bool, bool]
    tilt_error: float = 0.0

    def apply(self, points: Array) -> Array:
        """Points (count, 3) in the frame of the resonator."""
        return np.asarray(points @ self.rotation.T + self.offset)

    @property
    def tilt(self) -> float:
        """Angle of the axis, rad."""
        return float(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0)))


def align(clouds: Sequence[tuple[Array, int]], projector: Projector, names: Sequence[str]) -> RigidMotion:
    """One motion for clouds that share a frame: points (count, 3) in m with the height η = -1 or 1 of their face."""
    resonator = projector.resonator
    samples = [(points[:: max(1, len(points) // SAMPLE)], side) for points, side in clouds]
    best: tuple[float, RigidMotion] | None = None
    for start in _starts(samples, resonator):
        motion, left = _descend(samples, projector, start)
        if best is None or left < best[0]:
            best = left, motion
        if best[0] < 0.02 * float(projector.line.thickness.max()):
            break
    assert best is not None
    motion = best[1]
    _check(samples, projector, motion, names)
    if not (motion.told[3] and motion.told[4]):
        motion = _upright(clouds, projector, motion)
    return motion


def _descend(samples: list[tuple[Array, int]], projector: Projector, start: RigidMotion) -> tuple[RigidMotion, float]:
    rotation, offset = start.rotation, start.offset
    size = projector.resonator.size
    told, left = np.zeros(5, dtype=bool), np.inf
    for count in range(25):
        rows, residual = [], []
        for points, side in samples:
            moved = points @ rotation.T + offset
            n, off = _normals(moved, side, projector)
            turn = np.cross(moved, n) / size  # (ω x p) · n = ω · (p x n)
            rows.append(np.concatenate([n, turn[:, :2]], axis=1))
            residual.append(off)
        A, d = np.concatenate(rows), np.concatenate(residual)
        spread = float(scipy.stats.median_abs_deviation(d, scale="normal")) + 1e-12
        far = abs(d - np.median(d)) / spread
        # weights that fall with the distance find the place; equal ones do not let the form of the face push it aside
        weight = 1 / np.maximum(1.0, far / 2) if count < SETTLED else np.where(far < 6, 1.0, 0.0)
        # the mean off the face is form, not motion: it gets a column of its own
        A = np.column_stack([A, np.ones(len(A))])
        _, values, turned = np.linalg.svd((A * weight[:, None]).T @ A, hermitian=True)
        kept = values > UNTOLD * values[0]
        step = -(turned[kept].T / values[kept]) @ (turned[kept] @ ((A * weight[:, None]).T @ d))
        told = np.sum(turned[kept] ** 2, axis=0)[:5] > 0.5
        spin = scipy.spatial.transform.Rotation.from_rotvec([step[3] / size, step[4] / size, 0.0]).as_matrix()
        rotation, offset = spin @ rotation, spin @ offset + step[:3]
        left = spread
        if count > SETTLED and np.abs(step[:5]).max() < 1e-9 * size:
            break
    return RigidMotion(rotation, offset, tuple(bool(x) for x in told)), left  # type: ignore[arg-type]


def _normals(points: Array, side: int, projector: Projector) -> tuple[Array, Array]:
    """Normals out of the middle surface, and how far points lie off their face along them."""
    at = projector.place(points)
    line = projector.line
    k = np.clip(np.rint(at.position * (len(line.r) - 1)).astype(np.intp), 0, len(line.r) - 1)
    n = np.stack(
        [line.normal_r[k] * np.cos(at.azimuth), line.normal_r[k] * np.sin(at.azimuth), line.normal_z[k]], axis=1
    )
    return n, at.height - side * at.thickness / 2


def _starts(samples: list[tuple[Array, int]], resonator: Resonator) -> list[RigidMotion]:
    """The frame as it is; else a dome's centre by the sphere through its points and its axis by their mean direction."""
    unknown = (False,) * 5
    starts = [RigidMotion(np.eye(3), np.zeros(3), unknown)]
    points = np.concatenate([points for points, _ in samples])
    line = resonator.sample(401)
    dome = resonator.segments[0]
    if len(resonator.segments) == 1 and isinstance(dome, Arc):
        A = np.column_stack([2 * points, np.ones(len(points))])
        center = np.linalg.lstsq(A, (points**2).sum(axis=1), rcond=None)[0][:3]
        axis = (points - center).mean(axis=0)
        nominal = float((line.r * (line.z - dome.center[1])).sum())
        wanted = np.array([0.0, 0.0, np.sign(nominal) or 1.0])
        spin = scipy.spatial.transform.Rotation.align_vectors(wanted, axis)[0].as_matrix()  # the smallest one
        starts.append(RigidMotion(spin, np.array([0.0, 0.0, dome.center[1]]) - spin @ center, unknown))
    middle = (np.percentile(points, 1, axis=0) + np.percentile(points, 99, axis=0)) / 2
    wanted = np.array([0.0, 0.0, (line.z.min() + line.z.max()) / 2])
    starts.append(RigidMotion(np.eye(3), wanted - middle, unknown))
    flip = np.diag([1.0, -1.0, -1.0])
    starts.append(RigidMotion(flip, wanted - flip @ middle, unknown))
    return starts


def _check(samples: list[tuple[Array, int]], projector: Projector, motion: RigidMotion, names: Sequence[str]) -> None:
    for (points, side), name in zip(samples, names, strict=True):
        _, off = _normals(motion.apply(points), side, projector)
        h, middle = float(np.median(projector.line.thickness)), float(np.median(off))
        spread = float(scipy.stats.median_abs_deviation(off, scale="normal"))
        if abs(middle + side * h) < 0.3 * h and spread < LOOSE * h:
            here, there = ("outer", "inner") if side == projector.resonator.outward else ("inner", "outer")
            raise ShellError(f"{name}: the points of the {here} face lie on the {there} face; exchange the files.")
        if abs(middle) > 0.5 * h or spread > LOOSE * h:
            frames = "; perhaps the faces do not share one frame (hrg scan --frames own)" if len(names) > 1 else ""
            raise ShellError(
                f"{name}: the points do not fit the face of the card: after alignment they are "
                f"{1e3 * middle:.3g} mm off with a scatter of {1e3 * spread:.3g} mm{frames}. Check the card's dimensions and the unit."
            )


def _upright(clouds: Sequence[tuple[Array, int]], projector: Projector, motion: RigidMotion) -> RigidMotion:
    """Turn a dome about its centre until its points end at the same position all around.

    The edge is the lowest s = a + b cos θ + c sin θ above all points (a linear programme), so that gaps do no harm; it errs
    by about the distance between points at the edge. Points that do not reach the rim end where the instrument did, and
    tell nothing: the axis stays as it was given.
    """
    resonator, dome = projector.resonator, projector.resonator.segments[0]
    for _ in range(3):
        s, theta = _edge(clouds, projector, motion)
        if len(s) < SECTORS // 2 or s.max() < REACHED:
            return replace(motion, tilt_error=GIVEN)
        A = np.column_stack([np.ones(len(s)), np.cos(theta), np.sin(theta)])
        found = scipy.optimize.linprog([1.0, 0.0, 0.0], A_ub=-A, b_ub=-s, bounds=[(None, None)] * 3)
        if found.x is None:
            return replace(motion, tilt_error=GIVEN)
        tilt = found.x[1:] * resonator.length / resonator.size
        spin = scipy.spatial.transform.Rotation.from_rotvec([tilt[1], -tilt[0], 0.0]).as_matrix()
        center = np.array([0.0, 0.0, dome.center[1] if isinstance(dome, Arc) else 0.0])
        # how far the sectors end below the edge: points are so far apart there, SECTORS times closer over the whole circle
        apart = float(np.median(A @ found.x - s)) * resonator.length / resonator.size / SECTORS
        motion = RigidMotion(spin @ motion.rotation, spin @ (motion.offset - center) + center, motion.told, 4 * apart)
    return motion


def _edge(clouds: Sequence[tuple[Array, int]], projector: Projector, motion: RigidMotion) -> tuple[Array, Array]:
    """The last point of every sector: position and azimuth."""
    s: list[Array] = []
    theta: list[Array] = []
    for points, side in clouds:
        at = projector.place(motion.apply(points[:: max(1, len(points) // EDGE_SAMPLE)]))
        off = at.height - side * at.thickness / 2
        scatter = float(scipy.stats.median_abs_deviation(off, scale="normal"))
        near = abs(off - np.median(off)) < 10 * scatter + 1e-9
        x, angle = at.position[near], at.azimuth[near] % (2 * np.pi)
        sector = np.minimum((angle / (2 * np.pi) * SECTORS).astype(np.intp), SECTORS - 1)
        order = np.lexsort((x, sector))
        last = order[np.flatnonzero(np.diff(sector[order], append=SECTORS))]
        s.append(x[last])
        theta.append(angle[last])
    return np.concatenate(s), np.concatenate(theta)
