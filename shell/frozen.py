"""Shells whose elements stay where they are while their thickness changes: stations as odd polynomials of h.

Displacements are polynomials in the distance ζ from the middle surface itself, not in ζ over the half thickness, so
that neither a basis function nor its strain knows the thickness: h only says how far the integral over ζ reaches,

    F(h) = ∫ f(ζ) dζ over -h/2 ... h/2,

an odd function of h for every station, which a few nodes in h² represent to rounding. The polynomials are the same as
those of the kernel; only along the meridian, where h varies, do the two discretisations differ.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from shell.assembly import build_system, lay_resonator
from shell.condensed import Part, arrange, find_parts
from shell.constraints import Index
from shell.eigen import ElementMass, Pattern, find_pattern, lowest_vectors
from shell.kernel import (
    Section,
    StrainTable,
    energy_weights,
    integrate_mass,
    integrate_stiffness,
    lame,
    shell_table,
    station_mass,
    station_stiffness,
)
from shell.levels import Level, Theory
from shell.quadrature import Array, Basis, gauss, legendre
from shell.resonator import Resonator
from shell.system import Pair, ShellGroup, System

BEYOND = 4  # nodes in h² beyond what the thickness order asks for; the neglected term is about (h/2R)^(2 BEYOND)


@dataclass(frozen=True, eq=False)
class FrozenShell:
    """Chains of shell elements with fixed breaks, tabulated at a few thicknesses, and the solid parts between them.

    system : unknowns, constraints and pattern of the chains alone, at the nominal thickness.
    reference : thickness that the unknowns of each element refer to, m, (elements, 1); one for each chain.
    nodes : the thicknesses of the tables over the reference.
    tables : strains at these thicknesses, the same everywhere on a chain.
    parts : the solid parts, which hold some of the unknowns.
    """

    system: System
    reference: Array
    nodes: Array
    tables: tuple[StrainTable, ...]
    parts: tuple[Part, ...]

    @property
    def position(self) -> Array:
        """Stations (elements, stations) as positions 0 ... 1 of the meridian."""
        return self.tables[0].position

    @property
    def plane_stress(self) -> bool:
        """Whether this is shell theory."""
        return self.tables[0].plane_stress

    @cached_property
    def matrices(self) -> tuple[Array, Array, Array]:
        """Station matrices per unit λ, G, ρ at the nodes: (nodes, elements, stations, ...)."""
        found = [(*station_stiffness(table), station_mass(table)) for table in self.tables]
        trace, shear, mass = (np.array(kind) for kind in zip(*found, strict=True))
        return trace, shear, mass

    @cached_property
    def pattern(self) -> Pattern:
        """The unknowns of the elements, then of the solid parts."""
        unknowns = [*self.system.pattern.unknowns, *(part.columns for part in self.parts)]
        return find_pattern(unknowns, self.system.pattern.size)

    def interpolate(self, h: Array) -> Array:
        """Weights of the nodes for thicknesses h, (nodes, *h.shape): odd polynomials, F(h) = Σ weight F(node)."""
        relative = h / self.reference
        t, nodes = relative**2, self.nodes**2
        weights = np.ones((len(nodes), *h.shape))
        for one in range(len(nodes)):
            for other in np.delete(np.arange(len(nodes)), one):
                weights[one] *= (t - nodes[other]) / (nodes[one] - nodes[other])
        return weights * relative / self.nodes.reshape(-1, *[1] * h.ndim)

    def solve(self, h: Array, nu: float, solids: Sequence[Pair] = (), accuracy: float = 1e-12) -> tuple[float, Array]:
        """The lowest ω² for E = ρ = 1 (1/m²) and its vector.

        Parameters
        ----------
        h : at the stations, m.
        nu : Poisson's ratio.
        solids : K per unit G and M per unit density of the solid parts on their unknowns.
        accuracy : relative, at which the iteration stops.
        """
        lam, G = (float(x) for x in lame(np.array(1.0), np.array(nu), self.plane_stress))
        weights = self.interpolate(h)
        trace, shear, mass = (np.einsum("cej,cejab->ejab", weights, kind) for kind in self.matrices)
        K = self._restrict(integrate_stiffness, lam * trace + G * shear) + [G * stiff for stiff, _ in solids]
        M = self._restrict(integrate_mass, mass) + [heavy for _, heavy in solids]
        K, M = arrange(self.pattern, K), arrange(self.pattern, M)
        vector = lowest_vectors(self.pattern, K, ElementMass(self.pattern, M), 1, accuracy)
        trace, shear, mass = (np.einsum("cej,cej->", weights, kind[..., 0, 0]) for kind in self.energies(vector))
        stiffness, inertia = lam * trace + G * shear, mass
        for part, (stiff, heavy) in zip(self.parts, solids, strict=True):
            held = vector[part.columns, 0]
            stiffness, inertia = stiffness + G * held @ stiff @ held, inertia + held @ heavy @ held
        return float(stiffness / inertia), vector[:, 0]

    def _restrict(self, integrate: Callable[[Array, Array], Array], stations: Array) -> list[Array]:
        """Element matrices on free unknowns from matrices at the stations of all chains."""
        found: list[Array] = []
        done = 0
        for group in self.system.groups:
            assert isinstance(group, ShellGroup)
            found += list(group.matrices(integrate, stations[done : done + len(group.unknowns)], 0))
            done += len(group.unknowns)
        return [at.restrict(matrix) for at, matrix in zip(self.system.maps, found, strict=True)]

    def strain_energy(self, vectors: Array, h: Array, nu: float, solids: Sequence[Pair] = ()) -> Array:
        """Twice the strain energy of pairs of vectors (r, r), for E = 1 and thickness h at the stations."""
        lam, G = lame(np.array(1.0), np.array(nu), self.plane_stress)
        total = np.zeros((vectors.shape[1],) * 2)
        for weights, table in zip(self.interpolate(h), self.tables, strict=True):
            trace, shear, _ = self._energies(table, vectors)
            total += np.tensordot(weights, lam * trace + G * shear)
        for part, (stiff, _) in zip(self.parts, solids, strict=True):
            total += G * vectors[part.columns].T @ stiff @ vectors[part.columns]
        return total

    def energies(self, vectors: Array) -> tuple[Array, Array, Array]:
        """Energies of pairs of vectors per unit λ, G, ρ at the nodes, (nodes, elements, stations, r, r)."""
        found = [self._energies(table, vectors) for table in self.tables]
        trace, shear, mass = (np.array(kind) for kind in zip(*found, strict=True))
        return trace, shear, mass

    def _energies(self, table: StrainTable, vectors: Array) -> tuple[Array, Array, Array]:
        """The same at one node, from strains: sums of squares, free of cancellation."""
        spread = [np.concatenate(self.system.spread(vector)) for vector in vectors.T]
        strain = np.stack([table.strains(q) for q in spread], axis=-1)
        moved = np.stack([table.displacements(q) for q in spread], axis=-1)
        root = np.sqrt(table.volume)
        sheared = strain * np.sqrt(energy_weights(table.transverse_shear))[:, None, None] * root[:, :, None, :, None]
        trace = strain[:, :, :3].sum(axis=2) * root[..., None]
        return _gram(trace), _gram(sheared), _gram(moved * root[:, :, None, :, None])


def freeze(
    resonator: Resonator, n: int, theory: Theory, level: Level, bounds: Callable[[Array], tuple[Array, Array]]
) -> FrozenShell:
    """Lay out the elements at the resonator's own thickness and tabulate them between two thicknesses.

    Parameters
    ----------
    resonator, n, theory, level : as for `build_system`.
    bounds : the thinnest and the thickest (m) at positions of the meridian.
    """
    full = build_system(resonator, n, theory, level)
    groups = tuple(group for group in full.groups if isinstance(group, ShellGroup))
    limits = [bounds(group.table.position) for group in groups]
    ends = [(float(np.min(thin)), float(np.max(thick))) for thin, thick in limits]
    references = [float(np.sqrt(thin * thick)) for thin, thick in ends]
    most = max(thick / thin for thin, thick in ends)  # over the square of the reference
    count = max(level.through) + BEYOND
    steps = np.cos(np.pi * (2 * np.arange(count) + 1) / (2 * count))
    nodes = np.sqrt((most + 1 / most) / 2 + (most - 1 / most) / 2 * steps)
    reference = np.concatenate([np.full((len(g.unknowns), 1), h) for g, h in zip(groups, references, strict=True)])
    eta = gauss(max(level.through) + 3)
    along = Basis(*groups[0].table.along)
    section = _join([group.place.section for group in groups])
    tables = []
    for stretch in nodes:
        h = np.broadcast_to(stretch * reference, section.r.shape)
        uniform = replace(section, thickness=h, thickness_slope=np.zeros_like(section.r))
        u, v, w = (_stretched(legendre(order, stretch * eta[0]), stretch) for order in level.through)
        tables.append(shell_table(uniform, n, (u, v, w), eta, along))
    system = _chains_alone(full, groups)
    width = sum(level.through) + 3

    def edge(chain: int, side: int) -> Index:
        unknowns = groups[chain].unknowns
        members = unknowns[0, :width] if side == 0 else unknowns[-1, -width:]
        return np.asarray(system.constraint[members].indices, dtype=np.intp)

    parts = find_parts(lay_resonator(resonator, n, level), level.through, references, edge)
    return FrozenShell(system, reference, nodes, tuple(tables), parts)


def _chains_alone(full: System, groups: tuple[ShellGroup, ...]) -> System:
    """The system without its solid parts, whose unknowns come last."""
    rows = full.constraint[: 1 + max(int(group.unknowns.max()) for group in groups)]
    return System(groups, rows[:, np.unique(rows.indices)], full.rigid_motions, full.n, full.level)


def _join(sections: list[Section]) -> Section:
    return Section(*(np.concatenate([getattr(one, field.name) for one in sections]) for field in fields(Section)))


def _stretched(basis: Basis, stretch: float) -> Basis:
    return Basis(basis.values, basis.slopes * stretch)


def _gram(fields: Array) -> Array:
    flat = fields.reshape(*fields.shape[:2], -1, fields.shape[-1])
    return np.asarray(np.swapaxes(flat, -1, -2) @ flat)
