"""What is no shell of revolution: a chain with a gap, a wall that would overlap itself, a support without its edge."""

from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from shell.errors import ShellError, mm

if TYPE_CHECKING:
    from shell.resonator import Resonator, Stem

LONGEST_STEM = 100.0  # stem lengths over its radius that are meshed as a solid


def check_segments(segments: object) -> None:
    """Refuse what is no chain of curves."""
    if not isinstance(segments, list | tuple) or not all(hasattr(one, "length") for one in segments):
        raise ShellError("a resonator takes the lines and arcs of its meridian, such as hemisphere(...) puts together.")


def check_shape(resonator: "Resonator") -> None:
    """Refuse a resonator that cannot be."""
    _check_chain(resonator)
    _check_thickness(resonator)
    _check_support(resonator)


def _check_chain(resonator: "Resonator") -> None:
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


def _check_thickness(resonator: "Resonator") -> None:
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


def _check_support(resonator: "Resonator") -> None:
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


def _check_stem(resonator: "Resonator", stem: "Stem") -> None:
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
