r"""Faces as sums of waves around, from scattered points with gaps and outliers.

    δ(x, θ) = Σ_m Σ_j (a_mj cos mθ + b_mj sin mθ) P_j(x),   m = 0 ... highest, P_j Legendre polynomials over the covered positions,

by least squares on means over small cells, each weighted with its number of points; points that lie far off a first fit are
left out. The noise is what the fit leaves between the cells, so that form which the waves do not reach counts as noise.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import median_abs_deviation

from shell.curves import Arc
from shell.errors import ShellError
from shell.imperfection.field import Complex, Waves, fourier
from shell.imperfection.pair import Density
from shell.quadrature import Array, legendre
from shell.scan.alignment import RigidMotion
from shell.scan.projection import CHUNK, Projector

ROWS, COLUMNS = 72, 288  # cells along the meridian and around
OUTLIER = 5.0  # standard deviations
HOLE = 25.0  # growth of a variance by gaps from which on the waves are not told


@dataclass(frozen=True, eq=False)
class Face:
    """One face: how far it stands out of the material, as waves with their covariance.

    Attributes
    ----------
    side : -1 inner, 1 outer. low, high : positions that the points cover.
    coefficients : (waves, polynomials), complex a + i b. covariance : of all a and b, m².
    noise : of one point, m. points, outliers : numbers. cells : mean position, azimuth, δ and count of every cell.
    motion : that aligned it. span : polar angles of the ends of a dome whose tilt the shape does not tell.
    """

    side: int
    low: float
    high: float
    coefficients: Complex
    covariance: Array
    noise: float
    points: int
    outliers: int
    cells: tuple[Array, Array, Array, Array]
    motion: RigidMotion | None
    span: tuple[float, float] | None = None

    @property
    def turns(self) -> "Callable[[Array, int], list[Complex]] | None":
        """Change of c_m at positions per radian of turning a dome about x and about y; None where the shape tells its axis."""
        return self._turns if self.span is not None else None

    def _turns(self, position: Array, order: int) -> list[Complex]:
        """A turn moves a point by dφ = -sin θ, sin φ dθ = -cos φ cos θ (about x), and cos θ, -cos φ sin θ (about y)."""
        assert self.span is not None
        first, last = self.span
        phi = first + (last - first) * position
        m = np.arange(self.highest + 1)
        theta = 2 * np.pi * np.arange(4 * self.highest) / (4 * self.highest)
        step = 1e-4
        c = self.polynomials(position) @ self.coefficients.T
        slope = (
            (self.polynomials(position + step) - self.polynomials(position - step)) @ self.coefficients.T / (2 * step)
        )
        waves = np.exp(-1j * np.multiply.outer(m, theta))
        by_phi, by_theta = (slope / (last - first) @ waves).real, (-1j * m * c @ waves).real
        cot = (np.cos(phi) / np.maximum(np.sin(phi), 0.05))[:, None]
        moved = (
            np.sin(theta) * by_phi + cot * np.cos(theta) * by_theta,
            -np.cos(theta) * by_phi + cot * np.sin(theta) * by_theta,
        )
        return [fourier(one, order)[..., order] for one in moved]

    @property
    def highest(self) -> int:
        """The highest wave."""
        return len(self.coefficients) - 1

    @cached_property
    def field(self) -> Waves:
        """Its waves as a field, constant beyond the covered positions."""
        return Waves({m: _Profile(self, m) for m in range(self.highest + 1)})

    def polynomials(self, position: Array) -> Array:
        """P_j at positions, (..., polynomials)."""
        x = np.clip(position, self.low, self.high)
        t = 2 * (x - self.low) / (self.high - self.low) - 1
        return _along(t, self.coefficients.shape[1] - 1)

    def project(self, density: Density, order: int) -> tuple[complex, Array]:
        """Σ density c_order over the shell and the covariance of its real and imaginary part.

        Parameters
        ----------
        density : what the wave does at stations (shell.imperfection.pair).
        order : m > 0.
        """
        found, covariance = self._combine(density.wave @ self.polynomials(density.position), order)
        if self.turns is None or self.motion is None:
            return found, covariance
        parts = np.array(
            [[z.real, z.imag] for z in (complex(density.wave @ turn) for turn in self.turns(density.position, order))]
        )
        return found, covariance + self.motion.tilt_error**2 * parts.T @ parts

    def at(self, position: float, order: int) -> tuple[complex, Array]:
        """c_m at a position and the covariance of its parts, m."""
        return self._combine(self.polynomials(np.array([position]))[0], order)

    def _combine(self, L: Array, order: int) -> tuple[complex, Array]:
        if order > self.highest:
            raise ShellError(f"the waves were fitted up to {self.highest}; wave {order} asks for more.")
        count = len(L)
        first = order * 2 * count - count if order else 0
        rows = np.zeros((2, len(self.covariance)))
        rows[0, first : first + count] = L
        if order:
            rows[1, first + count : first + 2 * count] = L
        return complex(self.coefficients[order] @ L), rows @ self.covariance @ rows.T

    def profile(self, position: float, azimuth: Array) -> Array:
        """δ around a circle, m."""
        c = self.polynomials(np.array([position]))[0] @ self.coefficients.T
        return np.asarray((c * np.exp(-1j * np.multiply.outer(azimuth, np.arange(len(c))))).real.sum(axis=1))


@dataclass(frozen=True, eq=False)
class _Profile:
    """One wave of a face along the meridian."""

    face: Face
    order: int

    def __call__(self, position: Array) -> Complex:
        return np.asarray(self.face.polynomials(position) @ self.face.coefficients[self.order])


def survey(
    points: Array, side: int, motion: RigidMotion, projector: Projector, name: str, highest: int = 12, degree: int = 7
) -> Face:
    """The waves of a face from its points (count, 3), m, in their own frame.

    Raises
    ------
    ShellError
        Too few points, or gaps larger than the waves allow.
    """
    sample = points[:: max(1, len(points) // 25_000)]
    x, theta, off = _off(motion.apply(sample), side, projector)
    keep = abs(off - np.median(off)) < 0.3 * float(np.median(projector.line.thickness))
    x, theta, off = x[keep], theta[keep], off[keep]
    low, high = (float(q) for q in np.percentile(x, [0.05, 99.95]))
    low, high = max(low, 0.0), min(high, 1.0)
    if len(off) < 500 or not high - low > 0.05:
        raise ShellError(f"{name}: {len(off)} points on the face are too few to fit its waves.")
    rough = _fit(x, theta, off, np.ones(len(off)), low, high, highest, degree)
    for _ in range(3):
        left = off - _evaluate(rough, x, theta, low, high, highest, degree)
        scatter = float(median_abs_deviation(left, scale="normal"))
        good = abs(left - np.median(left)) < OUTLIER * max(scatter, 1e-10)
        rough = _fit(x[good], theta[good], off[good], np.ones(good.sum()), low, high, highest, degree)
    limit = OUTLIER * max(scatter, 1e-10)
    sums = np.zeros((5, ROWS * COLUMNS))
    used = 0
    for k in range(0, len(points), CHUNK):
        x, theta, off = _off(motion.apply(points[k : k + CHUNK]), side, projector)
        left = off - _evaluate(rough, x, theta, low, high, highest, degree)
        good = (abs(left) < limit) & (x >= low) & (x <= high)
        x, theta, off, left = x[good], theta[good] % (2 * np.pi), off[good], left[good]
        row = np.minimum(((x - low) / (high - low) * ROWS).astype(np.intp), ROWS - 1)
        cell = row * COLUMNS + np.minimum((theta / (2 * np.pi) * COLUMNS).astype(np.intp), COLUMNS - 1)
        # what is left of the rough fit is averaged, so that its slope within a cell does no harm
        for sum_, value in zip(sums, (np.ones(len(x)), x, theta, left, left**2), strict=True):
            sum_ += np.bincount(cell, value, ROWS * COLUMNS)
        used += len(x)
    dome = projector.resonator.segments[0]
    alone = len(projector.resonator.segments) == 1 and isinstance(dome, Arc) and not (motion.told[3] and motion.told[4])
    turning = (dome.first_angle, dome.last_angle) if alone and isinstance(dome, Arc) else None
    return _finish(sums, rough, side, (low, high), (highest, degree), (len(points), used), motion, name, turning)


def survey_map(
    position: Array, azimuth: Array, values: Array, side: int, name: str, highest: int = 12, degree: int = 7
) -> Face:
    """The waves of a face from a table (positions, azimuths) of how far it stands out of the material, m; NaN for gaps."""
    x, theta = (axis.ravel() for axis in np.meshgrid(position, azimuth, indexing="ij"))
    there = np.isfinite(values.ravel())
    x, theta, off = x[there], theta[there] % (2 * np.pi), values.ravel()[there]
    highest = min(highest, (len(azimuth) - 1) // 2)
    degree = min(degree, max(len(position) - 2, 0))
    low, high = float(position.min()), float(position.max())
    if high == low:
        low, high = low - 1e-6, high + 1e-6
    rough = _fit(x, theta, off, np.ones(len(off)), low, high, highest, degree)
    for _ in range(4):
        left = off - _evaluate(rough, x, theta, low, high, highest, degree)
        scatter = float(median_abs_deviation(left, scale="normal"))
        good = abs(left - np.median(left)) <= OUTLIER * max(scatter, 1e-10)
        rough = _fit(x[good], theta[good], off[good], np.ones(good.sum()), low, high, highest, degree)
    x, theta, left = x[good], theta[good], left[good]
    sums = np.array([np.ones(len(x)), x, theta, left, left**2])
    return _finish(sums, rough, side, (low, high), (highest, degree), (int(there.sum()), len(x)), None, name)


def _finish(
    sums: Array,
    rough: Array,
    side: int,
    span: tuple[float, float],
    size: tuple[int, int],
    numbers: tuple[int, int],
    motion: RigidMotion | None,
    name: str,
    turning: tuple[float, float] | None = None,
) -> Face:
    (low, high), (highest, degree) = span, size
    full = sums[0] > 0
    count = sums[0, full]
    x, theta, left = sums[1:4, full] / count
    design = _design(x, theta, low, high, highest, degree)
    normal = (design * count[:, None]).T @ design
    # a ridge at the level of rounding: where there is nothing to tell a wave, its variance becomes very large
    inverse = np.linalg.inv(normal + 1e-13 * np.trace(normal) / len(normal) * np.eye(len(normal)))
    growth = _growth(inverse, design[:, : degree + 1], 2 * (x - low) / (high - low) - 1, count, highest)
    if not growth < HOLE:
        raise ShellError(
            f"{name}: the gaps between the points are larger than the waves up to {highest} allow (the error of the worst grows "
            f"{np.sqrt(growth):.0f} times): measure the missing places, or ask for fewer waves (--highest)."
        )
    change = inverse @ (design.T @ (count * left))
    rest = left - design @ change
    freedom = max(len(rest) - design.shape[1], 1)
    within = float((sums[4, full] - count * left**2).sum() / max(numbers[1] - len(count), 1))
    between = float(
        (count * rest**2).sum() / freedom
    )  # noise of one point as the cells show it, form left over included
    variance = max(between, within if numbers[1] > 2 * len(count) else 0.0)
    flat = rough + change
    k = degree + 1
    coefficients = np.zeros((highest + 1, k), dtype=complex)
    coefficients[0] = flat[:k]
    parts = flat[k:].reshape(highest, 2, k)
    coefficients[1:] = parts[:, 0] + 1j * parts[:, 1]
    cells = (x, theta, left + design @ rough, count)
    return Face(
        side, low, high, coefficients, inverse * variance, float(np.sqrt(variance)), numbers[0], numbers[0] - numbers[1],
        cells, motion, turning,
    )  # fmt: skip


def _growth(inverse: Array, P: Array, t: Array, count: Array, highest: int) -> float:
    """By how much gaps raise the variance of the worst wave, on average over the outer half, above evenly covered circles."""
    circles = np.linalg.inv((P * count[:, None]).T @ P)
    L = P[t >= min(0.0, float(t.max()))].mean(axis=0)
    k = len(L)
    blocks = np.einsum(
        "i,bij,j->b", L, [inverse[b * k : b * k + k, b * k : b * k + k] for b in range(2 * highest + 1)], L
    )
    worst = float(np.max(blocks[1:])) / (2 * float(L @ circles @ L))
    return worst if np.all(blocks > 0) else np.inf


def _off(points: Array, side: int, projector: Projector) -> tuple[Array, Array, Array]:
    """Position, azimuth and how far points stand out of the material."""
    at = projector.place(points)
    return at.position, at.azimuth, side * at.height - at.thickness / 2


def _along(t: Array, degree: int) -> Array:
    """Legendre polynomials of mean square 1."""
    values = legendre(degree, np.ravel(t)).values.reshape(*np.shape(t), degree + 1)
    return np.asarray(values * np.sqrt(2 * np.arange(degree + 1) + 1))


def _design(x: Array, theta: Array, low: float, high: float, highest: int, degree: int) -> Array:
    P = _along(2 * (x - low) / (high - low) - 1, degree)
    around = [np.ones(len(theta))]
    for m in range(1, highest + 1):
        around += [np.cos(m * theta), np.sin(m * theta)]
    return np.asarray((np.array(around).T[:, :, None] * P[:, None]).reshape(len(x), -1))


def _fit(
    x: Array, theta: Array, off: Array, weight: Array, low: float, high: float, highest: int, degree: int
) -> Array:
    design = _design(x, theta, low, high, highest, degree)
    normal = (design * weight[:, None]).T @ design
    ridge = 1e-9 * np.trace(normal) / len(normal)
    return np.linalg.solve(normal + ridge * np.eye(len(normal)), design.T @ (weight * off))


def _evaluate(flat: Array, x: Array, theta: Array, low: float, high: float, highest: int, degree: int) -> Array:
    """The fit at points, by Horner's rule around: no large design matrix."""
    k = degree + 1
    P = _along(2 * (np.clip(x, low, high) - low) / (high - low) - 1, degree)
    turn = np.exp(-1j * theta)
    parts = flat[k:].reshape(highest, 2, k)
    found = np.zeros(len(x), dtype=complex)
    for m in range(highest, 0, -1):
        found = (found + P @ (parts[m - 1, 0] + 1j * parts[m - 1, 1])) * turn
    return np.asarray(found.real + P @ flat[:k])
