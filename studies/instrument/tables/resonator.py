"""`[resonator]`: geometry and support at the reference temperature, in mm and degrees (the forms are in the classes)."""

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec

from studies.errors import InputError, naming
from studies.instrument.registry import CardPlace, CardTable
from studies.schema.keys import Keys, number, says

if TYPE_CHECKING:
    from shell.resonator import Resonator, Stem, Support

MM = 1e-3
SMALLEST, LARGEST = 1e-4, 1.0  # m: micro-hemispheres begin at some tenths of a millimetre
THINNEST = 3e-4  # of the size: films on micro-hemispheres are a few times thicker
RADIANS = 2 * math.pi  # no dome ends at so few degrees: the angle is in radians
Length = Annotated[float, number(above=0.0)]
NotNegative = Annotated[float, number(least=0.0)]
Share = Annotated[float, number(least=0.0, most=1.0)]
Thickness = Length | Annotated[list[tuple[Share, Length]], msgspec.Meta(min_length=2)]
Point = tuple[float, float]


class StemKeys(Keys, frozen=True, kw_only=True):
    """`[resonator.stem]`: a solid cylinder on the axis, clamped at `end_mm`; with side "both" at [inner, outer]."""

    radius_mm: Annotated[Length, says("of the solid cylinder")]
    end_mm: Annotated[float | Point, says("height of its clamped end; with side both: [inner, outer]")]
    side: Annotated[Literal["inner", "outer", "both"], says("of the shell")] = "inner"
    fillet_mm: Annotated[NotNegative, says("root radius, 0 for a sharp corner")] = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.end_mm, tuple) != (self.side == "both"):
            wanted = "[inner, outer]" if self.side == "both" else "one number"
            raise ValueError(f"with side = '{self.side}' end_mm must be {wanted}, not {self.end_mm!r}.")

    def build(self) -> "Stem":
        """Return the stem in SI units."""
        from shell.resonator import Stem

        ends = (self.end_mm[0] * MM, self.end_mm[1] * MM) if isinstance(self.end_mm, tuple) else self.end_mm * MM
        return Stem(radius=self.radius_mm * MM, ends=ends, fillet=self.fillet_mm * MM, side=self.side)


class Shape(Keys, frozen=True, kw_only=True, tag_field="shape"):
    """What every shape has: a number, or [position, value] pairs that are joined linearly from 0 (start) to 1 (rim)."""

    thickness_mm: Annotated[Thickness, says("a number, or [position, value] pairs, linear between; 0 where the meridian starts, 1 at the rim")]  # fmt: skip

    def __post_init__(self) -> None:
        places = [s for s, _ in self.thickness_mm] if isinstance(self.thickness_mm, list) else []
        if any(b <= a for a, b in pairwise(places)):
            raise ValueError("thickness_mm: the positions must increase from 0 (start) to 1 (rim).")

    @property
    def shape(self) -> str:
        """Name of the shape in the card."""
        return str(self.__struct_config__.tag)

    @property
    def thickness(self) -> float | list[tuple[float, float]]:
        """Thickness in m."""
        if isinstance(self.thickness_mm, list):
            return [(s, h * MM) for s, h in self.thickness_mm]
        return self.thickness_mm * MM

    def build(self) -> "Resonator":
        """Return the resonator in SI units."""
        raise NotImplementedError


class Stemmed(Shape, frozen=True, kw_only=True):
    """A dome that may stand on a stem."""

    support: Annotated[Literal["free", "clamped-pole", "clamped-rim", "stem"], says("what holds it")] = "free"
    stem: StemKeys | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.support == "stem") != (self.stem is not None):
            raise ValueError("support = 'stem' and a table [resonator.stem] go together; give both or none.")

    @property
    def held(self) -> dict[str, Any]:
        """Support and stem in SI units."""
        return {"support": self.support, "stem": None if self.stem is None else self.stem.build()}


