r"""The root of a stem: the solid region where a cylinder on the axis grows out of the dome.

The section is cut along the cross-section of the shell where the fillet (or the sharp corner) touches the dome:

    far face   pole ----- X ------- O ---- collar end      (for an inner stem the far face is the outer one)
                |  core   |   \\      |       |
               axis ----- X1 -- M/T1-T2 ---- collar end
                |  stem   | side |

T2 and T1 are the fillet's ends on the dome and on the stem, M its middle; with a sharp corner they are one point. The core
ends at the height of T1 under an inner stem; under an outer one, towards which the dome bulges, it follows the dome's face
and so has the dome's thickness however thin that is.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import atan2, ceil, dist, log, pi

import numpy as np

from shell.blocks import Solid
from shell.curves import Point
from shell.errors import ShellError, mm
from shell.layout import OTHERS, Level
from shell.patches import Patch, Path, Planar, along, circular, layers, rings, shrinking, straight, whole
from shell.quadrature import Array
from shell.resonator import Resonator, Stem
from shell.stem import Base, arc_at_radius, columns_of, crossing, find_base, lay_rows, mesh_stem, point_on

COLLAR = 1.5  # width of the solid ring around the root, in thicknesses
FILLET_SHRINK = 0.3
SLANT = 0.25  # most by which a cut through the shell may slant, over the thickness


@dataclass(frozen=True)
class Contact:
    """Where one stem meets the dome: arc length of T2, fillet centre, its two ends; `face` -1 inner, +1 outer."""

    face: int
    end: float
    s: float
    center: Point
    on_dome: Point
    on_stem: Point

    @property
    def turn(self) -> tuple[float, float]:
        """Angle of T2 as seen from the fillet's centre, and from there to T1."""
        first, last = (atan2(z - self.center[1], r - self.center[0]) for r, z in (self.on_dome, self.on_stem))
        return first, (last - first + pi) % (2 * pi) - pi


@dataclass(frozen=True)
class Frame:
    """What a root's patches hang on, the same at every level."""

    contacts: tuple[Contact, ...]
    widest: float
    collar: float  # arc length where the shell begins; `widest` : that of the outermost contact
    corners: tuple[float, ...]  # for each contact, the arc length of O
    bases: tuple[Base, ...]  # for each contact, where the core ends
    radii: tuple[float, ...]  # bounds of the columns of the stem, from its side to the axis
    # for each contact, η of the face opposite (0: the middle surface) and its arc lengths at the inner radii.
    above: tuple[tuple[float, tuple[float, ...]], ...]
    # arc lengths between O and X on the opposite face at which the cells of a fillet end; two stems share them.
    cuts: tuple[float, ...]
    rings: tuple[int, ...]  # for each contact, how often the rings around its fillet shrink


@lru_cache(maxsize=12)
def lay_root(resonator: Resonator, level: Level, n: int) -> tuple[Solid, float]:
    """Patches of cap, root and stem for harmonic n (all above 1 have the same), and the arc length where the shell begins."""
    like = level.like or resonator
    model = _find_frame(like)
    frame = model if like == resonator else _find_frame(resonator, like)
    stem = resonator.stem
    assert stem is not None
    patches: list[Patch] = []
    for which, (contact, base) in enumerate(zip(frame.contacts, frame.bases, strict=True)):
        # rings shrink to nothing at a sharp corner
        steps = shrinking(model.rings[which], FILLET_SHRINK) if stem.fillet else shrinking(level.rings)
        patches += _half_root(resonator, stem, frame, which, steps)
        rows, is_felt = lay_rows(model.radii, model.bases[which], model.contacts[which].end, n)
        patches += mesh_stem(base, contact.end, rows, steps, rings(shrinking(level.rings)) if is_felt else ())
    ends = [contact.end for contact in frame.contacts]

    def held(r: float, z: float) -> bool:
        return any(abs(z - end) < 1e-9 * resonator.length for end in ends)

    return Solid(tuple(patches), held, frame.collar / resonator.length), frame.collar


@lru_cache(maxsize=16)
def _find_frame(resonator: Resonator, like: Resonator | None = None) -> Frame:
    """The frame of a root, its counts and choices those of another design if given."""
    stem = resonator.stem
    assert stem is not None
    model = _find_frame(like) if like else None
    contacts = tuple(_touch(resonator, stem, face, end) for face, end in stem.roots)
    if model and (len(model.contacts) != len(contacts) or any(model.rings) != bool(stem.fillet)):
        raise ShellError(f"{OTHERS}: its stem has another fillet or other sides.")
    h = float(resonator.at([contacts[0].s]).thickness[0])
    widest = max(contact.s for contact in contacts)
    collar = widest + COLLAR * h + min(stem.fillet, h)
    if collar > widest + 0.5 * (resonator.length - widest):
        raise ShellError(
            f"the stem (radius {mm(stem.radius)}, fillet {mm(stem.fillet)}) with {mm(collar - widest)} of solid around its root "
            f"leaves no room for the shell, whose meridian is {mm(resonator.length)} long: make the stem or its fillet smaller, or the shell thinner."
        )
    radii = [radius * stem.radius / model.radii[0] for radius in model.radii] if model else columns_of(stem, h)
    above = []
    for contact in contacts:
        far = 0.0 if len(contacts) == 2 else -float(contact.face)
        surface = resonator.surface(far, 0)
        above.append((far, tuple(arc_at_radius(surface, r, widest) for r in radii[1:])))
    # two fillets end at different places of a thin shell; where they nearly do not, one slanting cut serves both
    slant = SLANT * h if stem.fillet else np.inf
    shared = [corner == model.widest for corner in model.corners] if model else [widest - c.s < slant for c in contacts]
    corners = tuple(widest if one else contact.s for one, contact in zip(shared, contacts, strict=True))
    far_face, near, over = resonator.surface(above[0][0], 0), min(corners), above[0][1][0]
    heights = [dist(c.on_dome, point_on(far_face, s)) for c, s in zip(contacts, corners, strict=True)]
    count, rings = 0, [0] * len(contacts)
    if model:
        count, rings = len(model.cuts), list(model.rings)
    elif stem.fillet:
        # beside a thin shell the wedge under the fillet is long: its cells grow away from the shell
        wedges = [abs(c.turn[1]) / 4 * stem.fillet / height for c, height in zip(contacts, heights, strict=True)]
        count = 1 + max(0, *(ceil(log(wedge) / log(3)) for wedge in wedges))
        reaches = [min(radii[0] - radii[1], height) / (2 * stem.fillet) for height in heights]
        rings = [1 + max(0, ceil(log(reach) / -log(FILLET_SHRINK))) for reach in reaches]
    cuts = [near, *(near + (over - near) * step for step in shrinking(count - 1, 1 / 3)[:0:-1])] if count else []
    bases = tuple(
        find_base(resonator, contact.face, contact.s, contact.on_stem[1], tuple(radii)) for contact in contacts
    )
    return Frame(contacts, widest, collar, corners, bases, tuple(radii), tuple(above), tuple(cuts), tuple(rings))


