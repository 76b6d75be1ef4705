"""The designs of a family: thickness, shapes, stem and ν within ranges."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shell.quadrature import Array

Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Designs:
    """Designs at the nominal radius.

    thickness : (m,), m.
    amplitudes : of the shapes, (m, shapes).
    stem : (m,), radius, ends and fillet of the stem over their nominal values.
    nu : (m,), Poisson's ratio.
    """

    thickness: Array
    amplitudes: Array
    stem: Array
    nu: Array

    def __len__(self) -> int:
        return len(self.nu)

    def part(self, which: slice | NDArray[np.intp]) -> "Designs":
        """Some of the designs."""
        return Designs(self.thickness[which], self.amplitudes[which], self.stem[which], self.nu[which])


@dataclass(frozen=True, eq=False)
class Box:
    """Designs h(s) = thickness (base(s) + Σ a_k shape_k(s)) with |a_k| <= amplitude, and ranges of the stem and of ν.

    base, shapes : at the stations, (elements, stations) and (shapes, elements, stations).
    """

    thickness: Range
    amplitude: float
    stem: Range
    nu: Range
    base: Array
    shapes: Array

    @property
    def dimensions(self) -> int:
        """Thickness, amplitudes, ν, and the stem where it varies."""
        return len(self.shapes) + 2 + (self.stem[1] > self.stem[0])

    def designs(self, unit: Array) -> Designs:
        """The designs at points of the cube -1 ... 1."""
        count = len(self.shapes)
        stem = unit[:, count + 2] if unit.shape[1] > count + 2 else np.zeros(len(unit))
        return Designs(
            _within(self.thickness, unit[:, 0]),
            self.amplitude * unit[:, 1 : count + 1],
            _within(self.stem, stem),
            _within(self.nu, unit[:, count + 1]),
        )

    def profile(self, designs: Designs) -> Array:
        """Thickness at the stations, (designs, elements, stations)."""
        return designs.thickness[:, None, None] * (self.base + np.tensordot(designs.amplitudes, self.shapes, 1))


def _within(span: Range, unit: Array) -> Array:
    return (span[0] + span[1]) / 2 + (span[1] - span[0]) / 2 * unit
