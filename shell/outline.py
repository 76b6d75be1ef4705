"""The outline of a resonator's cross-section, free sides of the solver's own elements, with the displacement of a mode."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from shell.assembly import build_system, sections
from shell.blocks import SIDES, Mesh, surface_sides
from shell.cells import CellTable, Reference, tabulate_cells
from shell.elastic import Constants
from shell.errors import ShellError
from shell.kernel import StrainTable, shell_table
from shell.layout import LEVELS, Chain
from shell.quadrature import Array, nodal
from shell.resonator import Resonator
from shell.solution import Solution
from shell.system import SolidGroup, System

if TYPE_CHECKING:
    from shell.modes import Mode

INSIDE = 1 - 1e-7  # strains are taken this far inside an element, since 1/r is singular on the axis
MOST_POINTS = 240  # on one side of one element


@dataclass(frozen=True, eq=False)
class Outline:
    """One line around the material, which lies to its left as seen with r to the right and z up."""

    r: Array  # r, z: (k,) array, m, points; the last is joined to the first unless both lie on the axis
    z: Array
    position: Array  # (k,) array, place on the meridian, 0 ... 1
    # (3, k) array, amplitudes u_r, u_θ, u_z of the mode; u_r and u_z go as cos nθ, u_θ as sin nθ. Zero without a mode
    displacement: Array
    # (2, k) array, J/m³, strain-energy density, at its largest in time, for these amplitudes taken in metres: the parts
    # that go as cos² nθ and sin² nθ
    energy: Array

    @property
    def on_axis(self) -> bool:
        """Whether the line runs from axis to axis instead of around."""
        return bool(self.r[0] == 0 and self.r[-1] == 0)

    @property
    def area(self) -> float:
        """Signed area that the line encloses (with the axis), m²; positive when it runs counterclockwise."""
        r, z = np.append(self.r, self.r[0]), np.append(self.z, self.z[0])
        return float(np.sum(r[:-1] * z[1:] - r[1:] * z[:-1]) / 2)

    def take(self, points: slice | list[int]) -> "Outline":
        """Some of the points, in the order given."""
        return Outline(*(getattr(self, field.name)[..., points] for field in fields(Outline)))

    def reversed(self) -> "Outline":
        """The same line run through the other way."""
        return self.take(slice(None, None, -1))


def trace_outlines(resonator: Resonator, spacing: float, mode: "Mode | None" = None) -> tuple[Outline, ...]:
    """The outlines of a section, the outer one first, points `spacing` (m) apart; amplitudes have a largest displacement of 1."""
    solution = mode.solution if mode is not None else None
    if mode is not None and mode.resonator != resonator:
        raise ShellError("the mode was solved for another resonator than the one to be shown.")
    system = solution.system if solution else build_system(resonator, 2, LEVELS["solid"][0])
    lines = _join(list(_Sides(resonator, system, solution).all(spacing)), 1e-9 * resonator.size)
    outlines = [_thin(line, 0.02 * spacing, resonator.size) for line in lines]
    outlines.sort(key=lambda line: -abs(line.area))
    turned = [line if (line.area > 0) == (k == 0) else line.reversed() for k, line in enumerate(outlines)]
    largest = 0.0
    for u_r, u_t, u_z in (line.displacement for line in turned):
        # at θ = 0 in the meridional plane, at a quarter wave around; all at once for n = 0
        in_plane = np.hypot(u_r, u_z)
        largest = max(largest, float(np.max(np.maximum(in_plane, abs(u_t)) if system.n else np.hypot(in_plane, u_t))))
    scale = 1 / largest if largest > 0 else 1.0
    return tuple(replace(one, displacement=one.displacement * scale, energy=one.energy * scale**2) for one in turned)


@dataclass(frozen=True, eq=False)
class _Sides:
    """The free sides of all elements of a system, each sampled with its fields."""

    resonator: Resonator
    system: System
    solution: Solution | None

    def all(self, spacing: float) -> Iterator[Outline]:
        for number, group in enumerate(self.system.groups):
            if isinstance(group, SolidGroup):
                for cell, side in surface_sides(group.mesh, group.boundary):
                    yield self._solid_side(number, group.mesh, cell, side, spacing)
            else:
                for element in range(len(group.chain.segments)):
                    yield from self._shell_sides(number, group.chain, element, spacing)

    def _shell_sides(self, number: int, chain: Chain, element: int, spacing: float) -> Iterator[Outline]:
        length = chain.breaks[element + 1] - chain.breaks[element]
        thickness = float(self.resonator.at([chain.breaks[element]], chain.segments[element]).thickness[0])
        along, across = _points(1.3 * length, spacing), _points(thickness, spacing)
        for face in (-1.0, 1.0):
            yield self._shell_side(number, chain, element, along, np.array([face]))
        ends = ((0, 0, -1.0), (len(chain.segments) - 1, 1, 1.0))
        for last, side, xi in ends:
            if element == last and chain.ends[side] in ("free", "clamped"):
                yield self._shell_side(number, chain, element, np.array([xi]), across)

    def _shell_side(self, number: int, chain: Chain, element: int, xi: Array, eta: Array) -> Outline:
        one = chain.element(element)
        place = self.resonator.at(sum(one.breaks) / 2 + (one.breaks[1] - one.breaks[0]) / 2 * xi, one.segments[0])
        r, z = (one.ravel() for one in place.at_heights(eta))
        position = np.repeat(place.position, len(eta))
        if self.solution is None:
            return _bare(r, z, position)
        level = self.system.level
        section = sections(self.resonator, one, xi * INSIDE, np.ones_like(xi))
        points = eta * INSIDE, np.ones_like(eta)
        table = shell_table(section, self.system.n, level.through, points, nodal(level.along, xi * INSIDE))
        t_r, t_z = section.tangent_r[0][:, None], section.tangent_z[0][:, None]
        (along, around, normal), energy = _fields(self.solution, table, number, element)
        displacement = np.stack([t_r * along - t_z * normal, around, t_z * along + t_r * normal])
        return Outline(r, z, position, displacement.reshape(3, -1), energy.reshape(2, -1))

    def _solid_side(self, number: int, mesh: Mesh, cell: int, side: int, spacing: float) -> Outline:
        corners = mesh.points[:, mesh.vertices[cell, list(SIDES[side])]]
        run = _points(1.3 * float(np.hypot(*(corners[:, 0] - corners[:, 1]))), spacing)
        fixed = np.array([-1.0 if side in (0, 2) else 1.0])
        xi, eta = (run, fixed) if side < 2 else (fixed, run)
        degree, grid = self.system.level.block, mesh.grid[:, [cell]]
        r, z = mesh.place(xi, eta, [cell]).reshape(2, -1)
        where = self.system.groups[number].table.position[cell, 0]
        if self.solution is None:
            return _bare(r, z, np.full(r.shape, where))
        weights = np.ones((len(xi), len(eta)))
        place = Reference.at(xi * INSIDE, eta * INSIDE, weights, degree, degree)
        table = tabulate_cells(grid, place, self.system.n, where)
        displacement, energy = _fields(self.solution, table, number, cell)
        return Outline(r, z, np.full(r.shape, where), displacement.reshape(3, -1), energy.reshape(2, -1))


def _fields(solution: Solution, table: StrainTable | CellTable, number: int, element: int) -> tuple[Array, Array]:
    """Displacement (3, stations, points) and the two parts of the energy density (2, stations, points)."""
    unknowns = solution.unknowns[number][[element]]
    c = solution.constants[number].at([element])
    E, nu, rho = (np.mean(field, keepdims=True) for field in (c.E, c.nu, c.rho))
    mean = Constants(E, nu, rho, c.plane_stress)
    by_cosine, by_sine = mean.parts(table, table.strains(unknowns))
    return np.moveaxis(table.displacements(unknowns)[0], 1, 0), np.stack([by_cosine[0], by_sine[0]]) / 2


def _points(length: float, spacing: float) -> Array:
    return np.linspace(-1.0, 1.0, 1 + int(np.clip(np.ceil(length / spacing), 2, MOST_POINTS)))


def _bare(r: Array, z: Array, position: Array) -> Outline:
    return Outline(r, z, position, np.zeros((3, len(r))), np.zeros((2, len(r))))


def _join(sides: list[Outline], margin: float) -> list[Outline]:
    """Put the sides end to end: first the lines that start on the axis, then the ones that run around."""
    lines = []
    while sides:
        first = next((k for k, side in enumerate(sides) if min(side.r[0], side.r[-1]) < margin), 0)
        line = sides.pop(first)
        if line.r[-1] < margin and line.r[0] >= margin:
            line = line.reversed()
        while sides:
            # the nearest end, not any within the margin: sides at a sharp corner are very short
            ends = [
                (np.hypot(side.r[k] - line.r[-1], side.z[k] - line.z[-1]), j, k)
                for j, side in enumerate(sides)
                for k in (0, -1)
            ]
            gap, j, k = min(ends)
            if gap > margin:
                break
            more = sides.pop(j) if k == 0 else sides.pop(j).reversed()
            pairs = ((getattr(line, field.name), getattr(more, field.name)) for field in fields(Outline))
            line = Outline(*(np.concatenate([one, two[..., 1:]], axis=-1) for one, two in pairs))
        closed = np.hypot(line.r[0] - line.r[-1], line.z[0] - line.z[-1]) < margin
        if not closed and max(line.r[0], line.r[-1]) >= margin:
            raise ShellError("the outline of the section has a gap: solid parts do not meet the shell.")
        lines.append(line)
    return lines


def _thin(line: Outline, least: float, size: float) -> Outline:
    """Put points on the axis exactly there; drop points nearer than `least` to the one before, and a repeated last one."""
    r = np.where(line.r < 1e-7 * size, 0.0, line.r)
    kept = [0]
    last = len(r) - 1
    for k in range(1, last):
        if np.hypot(r[k] - r[kept[-1]], line.z[k] - line.z[kept[-1]]) > least:
            kept.append(k)
    if np.hypot(r[last] - r[kept[-1]], line.z[last] - line.z[kept[-1]]) <= least and len(kept) > 1:
        kept.pop()
    if r[0] == 0 and r[last] == 0:
        kept.append(last)
    return replace(line, r=r).take(kept)
