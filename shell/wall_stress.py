"""In-plane stress of the wall under a mode, which piezo elements on a face sense."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from shell.errors import ShellError
from shell.modes import Mode


@dataclass(frozen=True)
class WallStress:
    """Mean stresses on a face at the antinode, per largest displacement of the mode (Pa/m): `along` the meridian and `around`."""

    along: float
    around: float

    @property
    def total(self) -> float:
        """Their sum, which a d₃₁ element in the plane of the wall collects."""
        return self.along + self.around


def find_wall_stress(mode: Mode, first: float, last: float, face: Literal["inner", "outer"] = "outer") -> WallStress:
    """Return σ_φφ and σ_θθ of a free face, means by area between two positions: E/(1 − ν²) (ε_φ + ν ε_θ) and its like."""
    from shell.damping.faces import shell_faces

    if mode.solution is None:
        raise ShellError("Rayleigh's closed form carries no stresses: use theory solid or shell.")
    inner, outer = shell_faces(mode.solution)
    wall = inner if face == "inner" else outer
    under = (wall.position >= first) & (wall.position <= last)
    if not np.any(under):
        raise ShellError(f"no part of the shell lies between the positions {first:g} and {last:g}.")
    stiff = wall.E / (1 - wall.nu**2)
    weight = np.where(under, wall.area, 0.0) / float(np.sum(wall.area[under])) / mode.largest_displacement
    along, around = (
        float(np.sum(stiff * (wall.strain[i] + wall.nu * wall.strain[j]) * weight)) for i, j in ((0, 1), (1, 0))
    )
    return WallStress(along, around)
