"""What one eigenvector says: strain and kinetic energy, precession, and where along the meridian they sit."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shell.assembly import Group, System
from shell.kernel import displacements, energy_weights, strains
from shell.quadrature import Array


@dataclass(frozen=True, eq=False)
class Constants:
    """Lamé's λ and G (Pa) and density ρ (kg/m³) at the stations of one group, arrays (elements, stations)."""

    lam: Array
    G: Array
    rho: Array


@dataclass(frozen=True, eq=False)
class Solution:
    """One eigenvector of a system with the material it was computed for."""

    system: System
    constants: tuple[Constants, ...]
    vector: Array

    @cached_property
    def unknowns(self) -> list[Array]:
        """Element unknowns of every group."""
        return self.system.spread(self.vector)

    @cached_property
    def strain(self) -> list[Array]:
        """Strains (elements, stations, 6, points) of every group."""
        return [strains(group.table, q) for group, q in zip(self.system.groups, self.unknowns, strict=True)]

    @cached_property
    def displacement(self) -> list[Array]:
        """Displacements (elements, stations, 3, points) of every group, in its own axes."""
        return [displacements(group.table, q) for group, q in zip(self.system.groups, self.unknowns, strict=True)]

    @cached_property
    def volumetric(self) -> list[Array]:
        """λ part of twice the strain energy at every station: ∫ λ (ε_1 + ε_2 + ε_3)² over the points."""
        return [
            c.lam * _integrate(e[:, :, :3].sum(axis=2) ** 2, group)
            for group, c, e in zip(self.system.groups, self.constants, self.strain, strict=True)
        ]

    @cached_property
    def deviatoric(self) -> list[Array]:
        """G part of twice the strain energy at every station: ∫ G Σ g_c ε_c² over the points."""
        return [
            c.G * _integrate(np.einsum("c,eicj->eij", energy_weights(group.table), e**2), group)
            for group, c, e in zip(self.system.groups, self.constants, self.strain, strict=True)
        ]

    @cached_property
    def elastic(self) -> list[Array]:
        """Twice the strain energy of every station, a sum of squares and so free of cancellation."""
        return [a + b for a, b in zip(self.volumetric, self.deviatoric, strict=True)]

    @cached_property
    def kinetic(self) -> list[Array]:
        """Twice the kinetic energy of every station over ω²."""
        return [
            c.rho * _integrate((d**2).sum(axis=2), group)
            for group, c, d in zip(self.system.groups, self.constants, self.displacement, strict=True)
        ]

    @cached_property
    def eigenvalue(self) -> float:
        """ω² = Σ elastic / Σ kinetic, the Rayleigh quotient from strains at quadrature points."""
        return total(self.elastic) / total(self.kinetic)

    @cached_property
    def bryan_factor(self) -> float:
        """Angle by which the standing wave precesses per angle of rotation: -2 ∫ ρ u_r u_θ dV / (n ∫ ρ u² dV)."""
        if self.system.n == 0:
            return 0.0
        coupling = 0.0
        for group, c, d in zip(self.system.groups, self.constants, self.displacement, strict=True):
            coupling += float(np.sum(c.rho * _integrate(self.radial(group, d) * d[:, :, 1], group)))
        return -2 * coupling / (self.system.n * total(self.kinetic))

    @staticmethod
    def radial(group: Group, displacement: Array) -> Array:
        """Displacement away from the axis, (elements, stations, points)."""
        if group.frame is None:
            return displacement[:, :, 0]
        t_r, t_z = (axis[..., None] for axis in group.frame)
        return np.asarray(t_r * displacement[:, :, 0] - t_z * displacement[:, :, 2])


def total(per_group: list[Array]) -> float:
    """Sum over all stations of all groups."""
    return float(sum(np.sum(values) for values in per_group))


def _integrate(at_points: Array, group: Group) -> Array:
    return np.einsum("eij,eij->ei", at_points, group.table.volume)
