"""An imperfect resonator as quadrature in the wall, on the edge of the rim and at masses; forms of vectors on it."""

from collections.abc import Callable
from math import pi
from typing import TypeAlias

import numpy as np

from shell.cells import CellTable
from shell.imperfection.core import Core
from shell.imperfection.field import values_around
from shell.imperfection.imperfect import Imperfection
from shell.imperfection.place import CrossSection, cut, fade
from shell.imperfection.wall import Part, Wall, deform
from shell.quadrature import Array, gauss
from shell.resonator import Resonator
from shell.solution import Constants
from shell.system import ShellGroup, SolidGroup, System

Vector: TypeAlias = tuple[Part, Array]


class Body:
    """The imperfect wall: quadrature in the volume, on the edge of the rim and at masses."""

    def __init__(
        self,
        systems: Callable[[int], System],
        constants: tuple[Constants, ...],
        resonator: Resonator,
        flaw: Imperfection,
        waves: tuple[int, ...],
        theta: Array,
        n: int,
    ) -> None:
        self.systems, self.constants, self.resonator, self.theta = systems, constants, resonator, theta
        self.own = system = systems(n)
        self._cuts: dict[tuple[int, float, float], CrossSection] = {}
        orders = system.level.through
        eta = gauss(max(orders) + 2)
        faces = flaw.faces(fade(resonator, system))
        self.walls: list[tuple[int, Wall]] = []
        self.cores: list[tuple[int, Core]] = []
        for number, (group, c) in enumerate(zip(system.groups, constants, strict=True)):
            if isinstance(group, ShellGroup):
                everywhere = slice(0, len(group.unknowns))
                wall = deform(
                    group.place.section, c, everywhere, group.table.along, eta, orders, faces, flaw.density,
                    flaw.modulus, waves, theta, group.table.transverse_shear,
                )  # fmt: skip
                self.walls.append((number, wall))
            else:
                x = group.table.position[:1, 0]
                stiff, heavy = (
                    np.ones(theta.size) if field is None else 1 + values_around(field, waves, x, theta)[0][0]
                    for field in (flaw.modulus, flaw.density)
                )
                self.cores.append((number, Core(self._table(number), c, stiff, heavy, theta)))
        if flaw.rim is not None:
            edge = cut(resonator, system, 1.0, eta[0])
            width = values_around(flaw.rim, flaw.rim.orders, np.ones(1), theta)[0][0]
            c = constants[edge.group]
            here = slice(edge.element, edge.element + 1)
            last = Constants(c.E[here, -1:], c.nu[here, -1:], c.rho[here, -1:], c.plane_stress)
            wall = deform(
                edge.section, last, here, edge.along[:, None], eta, orders, (None, None), None, None, (), theta,
                edge.table.transverse_shear, width,
            )  # fmt: skip
            self.walls.append((edge.group, wall))
        self.masses: list[tuple[float, float, Array, Array]] = [
            (m.position, m.height, np.array([m.azimuth]), np.array([m.mass])) for m in flaw.masses
        ]
        for line in flaw.lines:
            place = resonator.at([line.position * resonator.length])
            radius = float((place.r + line.height * place.thickness / 2 * place.normal_r)[0])
            density = values_around(line.per_length, line.per_length.orders, np.array([line.position]), theta)[0][0]
            self.masses.append((line.position, line.height, theta, density * radius * 2 * pi / theta.size))

    def _table(self, number: int) -> Callable[[int], CellTable]:
        def table(harmonic: int) -> CellTable:
            group = self.systems(harmonic).groups[number]
            assert isinstance(group, SolidGroup)
            return group.table

        return table

    def cut(self, harmonic: int, position: float, height: float) -> CrossSection:
        """A place of the wall at one harmonic."""
        key = (harmonic, position, height)
        if key not in self._cuts:
            self._cuts[key] = cut(self.resonator, self.systems(harmonic), position, np.array([height]))
        return self._cuts[key]


