"""Meridians of resonators from their dimensions: hemisphere, cylinder, bell, any chain of lines and arcs."""

from itertools import pairwise
from math import isfinite, pi
from typing import TypeAlias

import numpy as np

from shell.curves import Arc, Hyperbola, Line
from shell.errors import ShellError, mm
from shell.resonator import Resonator, Stem, Support

Profile: TypeAlias = float | list[tuple[float, float]] | tuple[tuple[float, float], ...]
SUPPORTS = ("free", "clamped-pole", "clamped-rim", "stem")


def hemisphere(
    radius: float, thickness: Profile, rim_angle: float = pi / 2, pole_angle: float = 0.0, support: Support = "free",
    stem: Stem | None = None,
) -> Resonator:  # fmt: skip
    """A spherical dome between two polar angles.

    Args:
        radius: of the middle surface, m.
        thickness: h in m, or [(position, h), ...] along the arc.
        rim_angle, pole_angle: where the meridian ends and starts, rad; π closes the sphere, above 0 the pole is open.
        support: "free", "clamped-pole", "clamped-rim" or "stem".
    """
    _require_positive(radius=radius)
    if not 0 <= pole_angle < rim_angle <= pi + 1e-12:
        raise ShellError(f"a dome needs 0 <= pole angle < rim angle <= 180 degrees, not {np.degrees(pole_angle):g} and {np.degrees(rim_angle):g} degrees.")  # fmt: skip
    dome = Arc((0.0, 0.0), radius, pole_angle, min(rim_angle, pi))
    return Resonator((dome,), _profile(thickness), _known(support), stem)


def cylinder(
    radius: float, thickness: Profile, height: float, bottom_thickness: float | None = None, clamp_radius: float = 0.0
) -> Resonator:
    """A tube, open or with a flat bottom that meets the wall in a square corner.

    Args:
        radius, thickness: of the wall's middle, m; h or [(position, h), ...] from the foot, 0, to the rim, 1.
        height: from the lower face of the bottom (z = 0) to the rim, m.
        bottom_thickness, clamp_radius: m; None for an open tube; the lower face is held within, 0: free.
    """
    _require_positive(radius=radius, height=height)
    wall = _profile(thickness)
    if bottom_thickness is None:
        if clamp_radius:
            raise ShellError("an open tube has no bottom to clamp: give a bottom thickness.")
        return Resonator((Line((radius, 0.0), (radius, height)),), wall)
    _require_positive(bottom_thickness=bottom_thickness)
    if not height > bottom_thickness:
        raise ShellError(f"the height ({mm(height)}) must exceed the bottom thickness ({mm(bottom_thickness)}).")
    if not 0 <= clamp_radius < radius - wall[0][1] / 2:
        raise ShellError(f"the clamp radius must be 0 or positive and within the cup, not {mm(clamp_radius)}.")
    middle = bottom_thickness / 2
    length = radius + height - middle
    foot = radius / length
    profile = ((0.0, bottom_thickness), (foot, bottom_thickness), *((foot + (1 - foot) * x, h) for x, h in wall))
    plate, tube = Line((0.0, middle), (radius, middle)), Line((radius, middle), (radius, height))
    return Resonator((plate, tube), profile, "clamped-face" if clamp_radius else "free", None, clamp_radius)


def bell(
    radius: float, thickness: Profile, cylinder_height: float, hyperbola_height: float, mouth_radius: float,
    support: Support = "free", stem: Stem | None = None,
) -> Resonator:  # fmt: skip
    """The bell: hemisphere, cylinder and hyperbola joined smoothly, BVG paper eq. (1), lengths in m.

    x² + z² = R²;  x = R for -L <= z < 0;  x²/R² - (R_b² - R²)(z + L)²/(R² S²) = 1 below, to the mouth x = R_b >= R. L
    and S are the heights of cylinder and hyperbola; thickness, support and stem as for `hemisphere`.
    """
    _require_positive(radius=radius, cylinder_height=cylinder_height, hyperbola_height=hyperbola_height)
    if not mouth_radius >= radius:
        raise ShellError(f"the mouth radius ({mm(mouth_radius)}) must not be smaller than the radius ({mm(radius)}).")
    waist = -cylinder_height
    segments = (
        Arc((0.0, 0.0), radius, 0.0, pi / 2),
        Line((radius, 0.0), (radius, waist)),
        Hyperbola(radius, waist, hyperbola_height, mouth_radius),
    )
    return Resonator(segments, _profile(thickness), _known(support), stem)


def meridian(
    segments: list[Line | Arc] | tuple[Line | Arc, ...], thickness: Profile, support: Support = "free"
) -> Resonator:
    """Any chain of lines and arcs; `support` holds its first point ("clamped-pole") or its last ("clamped-rim")."""
    if support == "stem":
        raise ShellError("a stem stands on a dome: use the shape hemisphere or bell, or another support.")
    return Resonator(tuple(segments), _profile(thickness), _known(support))


def _profile(thickness: Profile) -> tuple[tuple[float, float], ...]:
    if isinstance(thickness, (int, float)):
        return (0.0, float(thickness)), (1.0, float(thickness))
    profile = tuple((float(position), float(value)) for position, value in thickness)
    if any(second[0] <= first[0] for first, second in pairwise(profile)):
        raise ShellError("the positions of a thickness profile must rise from 0 to 1 (rim), none of them twice.")
    return profile


def _known(support: Support) -> Support:
    if support not in SUPPORTS:
        raise ShellError(f"the support is one of {', '.join(SUPPORTS)}, not {support!r}.")
    return support


def _require_positive(**lengths: float) -> None:
    for name, value in lengths.items():
        if not (value > 0 and isfinite(value)):
            raise ShellError(f"the {name.replace('_', ' ')} must be positive, not {mm(value)}.")