class Hemisphere(Stemmed, frozen=True, kw_only=True, tag="hemisphere"):
    """A dome of `radius_mm` from the polar angle `pole_angle_deg` (above 0 the pole is open) to `rim_angle_deg`."""

    radius_mm: Annotated[Length, says("of the middle surface")]
    rim_angle_deg: Annotated[float, number("polar angle where the meridian ends", above=0.0, most=180.0)] = 90.0
    pole_angle_deg: Annotated[float, number("where it starts; above 0 the pole is open", least=0.0, below=180.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rim_angle_deg <= RADIANS:
            angle = math.degrees(self.rim_angle_deg)
            raise ValueError(f"rim_angle_deg = {self.rim_angle_deg:g} is too small for a dome; it looks like radians: {self.rim_angle_deg:g} rad are {angle:.4g}°.")  # fmt: skip

    def build(self) -> "Resonator":
        """Return the resonator in SI units."""
        from shell.meridian import hemisphere

        return hemisphere(
            radius=self.radius_mm * MM, thickness=self.thickness, rim_angle=math.radians(self.rim_angle_deg),
            pole_angle=math.radians(self.pole_angle_deg), **self.held,
        )  # fmt: skip


class Cylinder(Shape, frozen=True, kw_only=True, tag="cylinder"):
    """A cup (without `bottom_thickness_mm` an open tube) whose lower face is clamped within `clamp_radius_mm`."""

    radius_mm: Annotated[Length, says("of the middle surface of the wall")]
    height_mm: Annotated[Length, says("total, from the lower face of the bottom to the rim")]
    bottom_thickness_mm: Annotated[Length, says("without it an open tube")] | None = None
    clamp_radius_mm: Annotated[NotNegative, says("the lower face is clamped within it; 0: free")] = 0.0

    def build(self) -> "Resonator":
        """Return the resonator in SI units."""
        from shell.meridian import cylinder

        return cylinder(
            radius=self.radius_mm * MM,
            thickness=self.thickness,
            height=self.height_mm * MM,
            bottom_thickness=None if self.bottom_thickness_mm is None else self.bottom_thickness_mm * MM,
            clamp_radius=self.clamp_radius_mm * MM,
        )


class Bell(Stemmed, frozen=True, kw_only=True, tag="bell"):
    """Hemisphere, cylinder and hyperbola (BVG paper, eq. 1)."""

    radius_mm: Annotated[Length, says("of the middle surface")]
    cylinder_height_mm: Annotated[NotNegative, says("below the dome")]
    hyperbola_height_mm: Annotated[NotNegative, says("below the cylinder")]
    mouth_radius_mm: Annotated[Length, says("at the rim")]

    def build(self) -> "Resonator":
        """Return the resonator in SI units."""
        from shell.meridian import bell

        return bell(
            radius=self.radius_mm * MM, thickness=self.thickness,
            cylinder_height=self.cylinder_height_mm * MM, hyperbola_height=self.hyperbola_height_mm * MM,
            mouth_radius=self.mouth_radius_mm * MM, **self.held,
        )  # fmt: skip


class LineKeys(Keys, frozen=True, kw_only=True, tag_field="kind", tag="line"):
    """A straight piece of a meridian, [r, z] to [r, z]."""

    from_mm: Annotated[Point, says("[r, z]")]
    to_mm: Annotated[Point, says("[r, z]")]


class ArcKeys(Keys, frozen=True, kw_only=True, tag_field="kind", tag="arc"):
    """A circular piece of a meridian about `center_mm`."""

    from_mm: Annotated[Point, says("[r, z]")]
    to_mm: Annotated[Point, says("[r, z]")]
    center_mm: Annotated[Point, says("[r, z]")]


class Meridian(Shape, frozen=True, kw_only=True, tag="meridian"):
    """A middle surface of lines and arcs in order; the support holds the first point or the last."""

    segment: Annotated[list[LineKeys | ArcKeys], msgspec.Meta(min_length=1)]
    support: Annotated[Literal["free", "clamped-pole", "clamped-rim"], says("of the first point or the last")] = "free"

    def build(self) -> "Resonator":
        """Return the resonator in SI units."""
        from shell.curves import Arc, Line
        from shell.meridian import meridian

        def metres(point: Point) -> Point:
            return point[0] * MM, point[1] * MM

        segments: list[Line | Arc] = [
            Line(metres(part.from_mm), metres(part.to_mm))
            if isinstance(part, LineKeys)
            else Arc.through(metres(part.from_mm), metres(part.to_mm), metres(part.center_mm))
            for part in self.segment
        ]
        support: Support = self.support
        return meridian(segments, thickness=self.thickness, support=support)


def build_resonator(keys: Shape, place: CardPlace) -> "Resonator":
    """Build the resonator; what the geometry does not allow is named with the card."""
    if (radius := getattr(keys, "radius_mm", 0.0) * MM) > LARGEST:
        raise InputError(f"{place.where}: radius_mm = {radius / MM:g} looks 1000 × too large: is it in µm?")
    with naming(place.where):
        resonator = keys.build()
    if not SMALLEST <= resonator.size <= LARGEST:
        hint = " Lengths are in mm, not in µm." if resonator.size > LARGEST else " Lengths are in mm, not in m."
        raise InputError(f"{place.where}: a resonator of {resonator.size / MM:g} mm cannot be built.{hint}")
    if (thinnest := min(h for _, h in resonator.thickness)) < THINNEST * resonator.size:
        raise InputError(f"{place.where}: thickness_mm = {thinnest / MM:g} is too thin for a resonator of {resonator.size / MM:g} mm. Lengths are in mm, not in m.")  # fmt: skip
    return resonator


TABLE = CardTable("resonator", Hemisphere | Cylinder | Bell | Meridian, build=build_resonator, required=True)
