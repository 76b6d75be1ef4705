"""Quantities over the shell as waves, p(x, θ) = Re Σ_m c_m(x) exp(-i m θ): a cos m(θ - θ_m) has c_m = a exp(i m θ_m); x = 0 ... 1."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import prod
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.errors import ShellError
from shell.quadrature import Array

Complex: TypeAlias = NDArray[np.complex128]
Profile: TypeAlias = Callable[[Array], ArrayLike]


@dataclass(frozen=True)
class Field:
    """A quantity over the shell: terms (m, a number, functions of the position), of which c_m is the sum of products; none: 0."""

    terms: tuple[tuple[int, complex, tuple[Profile, ...]], ...] = ()

    @property
    def orders(self) -> tuple[int, ...]:
        """The waves m that it has, rising."""
        return tuple(sorted({order for order, *_ in self.terms}))

    def wave(self, order: int, position: Array) -> Complex:
        """c_m at positions; 0 for an order that it does not have."""
        found = np.zeros(np.shape(position), dtype=complex)
        for m, factor, profiles in self.terms:
            if m == order:
                found += factor * prod(np.asarray(one(position)) for one in profiles)
        return found

    def __bool__(self) -> bool:
        return bool(self.terms)

    def __add__(self, other: "Field") -> "Field":
        return Field(self.terms + other.terms)

    def __mul__(self, factor: float | Profile) -> "Field":
        """Times a number or a function of the position."""
        if callable(factor):
            return Field(tuple((m, c, (*profiles, factor)) for m, c, profiles in self.terms))
        return Field(tuple((m, c * factor, profiles) for m, c, profiles in self.terms))


NOTHING = Field()


def wave(order: int, amplitude: float, azimuth: float = 0.0) -> Field:
    """A single wave a cos m(θ - θ_m), θ_m (rad) the azimuth of a crest."""
    if order != int(order) or order < 0:
        raise ShellError(f"the circumferential order of a wave is a whole number from 0 up, not {order!r}.")
    return Field(((order, complex(amplitude * np.exp(1j * order * azimuth)), ()),))


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
