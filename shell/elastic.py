"""Isotropic elastic constants at one temperature, constant or varying along the meridian, and at the stations of elements."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from shell.errors import ShellError, require_numbers
from shell.kernel import StrainTable, energy_weights, lame
from shell.quadrature import Array

if TYPE_CHECKING:
    from shell.cells import CellTable

COSINE, SINE = [0, 1, 2, 4], [3, 5]  # strains that vary as cos nθ and as sin nθ, in the order of the kernel


@dataclass(frozen=True)
class Elastic:
    """Young's modulus E (Pa), Poisson ratio nu (1) and density rho (kg/m³) at one temperature."""

    E: float
    nu: float
    rho: float

    def __post_init__(self) -> None:
        require_numbers("Elastic", self.E, self.nu, self.rho)
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
    """E (Pa), ν and ρ (kg/m³) along the meridian, numbers or functions of the position 0 ... 1; a root takes those where it joins."""

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


@dataclass(frozen=True, eq=False)
class Constants:
    """E (Pa), ν and ρ (kg/m³) at the stations of one group, arrays (elements, stations), with Lamé's λ and G (Pa)."""

    E: Array
    nu: Array
    rho: Array
    plane_stress: bool

    @cached_property
    def lame(self) -> tuple[Array, Array]:
        """λ (that of plane stress in shell theory) and G."""
        return lame(self.E, self.nu, self.plane_stress)

    def stress(self, table: "StrainTable | CellTable", strain: Array) -> Array:
        """Stresses (..., elements, stations, 6, points) of such strains, Pa."""
        lam, G = (field[..., None] for field in self.lame)
        stress = G[..., None] * energy_weights(table.transverse_shear)[:, None] * strain
        stress[..., :3, :] += (lam * np.add.reduce(strain[..., :3, :], axis=-2))[..., None, :]
        return np.asarray(stress)

    def parts(self, table: "StrainTable | CellTable", strain: Array) -> tuple[Array, Array]:
        """Twice the energy density of such strains, of those that vary as cos nθ and of those that vary as sin nθ."""
        lam, G = (field[..., None] for field in self.lame)
        sheared = G[:, :, None] * energy_weights(table.transverse_shear)[:, None] * strain * strain
        cosine = lam * np.add.reduce(strain[:, :, :3], axis=2) ** 2 + sheared[:, :, COSINE].sum(axis=2)
        return np.asarray(cosine), np.asarray(sheared[:, :, SINE].sum(axis=2))

    def at(self, where: Any) -> "Constants":
        """The material of some of the elements or stations."""
        return Constants(self.E[where], self.nu[where], self.rho[where], self.plane_stress)


def find_constants(position: Array, elastic: Elastic | VaryingElastic, plane_stress: bool) -> Constants:
    """The material at stations with positions (elements, stations) on the meridian."""
    if isinstance(elastic, VaryingElastic):
        E, nu, rho = elastic.at(position)
    else:
        E, nu, rho = (np.full(position.shape, value) for value in (elastic.E, elastic.nu, elastic.rho))
    return Constants(E, nu, rho, plane_stress)
