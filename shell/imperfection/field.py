"""Quantities over the shell as waves around the axis, p(x, θ) = Re Σ_m c_m(x) exp(-i m θ), x the position 0 ... 1.

A wave a cos m(θ - θ_m) has c_m = a exp(i m θ_m); c_0 is the mean around. Positions are shares of the arc length, 0 where
the meridian starts and 1 at the rim.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import pi
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.errors import ShellError
from shell.quadrature import Array

Complex: TypeAlias = NDArray[np.complex128]
Profile: TypeAlias = complex | Callable[[Array], ArrayLike]
HIGHEST = 16  # wave kept of a function of θ


class Field(Protocol):
    """A quantity over the shell."""

    @property
    def orders(self) -> tuple[int, ...]:
        """The waves m that it has, rising."""

    def wave(self, order: int, position: Array) -> Complex:
        """c_m at positions; 0 for an order that it does not have."""


@dataclass(frozen=True)
class Waves:
    """A field of given waves: m to c_m, a complex number or a function of the position."""

    profiles: Mapping[int, Profile]

    @property
    def orders(self) -> tuple[int, ...]:
        """The waves m that it has, rising."""
        return tuple(sorted(self.profiles))

    def wave(self, order: int, position: Array) -> Complex:
        """c_m at positions."""
        profile = self.profiles.get(order, 0.0)
        value = profile(position) if callable(profile) else profile
        return np.broadcast_to(np.asarray(value, dtype=complex), np.shape(position))


@dataclass(frozen=True)
class _Grown:
    """A number times a function of the position."""

    factor: complex
    profile: Callable[[Array], ArrayLike]

    def __call__(self, x: Array) -> Complex:
        return np.asarray(self.factor * np.asarray(self.profile(x)))


def wave(
    order: int, amplitude: float, azimuth: float = 0.0, profile: Callable[[Array], ArrayLike] | None = None
) -> Waves:
    """A single wave a(x) cos m(θ - θ_m), θ_m (rad) the azimuth of a crest, `profile` a factor over the position."""
    if order != int(order) or order < 0:
        raise ShellError(f"the circumferential order of a wave is a whole number from 0 up, not {order!r}.")
    c = complex(amplitude * np.exp(1j * order * azimuth))
    return Waves({order: c if profile is None else _Grown(c, profile)})


@dataclass(frozen=True)
class Function:
    """A field given as a function p(position, θ) of arrays that broadcast together, sampled at 4 `highest` azimuths."""

    function: Callable[[Array, Array], ArrayLike]
    highest: int = HIGHEST
    _kept: dict[bytes, Complex] = field(default_factory=dict, repr=False, compare=False)

    @property
    def orders(self) -> tuple[int, ...]:
        """The waves m that it may have."""
        return tuple(range(self.highest + 1))

    def wave(self, order: int, position: Array) -> Complex:
        """c_m at positions."""
        if order > self.highest:
            return np.zeros(np.shape(position), dtype=complex)
        x = np.asarray(position, dtype=float)
        key = x.tobytes()
        if key not in self._kept:
            theta = 2 * pi * np.arange(4 * self.highest) / (4 * self.highest)
            value = np.asarray(self.function(x[..., None], theta), dtype=float)
            self._kept.clear()  # the waves of one call come in a row
            self._kept[key] = fourier(np.broadcast_to(value, (*x.shape, theta.size)), self.highest)
        return np.asarray(self._kept[key][..., order])


@dataclass(frozen=True, eq=False)
class Map:
    """A field given by a table over positions and equally spaced azimuths; cubic between positions, constant beyond."""

    position: Array  # rising, 0 ... 1, (rows,)
    azimuth: Array  # of the columns, rad: equal steps that close the circle, (columns,)
    values: Array  # (rows, columns), no gaps

    def __post_init__(self) -> None:
        x, theta = np.asarray(self.position, dtype=float), np.asarray(self.azimuth, dtype=float)
        if np.shape(self.values) != (x.size, theta.size):
            raise ShellError(
                f"a map of {x.size} positions and {theta.size} azimuths needs as many rows and columns, "
                f"not {' x '.join(str(k) for k in np.shape(self.values))}."
            )
        if x.size < 1 or np.any(np.diff(x) <= 0) or x.min() < -1e-9 or x.max() > 1 + 1e-9:
            raise ShellError("the positions of a map must rise within 0 (start of the meridian) ... 1 (rim).")
        step = 2 * pi / max(theta.size, 1)
        if theta.size < 4 or np.any(abs(np.diff(theta) - step) > 1e-3 * step):
            raise ShellError(
                f"the azimuths of a map must close the circle in equal steps: {theta.size} columns need steps of "
                f"{np.rad2deg(step):.4g}°, from {np.rad2deg(theta[0]) if theta.size else 0:.4g}° on, without a repeat at 360°."
            )
        if not np.all(np.isfinite(self.values)):
            raise ShellError(
                f"the map has {int(np.sum(~np.isfinite(self.values)))} empty cells: fit harmonics to the measured "
                "points (hrg scan), or fill them."
            )

    @property
    def orders(self) -> tuple[int, ...]:
        """The waves m that its columns can tell apart."""
        return tuple(range((len(self.azimuth) - 1) // 2 + 1))

    def wave(self, order: int, position: Array) -> Complex:
        """c_m at positions."""
        if order not in self.orders:
            return np.zeros(np.shape(position), dtype=complex)
        x = np.clip(position, self.position[0], self.position[-1])
        if len(self.position) == 1:
            return np.broadcast_to(self._waves[0, order], np.shape(x))
        degree = min(3, len(self.position) - 1)
        from scipy.interpolate import make_interp_spline

        return np.asarray(make_interp_spline(self.position, self._waves[:, order], degree)(x))

    @cached_property
    def _waves(self) -> Complex:
        turned = np.exp(1j * np.arange(self.orders[-1] + 1) * self.azimuth[0])
        return np.asarray(fourier(np.asarray(self.values, dtype=float), self.orders[-1]) * turned)


@dataclass(frozen=True)
class Sum:
    """Factors times fields, added."""

    terms: tuple[tuple[float, Field], ...]

    @property
    def orders(self) -> tuple[int, ...]:
        """The waves m that any of them has."""
        return tuple(sorted({order for _, term in self.terms for order in term.orders}))

    def wave(self, order: int, position: Array) -> Complex:
        """c_m at positions."""
        return np.asarray(sum(factor * term.wave(order, position) for factor, term in self.terms), dtype=complex)


@dataclass(frozen=True)
class Faded:
    """A field times a factor that depends on the position alone."""

    whole: Field
    factor: Callable[[Array], Array]

    @property
    def orders(self) -> tuple[int, ...]:
        """The waves m of the field."""
        return self.whole.orders

    def wave(self, order: int, position: Array) -> Complex:
        """c_m at positions."""
        return np.asarray(self.whole.wave(order, position) * self.factor(position))


def add(*fields: "Field | None") -> "Field | None":
    """Sum of the fields that are given."""
    present = [one for one in fields if one is not None]
    if len(present) < 2:
        return present[0] if present else None
    return Sum(tuple((1.0, one) for one in present))


def scaled(one: "Field | None", factor: float) -> "Field | None":
    """A field times a factor."""
    return None if one is None else Sum(((factor, one),))


def fourier(values: Array, highest: int) -> Complex:
    """c_0 ... c_highest of values at equal steps of θ from 0 on, over the last axis."""
    count = values.shape[-1]
    waves = np.conj(np.fft.rfft(values, axis=-1)[..., : highest + 1]) * (2 / count)
    waves[..., 0] /= 2
    return np.asarray(waves)


def values_around(one: Field, orders: Iterable[int], position: Array, theta: Array) -> tuple[Array, Array]:
    """Values p and ∂p/∂θ at positions (first axes) and azimuths (last axis), of the waves in `orders`."""
    p = np.zeros((*np.shape(position), theta.size))
    slope = np.zeros_like(p)
    for m in orders:
        c = one.wave(m, position)[..., None]
        turned = np.exp(-1j * m * theta)
        p += (c * turned).real
        slope += (-1j * m * c * turned).real
    return p, slope