def _touch(resonator: Resonator, stem: Stem, face: int, end: float) -> Contact:
    """Solve for the fillet that touches the stem's side and the dome's face; radius 0 gives the corner itself."""

    def center(s: Array) -> Planar:
        (r, z), (normal_r, normal_z) = _face(resonator, face, s)
        return r + stem.fillet * normal_r, z + stem.fillet * normal_z

    reach = stem.radius + stem.fillet
    dome = resonator.segments[0].length
    trial = np.linspace(0, dome, 200)
    beyond = np.flatnonzero(center(trial)[0] > reach)
    if not len(beyond):
        raise ShellError("the stem with its fillet is larger than the dome it stands on.")
    s = crossing(lambda x: center(x)[0] - reach, trial[beyond[0] - 1], trial[beyond[0]])
    middle, on_dome = (
        (float(r[0]), float(z[0])) for r, z in (center(np.array([s])), _face(resonator, face, np.array([s]))[0])
    )
    return Contact(face, end, s, middle, on_dome, (stem.radius, middle[1]))


def _half_root(resonator: Resonator, stem: Stem, frame: Frame, which: int, steps: tuple[float, ...]) -> list[Patch]:
    """The patches between one face of the dome and `far` (η of the opposite face, or 0: the middle surface)."""
    contact, (far, arcs), own = frame.contacts[which], frame.above[which], frame.corners[which]
    near_face, far_face = resonator.surface(contact.face, 0), resonator.surface(far, 0)
    collar, base = frame.collar, frame.bases[which]
    over = point_on(far_face, arcs[0])  # X; `arcs` are those of X and of the points further in
    corner = point_on(far_face, own)  # O
    under = point_on(base.path, base.arcs[1])  # X1
    cross, roof = straight(contact.on_dome, corner), along(far_face, own, arcs[0])
    ends = [collar] if own == frame.widest else [frame.widest, collar]
    patches: list[Patch] = []
    begin, near = cross, contact.s
    for end in ends:
        section = straight(point_on(near_face, end), point_on(far_face, end))
        sides = along(near_face, near, end), along(far_face, near if patches else own, end)
        patches.append(Patch(begin, section, *sides, whole() if patches else rings(steps), "root"))
        begin, near = section, end
    for (a_out, s_out), (a_in, s_in) in pairwise(zip(base.arcs[1:], arcs, strict=True)):
        left, right = (
            straight(point_on(base.path, a), point_on(far_face, s)) for a, s in ((a_in, s_in), (a_out, s_out))
        )
        floor = along(base.path, a_in, a_out)
        patches.append(Patch(floor, along(far_face, s_in, s_out), left, right, whole(), "root"))
    floor, wall = along(base.path, *base.arcs[:2]), straight(under, over)
    if stem.fillet:
        cuts = [(s - own) / (arcs[0] - own) for s in frame.cuts if s < own]
        patches += _fillet(contact, stem.fillet, cross, roof, floor, wall, over, steps, (1.0, *cuts[::-1]))
    else:
        patches.append(Patch(cross, wall, floor, roof, rings(steps), "root"))
    return patches


def _fillet(
    contact: Contact, radius: float, cross: Path, roof: Path, floor: Path, wall: Path, over: Point,
    steps: tuple[float, ...], cuts: tuple[float, ...],
) -> list[Patch]:  # fmt: skip
    """Two patches that meet on the line from the middle of the fillet to X."""
    (r, z), (first, turn) = contact.center, contact.turn
    middle = first + turn / 2
    center_line = straight((r + radius * np.cos(middle), z + radius * np.sin(middle)), over)
    return [
        Patch(cross, center_line, circular((r, z), radius, first, middle), roof, layers(steps, cuts), "root"),
        Patch(floor, center_line, circular((r, z), radius, first + turn, middle), wall, layers(steps), "root"),
    ]


def _face(resonator: Resonator, face: int, s: Array) -> tuple[Planar, Planar]:
    """Points of a face of the dome and its unit normals, out of the material."""
    there = resonator.at(s, 0)
    (r, z), (t_r, t_z) = there.at_heights([face]), there.along_face(face)
    scale = face / np.hypot(t_r, t_z)
    return (r[:, 0], z[:, 0]), (-scale * t_z, scale * t_r)
