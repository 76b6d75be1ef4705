"""A shell whose elements stay where they are while its thickness changes: stations as odd polynomials of h.

Displacements are polynomials in the distance ζ from the middle surface itself, not in ζ over the half thickness, so
that neither a basis function nor its strain knows the thickness: h only says how far the integral over ζ reaches,

    F(h) = ∫ f(ζ) dζ over -h/2 ... h/2,

an odd function of h for every station, which a few nodes in h² represent to rounding. The polynomials are the same as
those of the kernel; only along the meridian, where h varies, do the two discretisations differ.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shell.assembly import Group, Level, ShellPart, System, Theory, build_system
from shell.eigen import lowest_vectors
from shell.errors import ShellError
from shell.kernel import (
    StrainTable,
    displacements,
    energy_weights,
    integrate_mass,
    integrate_stiffness,
    lame,
    shell_table,
    station_mass,
    station_stiffness,
    strains,
)
from shell.meridian import Resonator
from shell.quadrature import Array, Basis, gauss, legendre

BEYOND = 4  # nodes in h² beyond what the thickness order asks for; the neglected term is about (h/2R)^(2 BEYOND)


@dataclass(frozen=True, eq=False)
class FrozenShell:
    """One chain of shell elements with fixed breaks, tabulated at a few thicknesses.

    system : unknowns, constraints and pattern, at the nominal thickness.
    nodes : the thicknesses of the tables, m.
    tables : strains at these thicknesses, the same everywhere on the meridian.
    """

    system: System
    nodes: Array
    tables: tuple[StrainTable, ...]

    @property
    def group(self) -> Group:
        """The chain's elements."""
        return self.system.groups[0]

    @property
    def position(self) -> Array:
        """Stations (elements, stations) as positions 0 ... 1 of the meridian."""
        return self.group.table.position

    @property
    def plane_stress(self) -> bool:
        """Whether this is shell theory."""
        return self.group.table.plane_stress

    @cached_property
    def matrices(self) -> tuple[Array, Array, Array]:
        """Station matrices per unit λ, G, ρ at the nodes: (nodes, elements, stations, ...)."""
        found = [(*station_stiffness(table), station_mass(table)) for table in self.tables]
        trace, shear, mass = (np.array(kind) for kind in zip(*found, strict=True))
        return trace, shear, mass

    def interpolate(self, h: Array) -> Array:
        """Weights of the nodes for thicknesses h, (nodes, *h.shape): odd polynomials, F(h) = Σ weight F(node)."""
        t, nodes = h**2, self.nodes**2
        weights = np.ones((len(nodes), *h.shape))
        for one in range(len(nodes)):
            for other in np.delete(np.arange(len(nodes)), one):
                weights[one] *= (t - nodes[other]) / (nodes[one] - nodes[other])
        return weights * h / self.nodes.reshape(-1, *[1] * h.ndim)

    def solve(self, h: Array, nu: float, accuracy: float = 1e-12) -> tuple[float, Array]:
        """The lowest ω² for E = ρ = 1 (1/m²) and its vector, with h (m) given at the stations."""
        lam, G = (float(x) for x in lame(np.array(1.0), np.array(nu), self.plane_stress))
        weights = self.interpolate(h)
        trace, shear, mass = (np.einsum("cej,cejab->ejab", weights, kind) for kind in self.matrices)
        maps, matrices = self.system._maps, self.group.matrices
        K = [
            at.restrict(k)
            for at, k in zip(maps, matrices(integrate_stiffness, lam * trace + G * shear, 0), strict=True)
        ]
        M = [at.restrict(m) for at, m in zip(maps, matrices(integrate_mass, mass, 0), strict=True)]
        vector = lowest_vectors(self.system.pattern, K, M, 1, 0.0, accuracy)
        trace, shear, mass = (np.einsum("cej,cej->", weights, kind[..., 0, 0]) for kind in self.energies(vector))
        return float((lam * trace + G * shear) / mass), vector[:, 0]

    def strain_energy(self, vectors: Array, h: Array, nu: float) -> Array:
        """Twice the strain energy of pairs of vectors (r, r), for E = 1 and thickness h at the stations."""
        lam, G = lame(np.array(1.0), np.array(nu), self.plane_stress)
        total = np.zeros((vectors.shape[1],) * 2)
        for weights, table in zip(self.interpolate(h), self.tables, strict=True):
            trace, shear, _ = self._energies(table, vectors)
            total += np.tensordot(weights, lam * trace + G * shear)
        return total

    def energies(self, vectors: Array) -> tuple[Array, Array, Array]:
        """Energies of pairs of vectors per unit λ, G, ρ at the nodes, (nodes, elements, stations, r, r)."""
        found = [self._energies(table, vectors) for table in self.tables]
        trace, shear, mass = (np.array(kind) for kind in zip(*found, strict=True))
        return trace, shear, mass

    def _energies(self, table: StrainTable, vectors: Array) -> tuple[Array, Array, Array]:
        """The same at one node, from strains: sums of squares, free of cancellation."""
        spread = [self.system.spread(vector)[0] for vector in vectors.T]
        strain = np.stack([strains(table, q) for q in spread], axis=-1)
        moved = np.stack([displacements(table, q) for q in spread], axis=-1)
        root = np.sqrt(table.volume)
        sheared = strain * np.sqrt(energy_weights(table))[:, None, None] * root[:, :, None, :, None]
        trace = strain[:, :, :3].sum(axis=2) * root[..., None]
        return _gram(trace), _gram(sheared), _gram(moved * root[:, :, None, :, None])


def freeze(resonator: Resonator, n: int, theory: Theory, level: Level, thinnest: float, thickest: float) -> FrozenShell:
    """Lay out the elements at the resonator's own thickness and tabulate them between two thicknesses (m).

    Raises
    ------
    ShellError
        Where solid parts (stem, kink, clamp) belong to the resonator: they change their form with the thickness.
    """
    system = build_system(resonator, n, theory, level)
    if len(system.groups) != 1 or not isinstance(system.groups[0].place, ShellPart):
        raise ShellError(
            "a frozen shell has no solid parts: stems, kinks and clamps of a solid change with the thickness."
        )
    group, section = system.groups[0], system.groups[0].place.section
    count = max(level.through) + BEYOND
    steps = np.cos(np.pi * (2 * np.arange(count) + 1) / (2 * count))
    nodes = np.sqrt((thickest**2 + thinnest**2) / 2 + (thickest**2 - thinnest**2) / 2 * steps)
    reference = float(np.sqrt(thinnest * thickest))
    eta = gauss(max(level.through) + 3)
    along = Basis(*group.table.along)
    tables = []
    for h in nodes:
        uniform = replace(section, thickness=np.full_like(section.r, h), thickness_slope=np.zeros_like(section.r))
        stretch = h / reference
        u, v, w = (_stretched(legendre(order, stretch * eta[0]), stretch) for order in level.through)
        tables.append(shell_table(uniform, n, (u, v, w), eta, along))
    return FrozenShell(system, nodes, tuple(tables))


def _stretched(basis: Basis, stretch: float) -> Basis:
    return Basis(basis.values, basis.slopes * stretch)


def _gram(fields: Array) -> Array:
    flat = fields.reshape(*fields.shape[:2], -1, fields.shape[-1])
    return np.asarray(np.swapaxes(flat, -1, -2) @ flat)
