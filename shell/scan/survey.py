r"""Circumferential harmonics of faces, from scattered points with gaps and outliers.

    δ(x, θ) = Σ_m Σ_j (a_mj cos mθ + b_mj sin mθ) P_j(x),   m = 0 ... highest, P_j Legendre polynomials over the covered positions,

by least squares on means over small cells, each weighted with its number of points; points that lie far off a first fit are
left out. The noise is what the fit leaves between the cells, so that form which the waves do not reach counts as noise.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shell.curves import Arc
from shell.errors import ShellError
from shell.imperfection.field import Complex, Field, fourier, values_around
from shell.imperfection.pair import Density
from shell.quadrature import Array
from shell.scan.alignment import RigidMotion
from shell.scan.projection import CHUNK, Projector
from shell.scan.waves import WaveBasis

ROWS, COLUMNS = 72, 288  # cells along the meridian and around
DEGREE = 7  # of the polynomials along the meridian
SAMPLE = 25_000  # points of the first fit
RIGID = 1e-6  # of the largest: a motion that moves the face along itself shows nothing
HOLE = 25.0  # growth of a variance by gaps from which on the waves are not told
Points: TypeAlias = tuple[Array, Array, Array]  # position, azimuth and how far points stand out of the material


@dataclass(frozen=True, eq=False)
class Face:
    """One face: its deviation away from the material, as harmonics with their covariance."""

    waves: WaveBasis  # the basis, over the positions that the points cover
    coefficients: Complex  # (waves, polynomials), complex a + i b
    covariance: Array  # of all a and b, m²
    noise: float  # of one point, m
    points: int  # points, outliers: numbers
    outliers: int
    cells: tuple[Array, Array, Array, Array]  # mean position, azimuth, δ and count of every cell
    motion: RigidMotion | None  # that aligned it
    span: tuple[float, float] | None = None  # polar angles of the ends of a dome whose tilt the shape does not tell

    def _turns(self, span: tuple[float, float], position: Array, order: int) -> list[Complex]:
        """Change of c_m at positions per radian of turning a dome about x and about y.

        A turn moves a point by dφ = -sin θ, sin φ dθ = -cos φ cos θ (about x), and cos θ, -cos φ sin θ (about y).
        """
        first, last = span
        phi = first + (last - first) * position
        m = np.arange(self.waves.highest + 1)
        theta = 2 * np.pi * np.arange(4 * self.waves.highest) / (4 * self.waves.highest)
        step = 1e-4
        c = self.waves.along(position) @ self.coefficients.T
        slope = (
            (self.waves.along(position + step) - self.waves.along(position - step)) @ self.coefficients.T / (2 * step)
        )
        waves = np.exp(-1j * np.multiply.outer(m, theta))
        by_phi, by_theta = (slope / (last - first) @ waves).real, (-1j * m * c @ waves).real
        cot = (np.cos(phi) / np.maximum(np.sin(phi), 0.05))[:, None]
        moved = (
            np.sin(theta) * by_phi + cot * np.cos(theta) * by_theta,
            -np.cos(theta) * by_phi + cot * np.sin(theta) * by_theta,
        )
        return [fourier(one, order)[..., order] for one in moved]

    @cached_property
    def field(self) -> Field:
        """Its waves as a field, constant beyond the covered positions."""
        return Field(tuple((m, 1.0, (partial(self._wave, m),)) for m in range(self.waves.highest + 1)))

    def _wave(self, order: int, position: Array) -> Complex:
        """One wave along the meridian, m."""
        return np.asarray(self.waves.along(position) @ self.coefficients[order])

    def project(self, density: Density, order: int) -> tuple[complex, Array]:
        """Σ density c_order over the shell and the covariance of its real and imaginary part."""
        return self._weigh(density.position, density.wave, order)

    def at(self, position: float, order: int) -> tuple[complex, Array]:
        """c_m at a position and the covariance of its parts, m; the axis of a dome is as uncertain as its edge leaves it."""
        return self._weigh(np.array([position]), np.ones(1), order)

    def _weigh(self, position: Array, weight: Array, order: int) -> tuple[complex, Array]:
        if order > self.waves.highest:
            raise ShellError(f"harmonics are fitted up to {self.waves.highest}; harmonic {order} is beyond.")
        L = weight @ self.waves.along(position)
        count = len(L)
        first = order * 2 * count - count if order else 0
        rows = np.zeros((2, len(self.covariance)))
        rows[0, first : first + count] = L
        if order:
            rows[1, first + count : first + 2 * count] = L
        found, covariance = complex(self.coefficients[order] @ L), rows @ self.covariance @ rows.T
        if self.span is None or self.motion is None:
            return found, covariance
        turned = (complex(weight @ turn) for turn in self._turns(self.span, position, order))
        parts = np.array([[z.real, z.imag] for z in turned])
        return found, covariance + self.motion.tilt_error**2 * parts.T @ parts

    def centred(self, rigid: Array) -> "Face":
        """Return the face without what a rigid motion makes of its first wave, which only the frame holds."""
        count = len(rigid)
        u, size, _ = np.linalg.svd(rigid, full_matrices=False)
        u = u[:, size > RIGID * size.max(initial=0.0)]
        keep = np.eye(count) - u @ u.T
        coefficients = self.coefficients.copy()
        coefficients[1] = keep @ coefficients[1]
        turn = np.eye(len(self.covariance))
        for first in (count, 2 * count):  # cosine and sine of wave 1
            turn[first : first + count, first : first + count] = keep
        return replace(self, coefficients=coefficients, covariance=turn @ self.covariance @ turn.T)

    def profile(self, position: Array, azimuth: Array, first: int = 0) -> Array:
        """δ around circles, (positions, azimuths), m; of the waves from the `first` on."""
        return values_around(self.field, range(first, self.waves.highest + 1), position, azimuth)


def most_waves(count: int) -> int:
    """The highest wave around that so many points, averaged in cells, can tell: an unknown needs a point."""
    return min((COLUMNS - 1) // 2, max(count // (DEGREE + 1) - 1, 0) // 2)


def fewest_points(highest: int) -> int:
    """How many points tell waves around up to the highest."""
    return (2 * highest + 1) * (DEGREE + 1)


def survey(points: Array, side: int, motion: RigidMotion, projector: Projector, name: str, highest: int = 12) -> Face:
    """The waves of the face at the height η = `side` from its points (count, 3), m, in their own frame."""

    def place(some: Array) -> Points:
        at = projector.place(motion.apply(some))
        return at.position, at.azimuth, side * at.height - at.thickness / 2

    x, theta, off = place(points[:: max(1, len(points) // SAMPLE)])
    near = abs(off - np.median(off)) < 0.3 * float(np.median(projector.line.thickness))
    x, theta, off = x[near], theta[near], off[near]
    low, high = (float(q) for q in np.percentile(x, [0.05, 99.95]))
    low, high = max(low, 0.0), min(high, 1.0)
    if len(off) < 500 or not high - low > 0.05:
        raise ShellError(f"{name}: {len(off)} points on the face are too few to fit harmonics.")
    waves = WaveBasis(low, high, highest, DEGREE)
    dome = projector.resonator.segments[0]
    alone = len(projector.resonator.segments) == 1 and isinstance(dome, Arc) and not (motion.told[3] and motion.told[4])
    turning = (dome.first_angle, dome.last_angle) if alone and isinstance(dome, Arc) else None
    return _fit(waves, (x, theta, off), points, place, motion, name, turning)


def survey_map(position: Array, azimuth: Array, values: Array, name: str, highest: int = 12) -> Face:
    """The waves of a face from a table (positions, azimuths) of how far it stands out of the material, m; NaN for gaps."""
    low, high = float(position.min()), float(position.max())
    if high == low:
        low, high = low - 1e-6, high + 1e-6
    waves = WaveBasis(low, high, min(highest, (len(azimuth) - 1) // 2), min(DEGREE, max(len(position) - 2, 0)))

    def place(cells: NDArray[np.intp]) -> Points:
        return position[cells // len(azimuth)], azimuth[cells % len(azimuth)], values.ravel()[cells]

    there = np.flatnonzero(np.isfinite(values.ravel()))
    return _fit(waves, place(there[:: max(1, len(there) // SAMPLE)]), there, place, None, name)


def rigid_shapes(waves: WaveBasis, projector: Projector) -> Array:
    """Coefficients of the normal displacement n_r cos θ by a shift and (z n_r - r n_z) cos θ by a tilt, (polynomials, 2)."""
    line = projector.line
    x = line.arc_length / projector.resonator.length
    inside = (x >= waves.low) & (x <= waves.high)
    middle = float(line.z[inside].mean())
    shapes = np.column_stack(
        [line.normal_r, ((line.z - middle) * line.normal_r - line.r * line.normal_z) / projector.resonator.size]
    )
    return np.asarray(np.linalg.lstsq(waves.along(x[inside]), shapes[inside], rcond=None)[0])


def _sum_cells(waves: WaveBasis, rough: Array, limit: float, portions: Iterable[Points]) -> tuple[Array, int, int]:
    """Over small cells: count, Σ position, Σ azimuth, Σ and Σ² of what a rough fit leaves; how many points were used, and how many are outliers."""
    sums = np.zeros((5, ROWS * COLUMNS))
    used = outliers = 0
    for x, theta, off in portions:
        left = off - waves.evaluate(rough, np.clip(x, waves.low, waves.high), theta)
        fits = abs(left) <= limit
        good = fits & (x >= waves.low) & (x <= waves.high)
        outliers += int(np.count_nonzero(~fits))
        x, theta, left = x[good], theta[good] % (2 * np.pi), left[good]
        row = np.minimum(((x - waves.low) / (waves.high - waves.low) * ROWS).astype(np.intp), ROWS - 1)
        cell = row * COLUMNS + np.minimum((theta / (2 * np.pi) * COLUMNS).astype(np.intp), COLUMNS - 1)
        # what is left of the rough fit is averaged, so that its slope within a cell does no harm
        for sum_, value in zip(sums, (np.ones(len(x)), x, theta, left, left**2), strict=True):
            sum_ += np.bincount(cell, value, ROWS * COLUMNS)
        used += len(x)
    return sums, used, outliers


def _fit(
    waves: WaveBasis, sample: Points, points: NDArray[Any], place: Callable[[Any], Points], motion: RigidMotion | None,
    name: str, turning: tuple[float, float] | None = None,
) -> Face:  # fmt: skip
    rough, limit = waves.fit_roughly(*sample)
    portions = (place(points[k : k + CHUNK]) for k in range(0, len(points), CHUNK))
    sums, used, outliers = _sum_cells(waves, rough, limit, portions)
    full = sums[0] > 0
    count = sums[0, full]
    x, theta, left = sums[1:4, full] / count
    design = waves.design(x, theta)
    normal = (design * count[:, None]).T @ design
    # a ridge at the level of rounding: where there is nothing to tell a wave, its variance becomes very large
    inverse = np.linalg.inv(normal + 1e-13 * np.trace(normal) / len(normal) * np.eye(len(normal)))
    growth = _growth(inverse, waves.along(x), x >= (waves.low + waves.high) / 2, count, waves.highest)
    if not growth < HOLE:
        times = f"{np.sqrt(growth):.0f}" if growth < 1e6 else "more than 1000"
        raise ShellError(
            f"{name}: the gaps between the points are too large for harmonics up to {waves.highest} (the error of the worst grows "
            f"{times} times): measure the missing places, or fit fewer harmonics (hrg scan --highest)."
        )
    change = inverse @ (design.T @ (count * left))
    rest = left - design @ change
    freedom = max(len(rest) - design.shape[1], 1)
    within = float((sums[4, full] - count * left**2).sum() / max(used - len(count), 1))
    # noise of one point as the cells show it, form left over included
    between = float((count * rest**2).sum() / freedom)
    variance = max(between, within if used > 2 * len(count) else 0.0)
    cells = (x, theta, left + design @ rough, count)
    return Face(
        waves, waves.complex(rough + change), inverse * variance, float(np.sqrt(variance)), len(points),
        outliers, cells, motion, turning,
    )  # fmt: skip


def _growth(inverse: Array, P: Array, outer: NDArray[np.bool_], count: Array, highest: int) -> float:
    """By how much gaps raise the variance of the worst wave, on average over the outer half, above evenly covered circles."""
    circles = np.linalg.inv((P * count[:, None]).T @ P)
    L = P[outer if outer.any() else slice(None)].mean(axis=0)
    k = len(L)
    blocks = np.einsum(
        "i,bij,j->b", L, [inverse[b * k : b * k + k, b * k : b * k + k] for b in range(2 * highest + 1)], L
    )
    worst = float(np.max(blocks[1:])) / (2 * float(L @ circles @ L))
    return worst if np.all(blocks > 0) else np.inf
