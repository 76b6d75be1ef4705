"""The split of a harmonic pair: frequencies and axes of its two modes."""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from shell.imperfection.imperfect import Imperfection
from shell.imperfection.pair import Pair
from shell.quadrature import Array

ROUNDING = 1e-14  # relative; below it a split has no axis


@dataclass(frozen=True)
class Split:
    """Two modes where the perfect resonator has a pair."""

    harmonic: int  # n
    frequency: float  # of the perfect pair, Hz
    shift: float  # of the mean frequency, relative
    wave: complex  # (f_fast - f_slow)/f · exp(2 i n α), α the azimuth of an antinode of the faster mode

    @classmethod
    def of_squares(cls, harmonic: int, frequency: float, mean: float, z: complex) -> "Split":
        """From the relative changes of ω², mean ± |z|, in which what stiffens or loads a resonator adds; `z` has the direction of `wave`."""
        shift = float(shift_of(np.array([mean - abs(z), mean + abs(z)])).mean())
        return cls(harmonic, frequency, shift, z / (1 + shift))

    @property
    def squares(self) -> tuple[float, complex]:
        """Mean and z of the relative changes of ω²."""
        return self.shift * (2 + self.shift) + abs(self.wave) ** 2 / 4, self.wave * (1 + self.shift)

    @property
    def relative(self) -> float:
        """(f_fast - f_slow)/f."""
        return abs(self.wave)

    @property
    def hertz(self) -> float:
        """f_fast - f_slow, Hz."""
        return self.frequency * abs(self.wave)

    @property
    def resolved(self) -> bool:
        """Whether the split is more than rounding."""
        return abs(self.wave) >= ROUNDING

    @property
    def fast_axis(self) -> float:
        """Azimuth of an antinode of the faster mode, rad, in 0 ... π/n; 0 where the split is rounding only."""
        if not self.resolved:
            return 0.0
        return float(np.angle(self.wave) / (2 * self.harmonic) % (pi / self.harmonic))

    @property
    def slow_axis(self) -> float:
        """Azimuth of an antinode of the slower mode, rad, in 0 ... π/n: where mass is to be taken away."""
        return (self.fast_axis + pi / (2 * self.harmonic)) % (pi / self.harmonic)

    @property
    def frequencies(self) -> tuple[float, float]:
        """Of the slower and of the faster mode, Hz."""
        mean = self.frequency * (1 + self.shift)
        return mean - self.hertz / 2, mean + self.hertz / 2


def shift_of(change: ArrayLike) -> Array:
    """√(1 + x) - 1: the relative change of f by that of ω²."""
    x = np.maximum(change, -1.0)
    return np.asarray(x / (1 + np.sqrt(1 + x)))


def find_split(pair: Pair, imperfection: Imperfection) -> Split:
    """The split to first order in the imperfection: only its harmonics 0 and 2n act."""
    mean, z = 0.0, 0j
    n = pair.mode.harmonic
    terms = [(pair.density, imperfection.density), (pair.modulus, imperfection.modulus)]
    terms += zip(pair.faces, imperfection.faces(pair.fade), strict=True)
    if imperfection.rim:
        terms.append((pair.rim(), imperfection.rim))
    for density, field in terms:
        one, two = density.apply(field, n)
        mean, z = mean + one, z + two
    for mass in imperfection.masses:
        one, around = pair.mass(mass.position, mass.height)
        mean, z = mean + one * mass.mass, z + around * mass.mass * np.exp(2j * n * mass.azimuth)
    return Split(n, pair.mode.frequency, mean / 2, complex(z))
