"""Solid regions where stress is singular: corners where the meridian kinks, clamped edges and faces."""

from functools import lru_cache
from math import hypot, tan

import numpy as np

from shell.blocks import Solid
from shell.curves import Point
from shell.errors import ShellError
from shell.layout import SMOOTH_JOINT
from shell.patches import Cell, Patch, along, box, narrowed, rings, shrinking, straight, whole
from shell.points import MeridianPoints
from shell.resonator import Resonator

COLLAR = 1.5  # width of the solid strip beside a corner, in thicknesses
NARROW = 0.15  # share of it that the cell at a stiff tie takes


def find_kinks(resonator: Resonator) -> list[int]:
    """Joints (index of the segment before) at which the tangent turns."""
    kinks = []
    for k, s in enumerate(resonator.joints):
        before, after = resonator.at([s], k), resonator.at([s], k + 1)
        if abs(_turn(before, after)) > SMOOTH_JOINT:
            kinks.append(k)
    return kinks


def lay_corner(
    resonator: Resonator, joint: int, ring_count: int, stiff_ties: bool = False
) -> tuple[Solid, tuple[float, float]]:
    """Patches of one corner, and the arc lengths where the shell ends before it and begins after it.

    Both faces are continued straight until they meet. The kite between the inner meeting point I, the two cross-sections
    through I and the outer meeting point O is one patch, with a strip of shell on either side:

        strip | kite | strip,  all three refined towards I.

    A Naghdi shell keeps its thickness where it is tied (`stiff_ties`), which the stresses at the faces there feel: the strips
    end in a narrow cell.
    """
    s = resonator.joints[joint]
    turn = _turn(resonator.at([s], joint), resonator.at([s], joint + 1))
    if abs(turn) > 3.0:
        raise ShellError(f"segments {joint + 1} and {joint + 2} of the meridian fold back on each other.")
    inner = 1.0 if turn > 0 else -1.0  # the side of the normal on which the faces meet first
    s_1, s_2 = _meet(resonator, joint, inner)
    before, after = resonator.at([s_1], joint), resonator.at([s_2], joint + 1)
    meeting, feet = _face(before, inner), (_face(before, -inner), _face(after, -inner))
    (a, b), (c, d), ((r_1, z_1), (r_2, z_2)) = _tangent(before), _tangent(after), feet
    x = ((r_2 - r_1) * d - (z_2 - z_1) * c) / (a * d - b * c)  # where the outer faces, continued straight, meet
    outer = r_1 + x * a, z_1 + x * b
    cells = rings(shrinking(ring_count))
    kite = Patch(
        straight(meeting, feet[0]), straight(feet[1], outer), straight(meeting, feet[1]),
        straight(feet[0], outer), cells, "corner",
    )  # fmt: skip
    ends = (_strip_end(resonator, joint, s_1, -1), _strip_end(resonator, joint + 1, s_2, 1))
    if stiff_ties:
        cells = narrowed(cells, NARROW)
    strips = (
        _strip(resonator, joint, s_1, ends[0], inner, cells),
        _strip(resonator, joint + 1, s_2, ends[1], inner, cells),
    )
    return Solid((kite, *strips), lambda r, z: False, s / resonator.length), ends


def lay_clamped_face(resonator: Resonator, ring_count: int) -> tuple[Solid, float]:
    """Patches of a flat bottom around the edge of its clamp, and the arc length where the shell begins."""
    c = resonator.clamp_radius
    h = float(resonator.at([0.0], 0).thickness[0])
    low = float(resonator.at([0.0], 0).z[0]) - h / 2
    width = min(COLLAR * h, 0.6 * c)
    cells = rings(shrinking(ring_count))
    patches = [
        box((c, low), (c + width, low + h), cells),
        box((c, low), (c - width, low + h), cells),
        box((0.0, low), (c - width, low + h), whole()),
    ]
    margin = 1e-9 * resonator.length
    held = lambda r, z: abs(z - low) < margin and r <= c + margin  # noqa: E731
    return Solid(tuple(patches), held, c / resonator.length), c + width


