"""Thickness profiles of a family: one number times the nominal profile, and shapes added to it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from shell.errors import ShellError
from shell.quadrature import Array
from shell.resonator import Resonator, Stem

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

    def build(self, thickness: float, amplitudes: Array, stem: float = 1.0) -> Resonator:
        """The resonator of one design, with a knot at every knot of base and shapes; `stem` times the stem's lengths."""
        linear = [(float(a), shape) for a, shape in zip(amplitudes, self.shapes, strict=True) if not callable(shape)]
        positions = sorted({p for pairs in (self.base, *(shape for _, shape in linear)) for p, _ in pairs})
        varied: list[tuple[float, float]] = []
        for p in positions:
            base = _limits(self.base, p)
            changes = [(a, _limits(shape, p)) for a, shape in linear]
            before, after = (
                thickness * (base[side] + sum(a * limits[side] for a, limits in changes)) for side in (0, 1)
            )
            varied += [(p, before)] if before == after else [(p, before), (p, after)]
        curved = tuple(
            (thickness * float(a), shape) for a, shape in zip(amplitudes, self.shapes, strict=True) if callable(shape)
        )
        plain = self.resonator
        if plain.stem and stem != 1:
            plain = replace(plain, stem=_scaled(plain.stem, stem))
        if not curved:
            return replace(plain, thickness=tuple(varied))
        return Curved(plain.segments, tuple(varied), plain.support, plain.stem, plain.clamp_radius, curved)


@dataclass(frozen=True)
class Curved(Resonator):
    """A resonator to whose thickness multiples (m) of smooth functions of the position are added."""

    added: tuple[tuple[float, Callable[[Array], ArrayLike]], ...] = ()

    def _thickness_near(self, s: Array, inside: float) -> tuple[Array, Array]:
        thickness, slope = super()._thickness_near(s, inside)
        position, step = s / self.length, 1e-5
        one, two = np.maximum(position - step, 0.0), np.minimum(position + step, 1.0)
        for factor, shape in self.added:
            rise = np.asarray(shape(two), dtype=float) - np.asarray(shape(one), dtype=float)
            thickness = thickness + factor * np.asarray(shape(position), dtype=float)
            slope = slope + factor * rise / ((two - one) * self.length)
        return thickness, slope


def _limits(pairs: Pairs, p: float) -> tuple[float, float]:
    """Values just before and just after a position, which differ at a step."""
    there = [value for position, value in pairs if position == p]
    if there:
        return there[0], there[-1]
    value = float(np.interp(p, *np.array(pairs).T))
    return value, value


def _scaled(stem: Stem, factor: float) -> Stem:
    ends = tuple(end * factor for end in stem.ends) if isinstance(stem.ends, tuple) else stem.ends * factor
    return Stem(stem.radius * factor, ends, stem.fillet * factor, stem.side)  # type: ignore[arg-type]


def _read(shape: Sequence[tuple[float, float]]) -> Pairs:
    pairs = tuple((float(position), float(value)) for position, value in shape)
    positions = np.array([position for position, _ in pairs])
    if len(pairs) < 2 or positions[0] != 0 or positions[-1] != 1 or np.any(np.diff(positions) < 0):
        raise ShellError("the positions of a shape must rise from 0 (start) to 1 (rim).")
    return pairs
