"""From measured faces of a card's resonator to its waves, its roundness and the split that they cause."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi
from typing import Literal

import numpy as np

from compensation.arrays import Array
from compensation.constants import NINETY
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, Split, find_split
from shell.imperfection.field import NOTHING
from shell.modes import solve_modes
from shell.resonator import FaceName, Resonator
from shell.scan.alignment import RigidMotion, align
from shell.scan.projection import Projector, check_unit
from shell.scan.survey import Face, fewest_points, most_waves, rigid_shapes, survey, survey_map
from studies.errors import InputError, numbered
from studies.files.clouds import FaceGrid, Unit, read_cloud

COVERAGE = 0.9
DRAWS = 4000


@dataclass(frozen=True)
class ScanInterval:
    """A value with its 90 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class SplitOfScan:
    """The split of one harmonic by the measured faces."""

    split: Split  # to first order, most probable
    hertz: ScanInterval
    relative: ScanInterval
    slow_axis: ScanInterval | None  # rad; None where the split is not told from 0
    error: float  # of either part of the relative split
    whole: Split  # with all orders


@dataclass(frozen=True)
class FaceWave:
    """A wave around of a face, the wall or the offset at a position: amplitude (m) and azimuth of a crest (rad)."""

    quantity: str
    order: int
    position: float
    amplitude: ScanInterval
    azimuth: float


@dataclass(frozen=True)
class Roundness:
    """A circle of a face: peak to valley and rms (m) of the waves from 2 up (1 is eccentricity)."""

    face: str
    position: float
    peak_to_valley: float
    rms: float


@dataclass(frozen=True, eq=False)
class Scan:
    """Measured faces with what follows from them."""

    faces: dict[str, Face]
    imperfection: Imperfection
    splits: tuple[SplitOfScan, ...]
    waves: tuple[FaceWave, ...]
    roundness: tuple[Roundness, ...]

    def map_of(self, quantity: str, rows: int = 60, columns: int = 180) -> tuple[Array, Array, Array]:
        """Positions, azimuths and the fitted departure (m) on a grid of what was covered."""
        x, theta = np.linspace(*covered(self.faces), rows), 2 * pi * np.arange(columns) / columns
        parts = (factor * self.faces[name].profile(x, theta) for name, factor in parts_of(quantity))
        return x, theta, np.asarray(sum(parts))


def covered(faces: Mapping[str, Face]) -> tuple[float, float]:
    """Where the positions that all faces cover start and end."""
    waves = [face.waves for face in faces.values()]
    return max(one.low for one in waves), min(one.high for one in waves)


def parts_of(quantity: str) -> list[tuple[str, float]]:
    """Wall = inner + outer, offset of the middle surface = (outer - inner)/2, of departures out of the material."""
    both = {"wall": [("inner", 1.0), ("outer", 1.0)], "offset": [("inner", -0.5), ("outer", 0.5)]}
    return both.get(quantity, [(quantity, 1.0)])


def scan_faces(
    resonator: Resonator, elastic: Elastic, files: dict[FaceName, str], *, unit: Unit = "mm",
    frames: Literal["own", "common"] = "own", harmonics: tuple[int, ...] = (1, 2, 3, 4), highest: int = 12,
    theory: Literal["solid", "shell"] = "solid", say: Callable[[str], None] = lambda _: None,
) -> Scan:  # fmt: skip
    """Read, align ("own" frames or one "common") and fit the faces up to the `highest` wave, and find the splits of harmonics n."""
    if 2 * max(harmonics) > highest:
        needed = f"the split of n = {max(harmonics)} needs harmonic {2 * max(harmonics)} of the faces"
        raise InputError(f"{needed}; set --highest to at least that.")
    read = {name: read_cloud(path, unit) for name, path in files.items()}
    clouds = {name: cloud for name, cloud in read.items() if not isinstance(cloud, FaceGrid)}
    projector = Projector(resonator) if clouds else None
    faces: dict[str, Face] = {}
    for name, points in clouds.items():
        check_unit(points, resonator, files[name])
        if len(points) < (fewest := fewest_points(2 * max(harmonics))):
            raise InputError(f"{files[name]}: {numbered(len(points), 'point')} are too few for the split of n = {max(harmonics)}; {fewest} are needed.")  # fmt: skip
        if highest > (most := most_waves(len(points))):
            raise InputError(f"--highest {highest}: {len(points)} points of {files[name]} allow up to {most}; lower it.")  # fmt: skip
    if clouds and projector is not None:
        say("aligning the faces")
        together = [list(clouds)] if frames == "common" else [[name] for name in clouds]
        motions: dict[str, RigidMotion] = {}
        for names in together:
            motion = align(
                [(clouds[name], resonator.height_of(name)) for name in names],
                projector,
                [files[name] for name in names],
            )
            motions |= dict.fromkeys(names, motion)
        for name, points in clouds.items():
            say(f"fitting the {name} face: {len(points)} points")
            face = survey(points, resonator.height_of(name), motions[name], projector, files[name], highest)
            alone = frames == "own" or len(clouds) == 1
            faces[name] = face.centred(rigid_shapes(face.waves, projector)) if alone else face
    for name, cloud in read.items():
        if isinstance(cloud, FaceGrid):
            faces[name] = survey_map(cloud.position, cloud.azimuth, cloud.values, files[name], highest)
    faces = {name: faces[name] for name in ("inner", "outer") if name in faces}
    _check_wall(faces, resonator)
    inner, outer = (faces[name].field if name in faces else NOTHING for name in ("inner", "outer"))
    imperfection = Imperfection(inner=inner, outer=outer)
    splits = []
    for n in harmonics:
        say(f"computing the split of n = {n}")
        (mode,) = solve_modes(resonator, elastic, n, theory=theory)
        splits.append(_split(Pair(mode), CoupledHarmonics(mode, elastic, n + 8), faces, imperfection))
    return Scan(faces, imperfection, tuple(splits), _waves(faces), _roundness(faces))