def lay_clamped_edge(resonator: Resonator, last: bool, ring_count: int) -> tuple[Solid, float]:
    """Patches of a strip along a clamped edge, refined towards both of its corners, and where the shell meets it."""
    segment = len(resonator.segments) - 1 if last else 0
    edge = resonator.length if last else 0.0
    end = _strip_end(resonator, segment, edge, -1 if last else 1)
    place = resonator.at([edge], segment)
    cells = rings(shrinking(ring_count))
    halves = tuple(_strip(resonator, segment, edge, end, eta, cells, 0.0) for eta in (-1.0, 1.0))
    (r_edge, z_edge), (t_r, t_z), h = _face(place, 0.0), _tangent(place), float(place.thickness[0])

    def held(r: float, z: float) -> bool:
        off, along = (r - r_edge) * t_r + (z - z_edge) * t_z, hypot(r - r_edge, z - z_edge)
        return abs(off) < 1e-9 * h and along < 0.51 * h

    return Solid(halves, held, edge / resonator.length), end


def _turn(before: MeridianPoints, after: MeridianPoints) -> float:
    """Angle from one tangent to the next, positive towards the normal n = (-t_z, t_r)."""
    along = before.tangent_r * after.tangent_r + before.tangent_z * after.tangent_z
    aside = before.tangent_r * after.tangent_z - before.tangent_z * after.tangent_r
    return float(np.arctan2(aside, along)[0])


@lru_cache(maxsize=32)  # the same at every level and harmonic
def _meet(resonator: Resonator, joint: int, inner: float) -> tuple[float, float]:
    """Arc lengths on the two segments whose cross-sections share the inner corner I."""
    s = resonator.joints[joint]
    before, after = resonator.at([s], joint), resonator.at([s], joint + 1)
    h = float(before.thickness[0])
    reach = h / 2 * abs(tan(_turn(before, after) / 2))  # where both segments are straight
    s_1, s_2, gap = s - reach, s + reach, np.inf
    for _ in range(20):  # Newton's method: the two faces meet where the gap between their points vanishes
        places = resonator.at([s_1], joint), resonator.at([s_2], joint + 1)
        (r_1, z_1), (r_2, z_2) = (_face(place, inner) for place in places)
        gap = hypot(r_1 - r_2, z_1 - z_2)
        if not 1e-13 * h < gap < resonator.length:
            break
        (a_1, b_1), (a_2, b_2) = (np.concatenate(place.along_face(inner)) for place in places)
        step = np.linalg.solve([[a_1, -a_2], [b_1, -b_2]], [r_2 - r_1, z_2 - z_1])
        s_1, s_2 = s_1 + float(step[0]), s_2 + float(step[1])
    if not gap <= 1e-9 * h or not resonator._starts[joint] < s_1 <= s <= s_2 < resonator._starts[joint + 2]:
        raise ShellError(f"the corner between segments {joint + 1} and {joint + 2} is too sharp or its segments too short for the thickness.")  # fmt: skip
    return s_1, s_2


def _strip_end(resonator: Resonator, segment: int, s: float, direction: int) -> float:
    """Where the solid strip ends: a few thicknesses on, but not beyond the middle of the segment."""
    h = float(resonator.at([s], segment).thickness[0])
    first, last = resonator._starts[segment], resonator._starts[segment + 1]
    room = (last - s if direction > 0 else s - first) * 0.4
    return s + direction * min(COLLAR * h, room)


def _strip(
    resonator: Resonator, segment: int, s: float, end: float, near: float, cells: tuple[Cell, ...],
    far: float | None = None,
) -> Patch:  # fmt: skip
    """The shell from s to `end`, from the face η = near to η = far (the other face if not given)."""
    far = -near if far is None else far

    start, stop = resonator.at([s], segment), resonator.at([end], segment)
    return Patch(
        straight(_face(start, near), _face(start, far)), straight(_face(stop, near), _face(stop, far)),
        along(resonator.surface(near, segment), s, end), along(resonator.surface(far, segment), s, end),
        cells, "corner",
    )  # fmt: skip


def _face(points: MeridianPoints, eta: float) -> Point:
    r, z = points.at_heights([eta])
    return float(r[0, 0]), float(z[0, 0])


def _tangent(points: MeridianPoints) -> Point:
    return float(points.tangent_r[0]), float(points.tangent_z[0])
