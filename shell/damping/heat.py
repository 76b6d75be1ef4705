"""What warms: the heat constants of a material, and the mean stress that warms it."""

from dataclasses import dataclass

import numpy as np

from shell.errors import ShellError
from shell.quadrature import Array
from shell.solution import Constants


@dataclass(frozen=True)
class Heat:
    """What a material does with heat: expansion α (1/K), capacity C = ρ c (J/(m³ K)), conductivity k (W/(m K))."""

    expansion: float
    capacity: float
    conductivity: float

    def __post_init__(self) -> None:
        if not (self.capacity > 0 and self.conductivity > 0):
            raise ShellError("heat capacity and conductivity must be positive.")


def mean_stress(c: Constants, strain: Array) -> Array:
    """Trace of the stress, Pa: E/(1 - 2ν) tr ε, in plane stress E/(1 - ν) (ε_1 + ε_2)."""
    if c.plane_stress:
        return np.asarray((c.E / (1 - c.nu))[..., None] * (strain[:, :, 0] + strain[:, :, 1]))
    return np.asarray((c.E / (1 - 2 * c.nu))[..., None] * np.add.reduce(strain[:, :, :3], axis=2))
