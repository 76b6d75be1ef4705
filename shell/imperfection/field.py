"""Quantities over the shell as waves, p(x, θ) = Re Σ_m c_m(x) exp(-i m θ): a cos m(θ - θ_m) has c_m = a exp(i m θ_m); x = 0 ... 1."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.errors import ShellError
from shell.quadrature import Array

Complex: TypeAlias = NDArray[np.complex128]
Profile: TypeAlias = complex | Callable[[Array], ArrayLike]


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


def values_around(one: Field, orders: Iterable[int], position: Array, theta: Array) -> Array:
    """Values at positions (first axes) and azimuths (last axis), of the waves in `orders`."""
    p = np.zeros((*np.shape(position), theta.size))
    for m in orders:
        p += (one.wave(m, position)[..., None] * np.exp(-1j * m * theta)).real
    return p
