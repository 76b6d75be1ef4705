"""Thickness profiles of a family: one number times the nominal profile, and shapes added to it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from shell.errors import ShellError
from shell.meridian import Resonator
from shell.quadrature import Array

Pairs: TypeAlias = tuple[tuple[float, float], ...]
Shape: TypeAlias = Callable[[Array], ArrayLike] | Sequence[tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Profiles:
    """h(s) = thickness (base(s) + Σ a_k shape_k(s)); base is the resonator's own profile over its largest value."""

    resonator: Resonator
    base: Pairs
    shapes: tuple[Callable[[Array], ArrayLike] | Pairs, ...]

    @classmethod
    def of(cls, resonator: Resonator, shapes: Sequence[Shape]) -> "Profiles":
        """Read the shapes; raises ShellError for pairs that are no profile."""
        largest = max(value for _, value in resonator.thickness)
        base = tuple((position, value / largest) for position, value in resonator.thickness)
        return cls(resonator, base, tuple(shape if callable(shape) else _read(shape) for shape in shapes))

    @property
    def smooth(self) -> bool:
        """Whether some shape is a function, which no resonator can carry exactly."""
        return any(callable(shape) for shape in self.shapes)

    def at(self, position: Array) -> tuple[Array, Array]:
        """The base (...) and the shapes (shapes, ...) at positions (...) that are not knots."""
        base = np.interp(position, *np.array(self.base).T)
        values = [
            np.broadcast_to(np.asarray(shape(position), dtype=float), position.shape)
            if callable(shape)
            else np.interp(position, *np.array(shape).T)
            for shape in self.shapes
        ]
        shapes = np.array(values).reshape(len(self.shapes), *position.shape)
        if not np.all(np.isfinite(shapes)):
            raise ShellError("a shape of the family is not finite everywhere along the meridian.")
        return base, shapes

    def build(self, thickness: float, amplitudes: Array) -> Resonator:
        """The resonator of one design, with a knot at every knot of base and shapes; functions are left out."""
        known = {position for position, _ in self.base}
        linear = [
            (a, np.array(shape).T) for a, shape in zip(amplitudes, self.shapes, strict=True) if not callable(shape)
        ]
        new = sorted({float(p) for _, (positions, _) in linear for p in positions} - known)
        pairs = sorted(
            [*self.base, *((p, float(np.interp(p, *np.array(self.base).T))) for p in new)], key=lambda pair: pair[0]
        )
        varied = tuple(
            (p, thickness * (value + sum(float(a * np.interp(p, *xy)) for a, xy in linear))) for p, value in pairs
        )
        return replace(self.resonator, thickness=varied)


def _read(shape: Sequence[tuple[float, float]]) -> Pairs:
    pairs = tuple((float(position), float(value)) for position, value in shape)
    positions = np.array([position for position, _ in pairs])
    if len(pairs) < 2 or positions[0] != 0 or positions[-1] != 1 or np.any(np.diff(positions) <= 0):
        raise ShellError("the positions of a shape must rise from 0 (start) to 1 (rim).")
    return pairs
