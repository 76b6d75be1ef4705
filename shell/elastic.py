"""Isotropic elastic constants at one temperature, constant or varying along the meridian."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shell.errors import ShellError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Elastic:
    """Young's modulus E (Pa), Poisson ratio nu (1) and density rho (kg/m³) at one temperature."""

    E: float
    nu: float
    rho: float

    def __post_init__(self) -> None:
        if not self.E > 0:
            raise ShellError(f"Young's modulus must be positive, not {self.E:g} Pa.")
        if not -1 < self.nu < 0.5:
            raise ShellError(f"Poisson's ratio must lie between -1 and 0.5 (exclusive), not {self.nu:g}.")
        if not self.rho > 0:
            raise ShellError(f"density must be positive, not {self.rho:g} kg/m³.")

    @property
    def G(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)), in Pa."""
        return self.E / (2 * (1 + self.nu))


@dataclass(frozen=True)
class VaryingElastic:
    """E (Pa), ν and ρ (kg/m³) along the meridian: numbers or functions of the position 0 ... 1 of the arc length.

    A solid root takes the values of the place where it joins the shell.
    """

    E: float | Callable[[Array], ArrayLike]
    nu: float | Callable[[Array], ArrayLike]
    rho: float | Callable[[Array], ArrayLike]

    def at(self, position: Array) -> tuple[Array, Array, Array]:
        """E, ν, ρ at positions; raises ShellError where a value is impossible."""
        E, nu, rho = (
            np.broadcast_to(np.asarray(value(position) if callable(value) else value, dtype=float), position.shape)
            for value in (self.E, self.nu, self.rho)
        )
        if not (np.all(E > 0) and np.all(rho > 0) and np.all((nu > -1) & (nu < 0.5))):
            raise ShellError("along the meridian E and the density must be positive and Poisson's ratio in -1 ... 0.5.")
        return E, nu, rho
