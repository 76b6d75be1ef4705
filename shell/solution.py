"""Results from one eigenvector: strain and kinetic energy, precession, and their distribution along the meridian."""

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from shell.elastic import Constants
from shell.kernel import StrainTable, energy_weights, lame, lame_slopes, shell_table
from shell.quadrature import Array, Basis
from shell.system import Group, ShellGroup, System


@dataclass(frozen=True)
class EnergyFractions:
    """Shares of the strain energy; they add up to 1."""

    # bending, membrane, shear: of the shell: strains that vary through the thickness, their mean, transverse shear
    bending: float
    membrane: float
    shear: float
    root: float  # of the solid cap, root or corner
    stem: float  # of the stem
    kinetic_stem: float  # the stem's share of the kinetic energy (counted apart)


@dataclass(frozen=True, eq=False)
class AlongMeridian:
    """What each place of the meridian contributes to d ln f: arrays over stations, sorted by position.

    For fields along the meridian, to first order,

        d ln f = ½ Σ elastic d ln E - ½ Σ kinetic d ln ρ + Σ nu dν + Σ thickness d ln h,

    each taken at `position` (0 ... 1 of the arc length). `elastic` and `kinetic` add up to 1; divided by `width`, the
    station's share of the arc length, they are densities. A solid root is one station of width 0 where it joins the shell.
    `thickness` is that of the shell alone.
    """

    position: Array
    width: Array
    elastic: Array
    kinetic: Array
    nu: Array
    thickness: Array


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
        return [group.table.strains(q) for group, q in zip(self.system.groups, self.unknowns, strict=True)]

    @cached_property
    def displacement(self) -> list[Array]:
        """Displacements (elements, stations, 3, points) of every group, in its own axes."""
        return [group.table.displacements(q) for group, q in zip(self.system.groups, self.unknowns, strict=True)]

    @cached_property
    def stress(self) -> list[Array]:
        """Stresses (elements, stations, 6, points) of every group, Pa."""
        return [c.stress(g.table, e) for c, g, e in zip(self.constants, self.system.groups, self.strain, strict=True)]

    @cached_property
    def force(self) -> list[Array]:
        """Inertial forces ω² ρ u (elements, stations, 3, points) of every group, N/m³."""
        return [
            self.eigenvalue * c.rho[..., None, None] * d for c, d in zip(self.constants, self.displacement, strict=True)
        ]

    @cached_property
    def squares(self) -> list[tuple[Array, Array]]:
        """∫ (ε_1 + ε_2 + ε_3)² and ∫ Σ g_c ε_c² over the points of every station: what λ and G multiply."""
        return [
            (
                _integrate(np.add.reduce(e[:, :, :3], axis=2) ** 2, group),
                _integrate(energy_weights(group.table.transverse_shear) @ (e * e), group),
            )
            for group, e in zip(self.system.groups, self.strain, strict=True)
        ]

    @cached_property
    def elastic(self) -> list[Array]:
        """Twice the strain energy of every station, a sum of squares and so free of cancellation."""
        return [c.lame[0] * t + c.lame[1] * shear for c, (t, shear) in zip(self.constants, self.squares, strict=True)]

    @cached_property
    def kinetic(self) -> list[Array]:
        """Twice the kinetic energy of every station over ω²."""
        return [
            c.rho * _integrate(np.add.reduce(d * d, axis=2), group)
            for group, c, d in zip(self.system.groups, self.constants, self.displacement, strict=True)
        ]

    @cached_property
    def eigenvalue(self) -> float:
        """ω² = Σ elastic / Σ kinetic, the Rayleigh quotient from strains at quadrature points."""
        return total(self.elastic) / total(self.kinetic)

    @cached_property
    def mass(self) -> float:
        """∫ ρ |u|² dV of the eigenvector as it is scaled, kg m²."""
        return total(self.kinetic) * pi * (2 if self.system.n == 0 else 1)

    @cached_property
    def bryan_factor(self) -> float:
        """Angle by which the standing wave precesses per angle of rotation: -2 ∫ ρ u_r u_θ dV / (n ∫ ρ u² dV)."""
        if self.system.n == 0:
            return 0.0
        coupling = 0.0
        for group, c, d in zip(self.system.groups, self.constants, self.displacement, strict=True):
            coupling += float(np.sum(c.rho * _integrate(radial(group, d) * d[:, :, 1], group)))
        return -2 * coupling / (self.system.n * total(self.kinetic))

    @cached_property
    def energy_fractions(self) -> EnergyFractions:
        """How the energy divides between kinds of strain and parts."""
        found = dict.fromkeys(("bending", "membrane", "shear", "root", "stem", "kinetic_stem"), 0.0)
        for group, c, e, elastic, kinetic in zip(
            self.system.groups, self.constants, self.strain, self.elastic, self.kinetic, strict=True
        ):
            if isinstance(group, ShellGroup):
                shear = total(
                    [c.lame[1] * group.table.transverse_shear * _integrate(e[:, :, 4] ** 2 + e[:, :, 5] ** 2, group)]
                )
                # the energy of the mean in-plane strains, in plane stress
                volume = group.table.volume.sum(axis=2)
                mean = (_integrate(e[:, :, k], group) / volume for k in (0, 1, 3))
                membrane = float(np.sum(sum(plane_energies(c.E, c.nu, *mean)) * volume))
                found["shear"] += shear
                found["membrane"] += membrane
                found["bending"] += total([elastic]) - shear - membrane
            else:
                in_stem = np.array(group.parts) == "stem"
                found["stem"] += total([elastic[in_stem]])
                found["root"] += total([elastic[~in_stem]])
                found["kinetic_stem"] += total([kinetic[in_stem]]) * self.eigenvalue
        whole = total(self.elastic)
        return EnergyFractions(**{name: value / whole for name, value in found.items()})

    @cached_property
    def along(self) -> AlongMeridian:
        """Contributions of the places of the meridian to d ln f."""
        U, T = total(self.elastic), total(self.kinetic)
        rows: list[list[Array]] = []
        for k, (group, elastic, kinetic, nu) in enumerate(
            zip(self.system.groups, self.elastic, self.kinetic, self._by_nu, strict=True)
        ):
            if isinstance(group, ShellGroup):
                width = group.section.weight * group.section.ds
                thickness = sum(faces.sum(axis=2) for faces in surface_energies(self, k)) / (2 * U)
                columns = [group.table.position, width, elastic / U, kinetic / T, nu / (2 * U), thickness]
            else:
                columns = [
                    group.table.position[:1, :1],
                    np.zeros(1),
                    *(np.array([np.sum(one) / scale]) for one, scale in ((elastic, U), (kinetic, T), (nu, 2 * U))),
                    np.zeros(1),
                ]
            rows.append([np.ravel(column) for column in columns])
        table = np.concatenate([np.array(columns) for columns in rows], axis=1)
        table[1] /= table[1].sum()
        return AlongMeridian(*table[:, np.argsort(table[0], kind="stable")])

    @cached_property
    def by_nu(self) -> float:
        """D ln f / dν at constant E."""
        return total(self._by_nu) / (2 * total(self.elastic))

    @cached_property
    def _by_nu(self) -> list[Array]:
        slopes = [lame_slopes(c.E, c.nu, c.plane_stress) for c in self.constants]
        return [a * trace + b * shear for (a, b), (trace, shear) in zip(slopes, self.squares, strict=True)]