def _check_wall(faces: dict[str, Face], resonator: Resonator) -> None:
    if len(faces) < 2:
        return
    x = np.linspace(*covered(faces), 40)
    theta = 2 * pi * np.arange(72) / 72
    nominal = resonator.at(x * resonator.length).thickness[:, None]
    wall = nominal + sum(face.profile(x, theta) for face in faces.values())
    if np.any(wall <= 0):
        raise ShellError("the measured faces cross each other: they do not share one frame, or belong to different resonators; check the files.")  # fmt: skip


def _split(pair: Pair, coupled: CoupledHarmonics, faces: dict[str, Face], imperfection: Imperfection) -> SplitOfScan:
    n = pair.mode.harmonic
    inner, outer = pair.faces
    covariance = np.zeros((2, 2))
    for name, face in faces.items():
        covariance += face.project(outer if name == "outer" else inner, 2 * n)[1]
    first = find_split(pair, imperfection)
    relative, axis = polar_intervals(first.wave, covariance, 2 * n)
    f = pair.mode.frequency
    hertz = ScanInterval(f * relative.value, f * relative.low, f * relative.high)
    if axis is not None:
        half = pi / (2 * n)
        axis = ScanInterval(first.slow_axis, axis.low + half, axis.high + half)
        turn = round((axis.value - (axis.low + axis.high) / 2) / (pi / n)) * pi / n
        axis = ScanInterval(axis.value, axis.low + turn, axis.high + turn)
    error = float(np.sqrt(np.trace(covariance) / 2))
    return SplitOfScan(first, hertz, relative, axis, error, coupled.solve(imperfection))


def polar_intervals(wave: complex, covariance: Array, fold: int) -> tuple[ScanInterval, ScanInterval | None]:
    """90 % intervals of |z| and arg z/fold of a complex number with Gaussian errors; no axis where 0 is within its error."""
    draws = np.random.default_rng(7).standard_normal((DRAWS, 2)) @ np.linalg.cholesky(covariance + 1e-300 * np.eye(2)).T
    z = wave + draws[:, 0] + 1j * draws[:, 1]
    tails = [50 * (1 - COVERAGE), 50 * (1 + COVERAGE)]
    low, high = (float(q) for q in np.percentile(abs(z), tails))
    told = abs(wave) ** 2 > 6 * float(np.trace(covariance)) / 2
    size = ScanInterval(abs(wave), low if told else 0.0, high)
    if not told:
        return size, None
    turned = np.angle(z / wave)
    a, b = (float(q) for q in np.percentile(turned, tails))
    at = float(np.angle(wave))
    return size, ScanInterval(at / fold, (at + a) / fold, (at + b) / fold)


def _waves(faces: dict[str, Face]) -> tuple[FaceWave, ...]:
    """Waves 0 ... 8 of each face, the wall and the offset, at the rim end of what was covered and at its middle."""
    found = []
    low, high = covered(faces)
    for quantity in (*faces, *(("wall", "offset") if len(faces) == 2 else ())):
        for position in ((low + high) / 2, high):
            orders = range(min(8, *(f.waves.highest for f in faces.values())) + 1)
            found += [_wave(faces, quantity, order, position) for order in orders]
    return tuple(found)


def _wave(faces: dict[str, Face], quantity: str, order: int, position: float) -> FaceWave:
    c, covariance = 0j, np.zeros((2, 2))
    for name, factor in parts_of(quantity):
        one, own = faces[name].at(position, order)
        c, covariance = c + factor * one, covariance + factor**2 * own
    if order == 0:
        sd = NINETY * float(np.sqrt(covariance[0, 0]))
        return FaceWave(quantity, 0, position, ScanInterval(c.real, c.real - sd, c.real + sd), 0.0)
    size, _ = polar_intervals(c, covariance, order)
    return FaceWave(quantity, order, position, size, float(np.angle(c) / order % (2 * pi / order)))


def _roundness(faces: dict[str, Face]) -> tuple[Roundness, ...]:
    theta = 2 * pi * np.arange(720) / 720
    found = []
    for name, face in faces.items():
        x = np.linspace(face.waves.low, face.waves.high, 11)[1:]
        for position, departure in zip(x.tolist(), face.profile(x, theta, first=2), strict=True):
            rms = float(np.sqrt(np.mean(departure**2)))
            found.append(Roundness(name, position, float(np.ptp(departure)), rms))
    return tuple(found)
