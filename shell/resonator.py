"""The resonator: its middle surface as a chain of smooth curves in the (r, z) plane, thickness, support, stem.

The pole of a dome is at z = +R. Along the chain the tangent is t = (t_r, t_z) and the normal n = (-t_z, t_r); the curvature κ
of the meridian is positive where n points away from its centre. Heights η run from -1 to 1 along n. Which of these two faces
is the outer one depends on the direction in which the meridian is drawn: `Resonator.outward` says it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot
from typing import Literal, TypeAlias

import numpy as np
from numpy.polynomial.legendre import legder, legval
from numpy.typing import ArrayLike, NDArray

from shell.curves import Curve, scaled
from shell.errors import ShellError, mm, require_numbers
from shell.points import MeridianPoints
from shell.quadrature import Array, gauss

Support: TypeAlias = Literal["free", "clamped-pole", "clamped-rim", "stem", "clamped-face"]
FaceName: TypeAlias = Literal["inner", "outer"]
FLAT = 1e-9  # |∫ r dz| over length and radius below which a meridian is that of a flat disc
LONGEST_STEM = 100.0  # stem lengths over its radius that are meshed as a solid


@dataclass(frozen=True)
class Stem:
    """A solid cylinder on the axis at the pole: clamped `ends` at heights z (of "both": inner, outer), root `fillet` (0: sharp), m."""

    radius: float
    ends: float | tuple[float, float]
    fillet: float = 0.0
    side: Literal["inner", "outer", "both"] = "inner"

    def __post_init__(self) -> None:
        if self.side not in ("inner", "outer", "both"):
            raise ShellError(f"the side of a stem is inner, outer or both, not {self.side!r}.")
        require_numbers("Stem", self.radius, self.fillet)
        if not self.radius > 0:
            raise ShellError(f"the stem radius must be positive, not {mm(self.radius)}.")
        if not self.fillet >= 0:
            raise ShellError(f"the fillet radius must be 0 or positive, not {mm(self.fillet)}.")
        if isinstance(self.ends, tuple) != (self.side == "both"):
            raise ShellError("a stem on both sides needs two ends (inner, outer); on one side, one number.")

    @property
    def roots(self) -> tuple[tuple[Literal[-1, 1], float], ...]:
        """The face η of the dome that it stands on (-1 inner, +1 outer) and the height of the clamped end, for each root."""
        if isinstance(self.ends, tuple):
            return (-1, self.ends[0]), (1, self.ends[1])
        return (((1 if self.side == "outer" else -1), self.ends),)


@dataclass(frozen=True)
class Resonator:
    """A shell of revolution: segments of its meridian, thickness [(position, h in m)] along it, and support.

    Between two knots the thickness is linear, or a polynomial, `pieces`: Legendre coefficients (m), lowest first.
    A clamp holds the edge through its thickness, "clamped-face" the lower face within the clamp radius, m.
    """

    segments: tuple[Curve, ...]
    thickness: tuple[tuple[float, float], ...]
    support: Support = "free"
    stem: Stem | None = None
    clamp_radius: float = 0.0
    pieces: tuple[tuple[float, ...], ...] = ()
    _starts: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.segments, list | tuple) or not all(hasattr(one, "length") for one in self.segments):
            raise ShellError(
                "a resonator takes the lines and arcs of its meridian, such as hemisphere(...) puts together."
            )
        lengths = [segment.length for segment in self.segments]
        object.__setattr__(self, "_starts", tuple(np.concatenate([[0.0], np.cumsum(lengths)]).tolist()))
        _check_chain(self)
        _check_thickness(self)
        _check_support(self)

    @property
    def length(self) -> float:
        """Arc length of the whole meridian, m."""
        return self._starts[-1]

    @cached_property
    def size(self) -> float:
        """Largest distance from the axis, m: the radius that h/R refers to."""
        return max(float(np.max(segment.jet(np.linspace(0.0, 1.0, 201)).r)) for segment in self.segments)

    @cached_property
    def outward(self) -> Literal[-1, 1]:
        """The height η of the outer face: ±1 of ∫ n_r dA, n away from the axis on the mean over the shell; of a flat disc up, ∫ n_z dA.

        With n = (-t_z, t_r) these are 2π times -∫ r dz and ∫ r dr: the inner face is the one towards the axis, of a dome, cup
        or arch the concave one, of a flat disc the lower one.
        """
        x, weight = gauss(48)
        jets = [segment.jet((x + 1) / 2) for segment in self.segments]
        away = -sum(float(weight @ (jet.r * jet.dz)) for jet in jets) / 2
        up = sum(float(weight @ (jet.r * jet.dr)) for jet in jets) / 2
        return -1 if (up if abs(away) < FLAT * self.length * self.size else away) < 0 else 1

    def height_of(self, face: FaceName) -> int:
        """The height η of a face."""
        return self.outward if face == "outer" else -self.outward

    @property
    def joints(self) -> tuple[float, ...]:
        """Arc lengths where one segment ends and the next begins."""
        return self._starts[1:-1]

    @property
    def starts_on_axis(self) -> bool:
        """Whether the meridian starts at a pole."""
        return self.segments[0].end_points[0][0] <= 1e-9 * self.length

    @property
    def ends_on_axis(self) -> bool:
        """Whether the meridian ends at a pole (a closed shell)."""
        return self.segments[-1].end_points[1][0] <= 1e-9 * self.length

    def at(self, arc_length: ArrayLike, segment: int | NDArray[np.intp] | None = None) -> MeridianPoints:
        """The middle surface at given arc lengths (m); at a joint, `segment` says on which of the two curves."""
        s = np.atleast_1d(np.asarray(arc_length, dtype=float))
        if isinstance(segment, int):
            return self._on_segment(s, segment)
        if segment is None:
            after = np.searchsorted(np.array(self._starts), s, side="right")
            segment = np.clip(after - 1, 0, len(self.segments) - 1)
        joined = {name: np.empty_like(s) for name in MeridianPoints.__dataclass_fields__}
        for k in np.unique(segment):
            piece = self._on_segment(s[segment == k], int(k))
            for name, values in joined.items():
                values[segment == k] = getattr(piece, name)
        return MeridianPoints(**joined)

    def surface(self, eta: float, segment: int | None = None) -> Callable[[Array], tuple[Array, Array]]:
        """R and z of the surface at a height η as functions of the arc length (m)."""

        def at(s: Array) -> tuple[Array, Array]:
            r, z = self.at(np.ravel(s), segment).at_heights([eta])
            return r.reshape(np.shape(s)), z.reshape(np.shape(s))

        return at

    def sample(self, count: int) -> MeridianPoints:
        """The middle surface at `count` equally spaced arc lengths, both ends included."""
        return self.at(np.linspace(0.0, self.length, count))

    def slope_jumps(self, start: float, stop: float) -> Array:
        """Changes of dh/ds at the knots of the thickness between two arc lengths (m)."""
        knots, _, slopes, _ = self._profile
        inside = (knots[1:-1] > start) & (knots[1:-1] < stop)
        return np.asarray(np.diff(slopes)[inside])

    def scaled(self, factor: float) -> "Resonator":
        """The same resonator with every length multiplied by `factor`: free uniform thermal expansion."""
        return replace(
            self,
            segments=tuple(scaled(segment, factor) for segment in self.segments),
            thickness=tuple((position, value * factor) for position, value in self.thickness),
            stem=self.stem and scaled(self.stem, factor),
            clamp_radius=self.clamp_radius * factor,
            pieces=self._times(factor),
        )

    def thickened(self, factor: float) -> "Resonator":
        """The same middle surface and support with every thickness multiplied by `factor`."""
        thickness = tuple((position, value * factor) for position, value in self.thickness)
        return replace(self, thickness=thickness, pieces=self._times(factor))

    def _times(self, factor: float) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(factor * c for c in piece) for piece in self.pieces)

    def _on_segment(self, s: Array, segment: int) -> MeridianPoints:
        jet = self.segments[segment].at_length(s - self._starts[segment])
        speed = np.hypot(jet.dr, jet.dz)
        t_r, t_z = jet.dr / speed, jet.dz / speed
        # dt/ds = -κ n with n = (-t_z, t_r)
        curvature = (t_z * jet.ddr - t_r * jet.ddz) / speed / speed  # the square of a tiny speed would vanish
        middle = (self._starts[segment] + self._starts[segment + 1]) / 2
        thickness, slope = self._thickness_near(s, middle)
        return MeridianPoints(s / self.length, jet.r, jet.z, t_r, t_z, curvature, thickness, slope, s)

    def _thickness_near(self, s: Array, inside: float) -> tuple[Array, Array]:
        """Thickness and slope; at a step of the profile the side on which `inside` lies counts."""
        knots, value, slopes, curved = self._profile
        nudged = s + 1e-9 * (inside - s)
        k = np.minimum(np.maximum(np.searchsorted(knots, nudged, side="right") - 1, 0), len(slopes) - 1)
        slope = slopes[k]
        thickness = value[k] + slope * (s - knots[k])
        for piece, coefficients in curved:
            here, half = k == piece, (knots[piece + 1] - knots[piece]) / 2
            x = (s[here] - knots[piece]) / half - 1
            thickness[here], slope[here] = legval(x, coefficients), legval(x, legder(coefficients)) / half
        return thickness, slope

    @cached_property
    def _profile(self) -> tuple[Array, Array, Array, list[tuple[int, tuple[float, ...]]]]:
        """Arc lengths of the knots of the thickness, its values there, its slopes between them, and the polynomials."""
        position, value = np.array(self.thickness).T
        knots = position * self.length
        with np.errstate(divide="ignore", invalid="ignore"):  # a step of the profile is two knots in one place
            slopes = np.diff(value) / np.diff(knots)
        real = np.flatnonzero(np.diff(knots) > 0).tolist() if self.pieces else []
        return knots, value, slopes, list(zip(real, self.pieces, strict=True))


def _check_chain(resonator: Resonator) -> None:
    if not resonator.segments:
        raise ShellError("a meridian needs at least one segment.")
    tolerance = 1e-9 * resonator.length
    for k, (one, two) in enumerate(zip(resonator.segments, resonator.segments[1:], strict=False), start=1):
        (r1, z1), (r2, z2) = one.end_points[1], two.end_points[0]
        if hypot(r1 - r2, z1 - z2) > max(tolerance, 1e-9):
            raise ShellError(f"segment {k + 1} of the meridian starts at ({r2:g}, {z2:g}) m, but segment {k} ends at ({r1:g}, {z1:g}) m.")  # fmt: skip
    inside = np.concatenate([segment.jet(np.linspace(0.0, 1.0, 201)[1:-1]).r for segment in resonator.segments])
    joints = [segment.end_points[0][0] for segment in resonator.segments[1:]]
    if min(inside) <= 0 or min(joints, default=1.0) <= tolerance:
        raise ShellError("the meridian touches or crosses the axis between its ends: the shell would overlap itself.")


def _check_thickness(resonator: Resonator) -> None:
    position, value = np.array(resonator.thickness).T
    if not np.all(np.isfinite(value)) or not np.all(value > 0):
        raise ShellError(f"the thickness must be positive everywhere, not {mm(np.min(value))}.")
    if len(position) < 2 or position[0] != 0 or abs(position[-1] - 1) > 1e-12 or np.any(np.diff(position) < 0):
        raise ShellError("the positions of a thickness profile must rise from 0 (start) to 1 (rim).")
    for k in range(len(resonator.segments)):
        first, last = resonator._starts[k], resonator._starts[k + 1]
        points = resonator.at(np.linspace(first, last, 203)[1:-1], k)
        half = points.thickness / 2
        # a face may not pass the centres of curvature: of the meridian, and on the axis that of the circles around it
        with np.errstate(divide="ignore"):
            room = np.minimum(1 / abs(points.curvature), points.r / abs(points.normal_r))
        if np.any(half >= room):
            raise ShellError(
                f"the thickness {mm(2 * half.max())} is too large for this middle surface: the inner face would overlap "
                f"itself. Segment {k + 1} allows less than {mm(2 * float(np.min(room)))}; is a length in the wrong unit?"
            )


def _check_support(resonator: Resonator) -> None:
    if resonator.support == "clamped-pole" and resonator.starts_on_axis:
        raise ShellError("a closed pole has no edge to clamp: open it (a pole angle above 0) or use a stem.")
    if resonator.support == "clamped-rim" and resonator.ends_on_axis:
        raise ShellError("a closed shell has no rim to clamp: end the meridian before the axis, or choose another support.")  # fmt: skip
    if (resonator.support == "stem") != (resonator.stem is not None):
        raise ShellError("a stem belongs to the support 'stem', and the support 'stem' needs a stem.")
    for start, on_axis in ((True, resonator.starts_on_axis), (False, resonator.ends_on_axis)):
        end = resonator.at([0.0 if start else resonator.length], 0 if start else len(resonator.segments) - 1)
        if on_axis and abs(end.tangent_z[0]) > 1e-6:
            raise ShellError("the meridian meets the axis at an angle: a pole must be flat there, or open.")
    if resonator.stem:
        _check_stem(resonator, resonator.stem)


def _check_stem(resonator: Resonator, stem: Stem) -> None:
    if not resonator.starts_on_axis:
        raise ShellError("a stem needs a closed pole: set the pole angle to 0.")
    dome = resonator.segments[0]
    points = resonator.at(np.linspace(0, dome.length, 400), 0)
    for face, end in stem.roots:
        r, z = (coordinate[:, 0] for coordinate in points.at_heights([face]))
        if not stem.radius + stem.fillet < 0.9 * r.max():
            raise ShellError(f"the stem (radius {mm(stem.radius)}, fillet {mm(stem.fillet)}) is larger than the dome it stands on (radius {mm(r.max())}): make it thinner.")  # fmt: skip
        at_root = float(np.interp(stem.radius + stem.fillet, r[: r.argmax() + 1], z[: r.argmax() + 1]))
        if abs(end - at_root) > LONGEST_STEM * stem.radius:
            raise ShellError(
                f"the stem is {abs(end - at_root) / stem.radius:.0f} times as long as its radius; it is solved as a solid up to "
                f"{LONGEST_STEM:g} times: shorten it, since n >= 2 does not reach its far end, or make it thicker."
            )
        base = max(at_root, float(z[0])) if face > 0 else at_root  # the dome bulges into an outer stem
        if not face * (end - base) > stem.fillet + 0.1 * stem.radius:
            raise ShellError(f"the {'outer' if face > 0 else 'inner'} stem ends at {mm(end)}, not clear of the dome at {mm(base)}: move its end away from the dome.")  # fmt: skip