def total(per_group: list[Array]) -> float:
    """Sum over all stations of all groups."""
    return float(sum(np.sum(values) for values in per_group))


def _integrate(at_points: Array, group: Group) -> Array:
    return np.asarray(np.add.reduce(at_points * group.table.volume, axis=-1))


def radial(group: Group, displacement: Array) -> Array:
    """Displacement away from the axis, (elements, stations, points)."""
    return np.asarray(sum(group.axes[0, k] * displacement[:, :, 2 * k] for k in (0, 1)))


def plane_energies(E: Array, nu: Array, s: Array, theta: Array, twist: Array) -> tuple[Array, Array]:
    """Twice the energy density of plane stress, of what varies as cos nθ and of the twist, which varies as sin nθ."""
    lam, G = lame(E, nu, True)
    return np.asarray(lam * (s + theta) ** 2 + 2 * G * (s**2 + theta**2)), np.asarray(G * twist**2)


def surface_energies(solution: Solution, number: int) -> tuple[Array, Array]:
    """Change of (elastic - ω² kinetic) as the faces of one shell group move outwards by h/2, (elements, stations, 2) each.

    The energies at the faces (Hadamard's formula), η = -1 and 1: first of what varies as cos nθ, then as sin nθ. Of a
    solid the faces are free of traction, so their strain energy is that of plane stress; Naghdi's transverse shear does
    not vanish there and counts.
    """
    c, table = solution.constants[number], face_table(solution, number)
    e, d = (find(solution.unknowns[number]) for find in (table.strains, table.displacements))
    cosine, sine = plane_energies(c.E[..., None], c.nu[..., None], e[:, :, 0], e[:, :, 1], e[:, :, 3])
    if table.plane_stress:
        transverse = c.lame[1][..., None] * table.transverse_shear
        cosine, sine = cosine + transverse * e[:, :, 4] ** 2, sine + transverse * e[:, :, 5] ** 2
    heavy = solution.eigenvalue * c.rho[..., None]
    along, around = squares_of(d)
    return (cosine - heavy * along) * table.volume, (sine - heavy * around) * table.volume


def face_table(solution: Solution, number: int) -> StrainTable:
    """Strains of one shell group at its faces η = -1 and 1, at the stations; the volumes are h/2 times the areas."""
    system, group = solution.system, solution.system.chains[number]
    faces = np.array([-1.0, 1.0]), np.ones(2)
    return shell_table(group.section, system.n, system.level.through, faces, Basis(*group.table.along))


def squares_of(displacement: Array) -> tuple[Array, Array]:
    """|u|² of displacements (elements, stations, 3, points), of what varies as cos nθ and of what varies as sin nθ."""
    u, v, w = np.moveaxis(displacement, 2, 0)
    return u**2 + w**2, v**2
