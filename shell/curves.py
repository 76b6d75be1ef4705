"""Smooth pieces of a meridian in the (r, z) plane: line, arc and the hyperbola of the bell."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from math import atan2, hypot, pi
from typing import Any, TypeVar

import numpy as np

from shell.errors import ShellError, mm, require_numbers
from shell.quadrature import Array, gauss

Point = tuple[float, float]
Shape = TypeVar("Shape")


@dataclass(frozen=True, eq=False)
class Jet:
    """Position and its first two derivatives along a parameter x in [0, 1]."""

    r: Array
    z: Array
    dr: Array
    dz: Array
    ddr: Array
    ddz: Array


def scaled(one: Shape, factor: float) -> Shape:
    """A curve or a stem with all lengths multiplied by `factor`; angles and words stay."""
    given: dict[str, Any] = {field.name: getattr(one, field.name) for field in fields(one)}  # type: ignore[arg-type]
    for name, value in given.items():
        if not (isinstance(value, str) or name.endswith("_angle")):
            given[name] = tuple(factor * x for x in value) if isinstance(value, tuple) else factor * value
    return type(one)(**given)


class Curve(ABC):
    """A smooth curve x -> (r, z), x in [0, 1]."""

    @abstractmethod
    def jet(self, x: Array) -> Jet:
        """Position, first and second derivative at the parameters x."""

    @cached_property
    def length(self) -> float:
        """Arc length, m."""
        return float(self._length_to(np.array([1.0]))[0])

    @cached_property
    def end_points(self) -> tuple[Point, Point]:
        """First and last point (r, z), m."""
        jet = self.jet(np.array([0.0, 1.0]))
        return (float(jet.r[0]), float(jet.z[0])), (float(jet.r[1]), float(jet.z[1]))

    def at_length(self, s: Array) -> Jet:
        """Position and derivatives at arc lengths s (m), which grow as x unless the curve says otherwise."""
        return self.jet(s / self.length)

    def _length_to(self, x: Array) -> Array:
        points, weights = gauss(48)
        jet = self.jet((np.outer(x, (points + 1) / 2)).ravel())
        speed = np.hypot(jet.dr, jet.dz).reshape(len(x), -1)
        return np.asarray(speed @ weights * x / 2)


@dataclass(frozen=True)
class Line(Curve):
    """A straight line from `start` to `end`, (r, z) in m."""

    start: Point
    end: Point

    def __post_init__(self) -> None:
        for end in (self.start, self.end):
            require_numbers(
                "Line, from (r, z) to (r, z),",
                *(end if isinstance(end, list | tuple) and len(end) == 2 else [end, None]),
            )
        if not hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]) > 0:
            raise ShellError(f"a line of the meridian has no length: both ends are at {self.start} m.")

    def jet(self, x: Array) -> Jet:
        """Position, first and second derivative at the parameters x."""
        (r, z), (r_end, z_end) = self.start, self.end
        dr, dz = np.full_like(x, r_end - r), np.full_like(x, z_end - z)
        return Jet(r + x * dr, z + x * dz, dr, dz, 0 * x, 0 * x)


@dataclass(frozen=True)
class Arc(Curve):
    """A circular arc, center + radius (sin ψ, cos ψ) for ψ from `first_angle` to `last_angle` (rad, from the axis)."""

    center: Point
    radius: float
    first_angle: float
    last_angle: float

    @classmethod
    def through(cls, start: Point, end: Point, center: Point) -> "Arc":
        """The shorter arc about `center` from `start` to `end`, (r, z) in m."""
        offsets = [(point[0] - center[0], point[1] - center[1]) for point in (start, end)]
        radii = [hypot(*offset) for offset in offsets]
        if abs(radii[0] - radii[1]) > 1e-6 * max(radii):
            raise ShellError(f"the arc's ends are {mm(radii[0])} and {mm(radii[1])} from its centre, not equally far.")
        first, last = (atan2(*offset) for offset in offsets)
        turn = (last - first + pi) % (2 * pi) - pi
        if abs(turn) < 1e-9 or abs(abs(turn) - pi) < 1e-9:
            raise ShellError("an arc must turn by more than 0 and less than 180 degrees: split it in two.")
        return cls(center, (radii[0] + radii[1]) / 2, first, first + turn)

    def jet(self, x: Array) -> Jet:
        """Position, first and second derivative at the parameters x."""
        turn = self.last_angle - self.first_angle
        psi = self.first_angle + turn * x
        sine, cosine = self.radius * np.sin(psi), self.radius * np.cos(psi)
        return Jet(
            self.center[0] + sine, self.center[1] + cosine, turn * cosine, -turn * sine, -(turn**2) * sine,
            -(turn**2) * cosine,
        )  # fmt: skip


@dataclass(frozen=True)
class Hyperbola(Curve):
    """The mouth of the bell, BVG paper eq. (1): r = √(R² + (R_b² - R²) x²), z = waist - S x.

    `radius` R at the waist, `height` S down to the mouth of radius `mouth_radius` R_b, all in m.
    """

    radius: float
    waist: float
    height: float
    mouth_radius: float

    def jet(self, x: Array) -> Jet:
        """Position, first and second derivative at the parameters x."""
        spread = self.mouth_radius**2 - self.radius**2
        r = np.sqrt(self.radius**2 + spread * x**2)
        dr = spread * x / r
        return Jet(r, self.waist - self.height * x, dr, np.full_like(x, -self.height), (spread - dr**2) / r, 0 * x)

    def at_length(self, s: Array) -> Jet:
        """Position and derivatives at arc lengths s (m), by Newton's method on s(x)."""
        x = np.interp(s, self._lengths, np.linspace(0.0, 1.0, len(self._lengths)))
        for _ in range(8):
            jet = self.jet(x)
            step = (s - self._length_to(x)) / np.hypot(jet.dr, jet.dz)
            x = x + step
            if np.all(abs(step) < 1e-8):  # the next step is about its square
                break
        return self.jet(x)

    @cached_property
    def _lengths(self) -> Array:
        """Arc lengths to equally spaced parameters, the start of Newton's method."""
        return self._length_to(np.linspace(0.0, 1.0, 65))