class Forms:
    """K and M of the imperfect body in a growing basis, and the forces that it leaves."""

    def __init__(self, body: Body, value: float) -> None:
        self.body, self.value = body, value
        self.vectors: list[Vector] = []
        self.strains = self.moves = np.zeros((0, 0))
        self.shapes: tuple[list[tuple[int, ...]], list[tuple[int, ...]]] = ([], [])
        self.K = self.M = np.zeros((0, 0))
        self.size = 0.0

    def extend(self, fresh: list[Vector]) -> None:
        """Add vectors to the basis."""
        before = len(self.vectors)
        rows: list[list[Array]] = [[], [], [], []]
        for part, vector in fresh:
            strains, moves = self._fields(part, vector)
            self.shapes = ([e.shape for e in strains], [d.shape for d in moves])
            for row, pieces in zip(rows, (strains, moves, *self._duals(strains, moves)), strict=True):
                row.append(np.concatenate([piece.ravel() for piece in pieces]))
            self.vectors.append((part, vector))
        strain, move, stress, inertia = (np.array(row) for row in rows)
        self.strains = np.concatenate([self.strains.reshape(-1, strain.shape[1]), strain])
        self.moves = np.concatenate([self.moves.reshape(-1, move.shape[1]), move])
        K, M = self.strains @ stress.T, self.moves @ inertia.T
        for number, core in self.body.cores:
            spread = [(part, self.body.systems(part.harmonic).spread(vector)[number]) for part, vector in fresh]
            more = core.extend(spread)
            K, M = K + more[0], M + more[1]
        self.K, self.M = _bordered(self.K, K, before), _bordered(self.M, M, before)

    def _fields(self, part: Part, vector: Array) -> tuple[list[Array], list[Array]]:
        """Strains of walls; displacements of walls and masses."""
        body = self.body
        system = body.systems(part.harmonic)
        unknowns = system.spread(vector)
        strains, moves = [], []
        for number, wall in body.walls:
            strain, move = wall.move(wall.jets(unknowns[number]), part)
            strains.append(strain)
            moves.append(move)
        for position, height, theta, _ in body.masses:
            u = body.cut(part.harmonic, position, height).displacements(unknowns)[:, 0]
            one, other = part.around(theta)
            moves.append(np.stack([u[0] * one, u[1] * other, u[2] * one]))
        return strains, moves

    def _duals(self, strains: list[Array], moves: list[Array]) -> tuple[list[Array], list[Array]]:
        """Stresses and momenta, with their volumes."""
        body = self.body
        stress = [wall.stress(e) for (_, wall), e in zip(body.walls, strains, strict=False)]
        inertia = [wall.rho * wall.volume * d for (_, wall), d in zip(body.walls, moves, strict=False)]
        masses = moves[len(body.walls) :]
        inertia += [m * d for (*_, m), d in zip(body.masses, masses, strict=True)]
        return stress, inertia

    def forces(self, T: Array, parts: list[Part]) -> list[Array]:
        """(K - λ M) of the two folded vectors on the free unknowns of every part, (unknowns, 2) each."""
        columns: list[list[Array]] = [[] for _ in parts]
        for weights in T.T:
            strains, moves = (
                _pieces(weights @ fields, shapes)
                for fields, shapes in zip((self.strains, self.moves), self.shapes, strict=True)
            )
            stress, inertia = self._duals(strains, moves)
            force = [self.value * one for one in inertia]
            for column, load in zip(columns, self._gather(stress, force, weights, parts), strict=True):
                column.append(load)
        found = [np.stack(column, axis=1) for column in columns]
        self.size = max(self.size, max(float(np.abs(one).max()) for one in found))
        return found

    def _gather(self, stress: list[Array], force: list[Array], weights: Array, parts: list[Part]) -> list[Array]:
        body = self.body
        per_part: list[list[Array]] = []
        for part in parts:
            groups = body.systems(part.harmonic).groups
            per_part.append([np.zeros(_load_shape(group)) for group in groups])
        for (number, wall), s, f in zip(body.walls, stress, force, strict=False):
            for loads, duals in zip(per_part, wall.pull(s, f, parts), strict=True):
                loads[number] += wall.loads(duals, loads[number].shape)
        for number, core in body.cores:
            for part, loads in zip(parts, per_part, strict=True):
                loads[number] += core.loads(weights, self.value, part)
        masses = force[len(body.walls) :]
        for (position, height, theta, _), f in zip(body.masses, masses, strict=True):
            for part, loads in zip(parts, per_part, strict=True):
                here = body.cut(part.harmonic, position, height)
                C, S = part.around(theta)
                pull = np.array([f[0] @ C, f[1] @ S, f[2] @ C])
                amplitudes = pull @ here.table.displacement[0, 0, :, 0]
                loads[here.group][here.element] -= np.outer(here.along[0], amplitudes)
        return [body.systems(part.harmonic).gather(loads) for part, loads in zip(parts, per_part, strict=True)]


def _bordered(old: Array, columns: Array, before: int) -> Array:
    """A symmetric matrix that has grown by columns."""
    grown = np.zeros((len(columns), len(columns)))
    grown[:before, :before] = old
    grown[:, before:] = columns
    grown[before:, :before] = columns[:before].T
    grown[before:, before:] = (columns[before:] + columns[before:].T) / 2
    return grown


def _pieces(flat: Array, shapes: list[tuple[int, ...]]) -> list[Array]:
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
    return [piece.reshape(shape) for piece, shape in zip(np.split(flat, ends[:-1]), shapes, strict=True)]


def _load_shape(group: ShellGroup | SolidGroup) -> tuple[int, ...]:
    elements, size = group.unknowns.shape
    if isinstance(group, SolidGroup):
        return elements, size // 3, 3
    functions = group.table.along.shape[2]
    return elements, functions, size // functions
