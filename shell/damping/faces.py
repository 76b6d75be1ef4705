"""A mode at the free surfaces of its body: strains, stresses and motion of faces, edges and root; areas, as volumes, are per π."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from shell.blocks import surface_sides
from shell.cells import CellTable, Reference, tabulate_cells
from shell.cross_section import free_edge
from shell.elastic import Constants
from shell.errors import ShellError
from shell.kernel import StrainTable
from shell.material import Material
from shell.quadrature import Array, gauss
from shell.resonator import Resonator
from shell.solution import Solution, face_table, plane_energies, total
from shell.system import ShellGroup, SolidGroup

Kind = Literal["inner", "outer", "edge", "root"]
SIDES = ((None, -1.0), (None, 1.0), (-1.0, None), (1.0, None))  # (ξ, η) held on the sides of a cell, as in shell.blocks


@dataclass(frozen=True, eq=False)
class FreeFaces:
    """The motion of a mode on a free surface: arrays over quadrature points."""

    kind: Kind  # inner or outer face of the shell, its free edges, the surface of roots, corners and stem
    position: Array  # of the meridian, 0 ... 1, (points,)
    area: Array  # dA/π, m², (points,)
    # ε_1, ε_2, ε_3, γ_12, γ_13, γ_23, (6, points); on faces 1, 2, 3 are meridian, circumference and normal
    strain: Array
    energy: Array  # σ : ε, twice the strain energy density, J/m³, (points,)
    moved: Array  # displacement along 1, 2, 3, m, (3, points)
    E: Array  # E, nu: of the material there, Pa and 1, (points,)
    nu: Array

    @property
    def stretch(self) -> Array:
        """ε_s + ε_θ, what heats a film on the face, (points,)."""
        return np.asarray(self.strain[0] + self.strain[1])

    def integrate(self, density: Array) -> float:
        """∫ density dA / π."""
        return float(np.sum(density * self.area))

    def mean_stress(self, first: float, last: float) -> tuple[float, float]:
        """σ_φφ and σ_θθ of a face, Pa, E/(1 − ν²) (ε_φ + ν ε_θ) and its like, means by area between two positions."""
        area = np.where((self.position >= first) & (self.position <= last), self.area, 0.0)
        if not area.any():
            raise ShellError(f"no part of the shell lies between the positions {first:g} and {last:g}.")
        stiff, (along, around) = area / area.sum() * self.E / (1 - self.nu**2), self.strain[:2]
        return float(stiff @ (along + self.nu * around)), float(stiff @ (around + self.nu * along))


@dataclass(frozen=True, eq=False)
class Vibration:
    """A solved mode with its material at `reference` (K): over temperature its shape stays and ω follows √(E/ρ)."""

    solution: Solution
    resonator: Resonator
    material: Material
    reference: float

    @cached_property
    def faces(self) -> tuple[FreeFaces, FreeFaces]:
        """Inner and outer face."""
        return shell_faces(self.solution, self.resonator)

    @cached_property
    def surfaces(self) -> tuple[FreeFaces, ...]:
        """All free surfaces."""
        return free_surfaces(self.solution, self.resonator)

    @cached_property
    def strain_energy(self) -> float:
        """∫ σ : ε dV / π, J."""
        return total(self.solution.elastic)

    @cached_property
    def kinetic(self) -> float:
        """∫ ρ |u|² dV / π, kg m²."""
        return total(self.solution.kinetic)

    @property
    def thinnest(self) -> float:
        """Least thickness of the wall, m."""
        return min(value for _, value in self.resonator.thickness)

    def omega(self, temperature: ArrayLike) -> Array:
        """ω (rad/s) at temperatures (K)."""
        now, then = (
            self.material.value("youngs_modulus", T) / self.material.value("density", T)
            for T in (np.asarray(temperature, dtype=float), np.asarray(self.reference))
        )
        return np.asarray(np.sqrt(self.solution.eigenvalue * now / then))


def shell_faces(solution: Solution, resonator: Resonator) -> tuple[FreeFaces, FreeFaces]:
    """The inner and the outer face of the shell, without roots and corners; free of traction, so in plane stress."""
    found: tuple[list[tuple[Array, ...]], list[tuple[Array, ...]]] = ([], [])
    for number, group in solution.system.chains.items():
        c, q = solution.constants[number], solution.unknowns[number]
        section, table = group.section, face_table(solution, number)
        strain, moved = table.strains(q), table.displacements(q)
        area = table.volume * (2 / section.thickness)[..., None]
        for k in (0, 1):
            cosine, sine = plane_energies(c.E, c.nu, *(strain[:, :, row, k] for row in (0, 1, 3)))
            places = section.position.ravel(), area[..., k].ravel()
            energy, fields = (cosine + sine).ravel(), (_points(strain[..., k]), _points(moved[..., k]))
            found[k].append((*places, fields[0], energy, fields[1], c.E.ravel(), c.nu.ravel()))
    inner, outer = ([np.concatenate(c, axis=-1) for c in zip(*one, strict=True)] for one in found[:: resonator.outward])
    return FreeFaces("inner", *inner), FreeFaces("outer", *outer)


def free_surfaces(solution: Solution, resonator: Resonator) -> tuple[FreeFaces, ...]:
    """Every free surface: both faces, free edges, and the open sides of roots, corners and stem."""
    found: list[FreeFaces] = [*shell_faces(solution, resonator)]
    for group, c, q in zip(solution.system.groups, solution.constants, solution.unknowns, strict=True):
        if isinstance(group, ShellGroup):
            found += [_edge(solution, resonator, group, c, q, end) for end in (0, 1) if group.chain.ends[end] == "free"]
        else:
            found += _sides(solution, group, c, q)
    return tuple(found)


def _edge(solution: Solution, resonator: Resonator, group: ShellGroup, c: Constants, q: Array, end: int) -> FreeFaces:
    """The face across the thickness where the shell ends."""
    edge, area = free_edge(resonator, solution.system, group.chain.breaks[-end] / resonator.length)
    area = area / (1 + edge.section.curvature[0, 0] * edge.section.thickness[0, 0] / 2 * gauss(len(area))[0])
    return _surface("edge", edge.table, c.at(([[-end]], [[-end]])), q[[edge.element]], area[None, None])


def _sides(solution: Solution, group: SolidGroup, c: Constants, q: Array) -> list[FreeFaces]:
    """The open sides of solid cells, without what is held."""
    mesh, boundary = group.mesh, group.boundary
    degree = mesh.grid.shape[2] - 1
    points, weights = gauss(degree + 2)
    held = mesh.between(boundary.held)
    open_sides = [(cell, side) for cell, side in surface_sides(mesh, boundary) if not held[mesh.edges[cell, side]]]
    found = []
    for side, (xi, eta) in enumerate(SIDES):
        cells = [cell for cell, one in open_sides if one == side]
        if not cells:
            continue
        place = Reference.at(
            points if xi is None else np.array([xi]), points if eta is None else np.array([eta]), weights,
            degree, degree,
        )  # fmt: skip
        table = tabulate_cells(mesh.grid[:, cells], place, solution.system.n, float(group.table.position[0, 0]))
        along = place.along.slopes if xi is None else place.along.values
        across = place.across.slopes if eta is None else place.across.values
        r, z = ((along @ x[cells] @ across.T).reshape(len(cells), -1) for x in mesh.grid)
        area = (np.hypot(r, z) * table.radius * weights)[:, None]
        found.append(_surface("root", table, c.at(cells), q[cells], area))
    return found


def _surface(kind: Kind, table: StrainTable | CellTable, c: Constants, q: Array, area: Array) -> FreeFaces:
    strain, moved = table.strains(q), table.displacements(q)
    stress = c.stress(table, strain)
    E, nu = (np.broadcast_to(field[..., None], area.shape).ravel() for field in (c.E, c.nu))
    position = np.broadcast_to(table.position[..., None], area.shape).ravel()
    energy = np.sum(stress * strain, axis=2).ravel()
    return FreeFaces(kind, position, area.ravel(), _points(strain), energy, _points(moved), E, nu)


def _points(field: Array) -> Array:
    """(elements, stations, k) or (elements, stations, k, points) to (k, all points)."""
    return np.moveaxis(field, 2, 0).reshape(field.shape[2], -1)
