"""The `[resonator]` table of a card becomes a resonator in SI units."""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, cast

from studies.errors import InputError, naming
from studies.files.toml import Section, check_number

if TYPE_CHECKING:
    from shell.resonator import Resonator, Stem, Support

MM = 1e-3
SUPPORTS = ("free", "clamped-pole", "clamped-rim", "stem")
STEM_KEYS = ("radius_mm", "end_mm", "side", "fillet_mm")

Profile = float | list[tuple[float, float]]


def build_resonator(table: Mapping[str, Any], where: str) -> "Resonator":
    """Build the resonator of a card.

    Raises
    ------
    InputError
        An unknown shape or key, a missing or impossible dimension.
    """
    shape = table.get("shape")
    if not isinstance(shape, str) or shape not in SHAPES:
        raise InputError(f"{where}: shape must be one of {', '.join(SHAPES)}, not {shape!r}.")
    known, build = SHAPES[shape]
    with naming(where):
        return build(Section(table, where, ("shape", *known)))


def _hemisphere(table: Section) -> "Resonator":
    from shell.meridian import hemisphere

    support, stem = _support(table)
    return hemisphere(
        radius=_mm(table, "radius_mm"),
        thickness=_thickness(table),
        rim_angle=math.radians(table.number("rim_angle_deg", 90.0, above=0.0, most=180.0)),
        pole_angle=math.radians(table.number("pole_angle_deg", 0.0, least=0.0, below=180.0)),
        support=support,
        stem=stem,
    )


def _cylinder(table: Section) -> "Resonator":
    from shell.meridian import cylinder

    return cylinder(
        radius=_mm(table, "radius_mm"),
        thickness=_thickness(table),
        height=_mm(table, "height_mm"),
        bottom_thickness=_mm(table, "bottom_thickness_mm") if "bottom_thickness_mm" in table else None,
        clamp_radius=table.number("clamp_radius_mm", 0.0, least=0.0) * MM,
    )


def _bell(table: Section) -> "Resonator":
    from shell.meridian import bell

    support, stem = _support(table)
    return bell(
        radius=_mm(table, "radius_mm"),
        thickness=_thickness(table),
        cylinder_height=table.number("cylinder_height_mm", least=0.0) * MM,
        hyperbola_height=table.number("hyperbola_height_mm", least=0.0) * MM,
        mouth_radius=_mm(table, "mouth_radius_mm"),
        support=support,
        stem=stem,
    )


def _meridian(table: Section) -> "Resonator":
    from shell.curves import Arc, Line
    from shell.meridian import meridian

    segments: list[Line | Arc] = []
    for part in table.sections("segment", ("kind", "from_mm", "to_mm", "center_mm")):
        kind = part.text("kind", choices=("line", "arc"))
        start, end = _point(part, "from_mm"), _point(part, "to_mm")
        segments.append(Line(start, end) if kind == "line" else Arc.through(start, end, _point(part, "center_mm")))
    if not segments:
        raise InputError(f"{table.where}: shape = 'meridian' needs at least one [[resonator.segment]].")
    support, _ = _support(table)
    if support == "stem":
        raise InputError(f"{table.where}: support = 'stem' goes with hemisphere and bell only; choose another support.")
    return meridian(segments, thickness=_thickness(table), support=support)


def _support(table: Section) -> "tuple[Support, Stem | None]":
    from shell.resonator import Stem

    support = cast("Support", table.text("support", "free", SUPPORTS))
    if (support == "stem") != ("stem" in table):
        raise InputError(
            f"{table.where}: support = 'stem' and a table [resonator.stem] go together; give both or none."
        )
    if support != "stem":
        return support, None
    part = table.section("stem", STEM_KEYS)
    side = cast("Literal['inner', 'outer', 'both']", part.text("side", "inner", ("inner", "outer", "both")))
    end = part.raw("end_mm")
    if side == "both":
        if not isinstance(end, list) or len(end) != 2:
            raise InputError(f"{part.where}: with side = 'both' end_mm must be [inner, outer], not {end!r}.")
        inner, outer = (check_number(value, f"{part.where}: end_mm") * MM for value in end)
        ends: float | tuple[float, float] = (inner, outer)
    else:
        ends = check_number(end, f"{part.where}: end_mm") * MM
    return support, Stem(
        radius=_mm(part, "radius_mm"), ends=ends, fillet=part.number("fillet_mm", 0.0, least=0.0) * MM, side=side
    )


def _thickness(table: Section) -> Profile:
    value = table.raw("thickness_mm")
    what = f"{table.where}: thickness_mm"
    if not isinstance(value, list):
        return check_number(value, what, above=0.0) * MM
    if len(value) < 2 or not all(isinstance(item, list) and len(item) == 2 for item in value):
        raise InputError(f"{what} must be a number or a list of two or more [position, value] pairs.")
    profile = [
        (check_number(s, what + " position", least=0.0, most=1.0), check_number(h, what + " value", above=0.0) * MM)
        for s, h in value
    ]
    places = [s for s, _ in profile]
    if any(b <= a for a, b in pairwise(places)):
        raise InputError(f"{what}: the positions must increase from 0 (start) to 1 (rim).")
    return profile


def _mm(table: Section, key: str) -> float:
    return table.number(key, above=0.0) * MM


def _point(table: Section, key: str) -> tuple[float, float]:
    value = table.raw(key)
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{table.where}: {key} must be [r, z] in mm, not {value!r}.")
    r, z = (check_number(x, f"{table.where}: {key}") * MM for x in value)
    return r, z


SHAPES: dict[str, tuple[tuple[str, ...], Callable[[Section], "Resonator"]]] = {
    # shape: (its keys, how it is built)
    "hemisphere": (
        ("radius_mm", "thickness_mm", "rim_angle_deg", "pole_angle_deg", "support", "stem"),
        _hemisphere,
    ),
    "cylinder": (("radius_mm", "thickness_mm", "height_mm", "bottom_thickness_mm", "clamp_radius_mm"), _cylinder),
    "bell": (
        (
            "radius_mm",
            "thickness_mm",
            "cylinder_height_mm",
            "hyperbola_height_mm",
            "mouth_radius_mm",
            "support",
            "stem",
        ),
        _bell,
    ),
    "meridian": (("thickness_mm", "segment", "support"), _meridian),
}
