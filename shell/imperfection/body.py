"""What an imperfect resonator has more than the perfect one, as quadrature; forms of vectors on it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import TypeAlias

import numpy as np

from shell.imperfection.block import Block
from shell.imperfection.core import Core
from shell.imperfection.field import values_around
from shell.imperfection.imperfect import Imperfection
from shell.imperfection.place import cut, fade
from shell.imperfection.wall import Around, Stretch, Wall, go_around
from shell.quadrature import Array, gauss
from shell.resonator import Resonator
from shell.solution import Constants
from shell.system import ShellGroup

Vector: TypeAlias = dict[int, Array]
"""A displacement: harmonic k to the unknowns of cos kθ and of sin kθ, (2, size)."""


class Body:
    """Layers on faces, changes of the material, the edge of the rim, masses."""

    def __init__(
        self,
        blocks: Callable[[int], Block],
        constants: tuple[Constants, ...],
        cores: Sequence[Core],
        resonator: Resonator,
        flaw: Imperfection,
        waves: tuple[int, ...],
        theta: Array,
        n: int,
    ) -> None:
        self.blocks, self.resonator, self.theta = blocks, resonator, theta
        system = blocks(n).system
        self._around: dict[tuple[tuple[int, ...], int | None], Around] = {}
        orders = system.level.through
        faces = flaw.faces(fade(resonator, system))
        self.walls: list[tuple[int, Wall]] = []
        self.cores: list[tuple[Core, Array, Array]] = []
        for number, (group, c) in enumerate(zip(system.groups, constants, strict=True)):
            if not isinstance(group, ShellGroup):
                continue
            table, everywhere = group.table, slice(0, len(group.unknowns))
            here = Stretch(group.place.section, c, everywhere, table.along, orders, table.transverse_shear, theta)
            stiff, heavy = here.around(flaw.modulus, waves), here.around(flaw.density, waves)
            if faces != (None, None):
                self.walls.append((number, here.layers(faces, waves, 1 + stiff, 1 + heavy)))
            if flaw.modulus is not None or flaw.density is not None:
                self.walls.append((number, here.change(stiff, heavy)))
        for core in cores if flaw.modulus is not None or flaw.density is not None else ():
            x = system.groups[core.number].table.position[:1, 0]
            stiff, heavy = (
                np.zeros(theta.size) if field is None else values_around(field, waves, x, theta)[0][0]
                for field in (flaw.modulus, flaw.density)
            )
            self.cores.append((core, stiff * (2 * pi / theta.size), heavy * (2 * pi / theta.size)))
        if flaw.rim is not None:
            edge = cut(resonator, system, 1.0, gauss(max(orders) + 2)[0])
            width = values_around(flaw.rim, flaw.rim.orders, np.ones(1), theta)[0][0]
            c = constants[edge.group]
            at = slice(edge.element, edge.element + 1)
            last = Constants(c.E[at, -1:], c.nu[at, -1:], c.rho[at, -1:], c.plane_stress)
            strip = Stretch(edge.section, last, at, edge.along[:, None], orders, edge.table.transverse_shear, theta)
            self.walls.append((edge.group, strip.strip(width)))
        self.masses: list[tuple[float, float, Array, Array]] = [
            (m.position, m.height, np.array([m.azimuth]), np.array([m.mass])) for m in flaw.masses
        ]
        for line in flaw.lines:
            place = resonator.at([line.position * resonator.length])
            radius = float((place.r + line.height * place.thickness / 2 * place.normal_r)[0])
            density = values_around(line.per_length, line.per_length.orders, np.array([line.position]), theta)[0][0]
            self.masses.append((line.position, line.height, theta, density * radius * 2 * pi / theta.size))

    def around(self, harmonics: tuple[int, ...], which: int | None = None) -> Around:
        """How harmonics go around at the azimuths of the walls, or at those of a set of masses."""
        if (harmonics, which) not in self._around:
            theta = self.theta if which is None else self.masses[which][2]
            self._around[harmonics, which] = go_around(harmonics, theta)
        return self._around[harmonics, which]


@dataclass(frozen=True, eq=False)
class Fields:
    """A vector on the body: strains and displacements in the walls, displacements of masses, duals of its solid parts.

    strain, move : of every wall, (6 or 3, points, θ). places : of every set of masses, (3, masses).
    cores : stiffness and mass of the solid parts times the vector, by harmonic, (2, shared) each.
    """

    strain: list[Array]
    move: list[Array]
    places: list[Array]
    cores: tuple[Vector, Vector]


class Forms:
    """A = K - λ M and M of the imperfect body in a growing basis, and the forces that it leaves.

    The basis is the pair, which the perfect body leaves without forces, and answers of the perfect body to loads.

    Parameters
    ----------
    value : λ. harmonics : of all the vectors that there will be.
    """

    def __init__(self, body: Body, value: float, harmonics: Sequence[int]) -> None:
        self.body, self.value, self.harmonics = body, value, tuple(sorted(harmonics))
        self.vectors: list[Vector] = []
        self.loads: list[Vector] = []
        self.fields: list[Fields] = []
        self.A = self.M = np.zeros((0, 0))

    def extend(self, fresh: list[Vector], loads: list[Vector]) -> None:
        """Add vectors to the basis, each with what the perfect body's A makes of it."""
        before = len(self.vectors)
        self.vectors += fresh
        self.loads += loads
        self.fields += [self._fields(vector) for vector in fresh]
        A, M = (np.zeros((len(self.vectors), len(fresh))) for _ in range(2))
        weighed = {k: self.body.blocks(k).weigh(np.concatenate([one[k] for one in fresh])) for k in fresh[0]}
        for column, (fields, load) in enumerate(zip(self.fields[before:], loads, strict=True)):
            stress, inertia, pull = self._duals(fields)
            own = {k: rows[2 * column : 2 * column + 2] for k, rows in weighed.items()}
            for row, (vector, other) in enumerate(zip(self.vectors, self.fields, strict=True)):
                heavy = _dot(other.move, inertia) + _dot(other.places, pull) + self._in_cores(vector, fields.cores[1])
                stiff = _dot(other.strain, stress) + self._in_cores(vector, fields.cores[0])
                A[row, column] = stiff - self.value * heavy + (_inner(vector, load) if row > 1 else 0.0)
                M[row, column] = heavy + _inner(vector, own)
        self.A, self.M = _bordered(self.A, A, before), _bordered(self.M, M, before)

    def forces(self, T: Array) -> list[Vector]:
        """A of the combinations T (basis, columns) on the unknowns of every harmonic."""
        found = []
        for weights in T.T:
            force = self._pull(_combine(self.fields, weights))
            for weight, load in zip(weights, self.loads, strict=True):
                for k, q in load.items():
                    force[k] += weight * q
            found.append(force)
        return found

    def _fields(self, vector: Vector) -> Fields:
        body, ks = self.body, tuple(sorted(vector))
        around = body.around(ks)
        strain, move, places = [], [], []
        plain: dict[int, Array] = {}
        for number, wall in body.walls:
            if number not in plain:
                elements = len(body.blocks(ks[0]).system.groups[number].unknowns)
                rows = [(body.blocks(k).spreads[number][0] @ vector[k].T).T for k in ks]
                plain[number] = np.concatenate(rows).reshape(2 * len(ks), elements, -1)
            strains, moves = wall.move(plain[number], around)
            strain.append(strains)
            move.append(moves)
        for which, (position, height, _, _) in enumerate(body.masses):
            at = body.around(ks, which)
            u = np.concatenate([vector[k] @ body.blocks(k).moves(body.resonator, position, height).T for k in ks]).T
            places.append(np.array([u[0] @ at.cosine, u[1] @ at.sine, u[2] @ at.cosine]))
        return Fields(strain, move, places, self._core_duals(vector, around))

    def _duals(self, fields: Fields) -> tuple[list[Array], list[Array], list[Array]]:
        """Stresses, momenta per s⁻² and those of masses, with their volumes."""
        walls, masses = self.body.walls, self.body.masses
        stress = [wall.stress(e) for (_, wall), e in zip(walls, fields.strain, strict=True)]
        inertia = [wall.rho * d for (_, wall), d in zip(walls, fields.move, strict=True)]
        return stress, inertia, [m * d for (*_, m), d in zip(masses, fields.places, strict=True)]

    def _core_duals(self, vector: Vector, around: Around) -> tuple[Vector, Vector]:
        """Stiffness and mass of the solid parts times a vector, on the shared unknowns of every harmonic."""
        found: tuple[Vector, Vector] = ({}, {})
        whole = self.body.around(self.harmonics)
        for core, stiff, heavy in self.body.cores:
            for which, (dual, weight) in enumerate(zip(found, (stiff, heavy), strict=True)):
                cosine = (whole.cosine * weight) @ around.cosine.T
                sine = (whole.sine * weight) @ around.sine.T
                least = 1e-14 * float(np.abs(weight).sum())
                for i, k in enumerate(self.harmonics):
                    total = dual.setdefault(k, np.zeros((2, len(self.body.blocks(k).shared))))
                    for j, other in enumerate(sorted(vector)):
                        here = np.s_[2 * i : 2 * i + 2, 2 * j : 2 * j + 2]
                        if max(np.abs(cosine[here]).max(), np.abs(sine[here]).max()) <= least:
                            continue
                        one, two = core.energies(k, other)[2 * which : 2 * which + 2]
                        moved = vector[other][:, self.body.blocks(other).shared]
                        total += cosine[here] @ moved @ one.T + sine[here] @ moved @ two.T
        return found

    def _in_cores(self, vector: Vector, dual: Vector) -> float:
        return _inner({k: q[:, self.body.blocks(k).shared] for k, q in vector.items()}, dual) if dual else 0.0

    def _pull(self, fields: Fields) -> Vector:
        body, ks = self.body, self.harmonics
        stress, inertia, pull = self._duals(fields)
        around = body.around(ks)
        found = {k: np.zeros((2, body.blocks(k).size)) for k in ks}
        for (number, wall), s, f in zip(body.walls, stress, inertia, strict=True):
            elements = len(body.blocks(ks[0]).system.groups[number].unknowns)
            loads = wall.pull(s, self.value * f, around, elements).reshape(len(ks), 2, -1)
            for k, load in zip(ks, loads, strict=True):
                found[k] += (body.blocks(k).spreads[number][1] @ load.T).T
        for which, ((position, height, _, _), f) in enumerate(zip(body.masses, pull, strict=True)):
            at = body.around(ks, which)
            rows = np.array([f[0] @ at.cosine.T, f[1] @ at.sine.T, f[2] @ at.cosine.T])
            for i, k in enumerate(ks):
                moves = body.blocks(k).moves(body.resonator, position, height)
                found[k] -= self.value * rows[:, 2 * i : 2 * i + 2].T @ moves
        stiff, heavy = fields.cores
        for k in stiff:
            found[k][:, body.blocks(k).shared] += stiff[k] - self.value * heavy[k]
        return found


def _dot(ones: list[Array], others: list[Array]) -> float:
    return float(sum(np.vdot(a, b) for a, b in zip(ones, others, strict=True)))


def _inner(one: Vector, other: Vector) -> float:
    return float(sum(np.vdot(q, other[k]) for k, q in one.items() if k in other))


def _combine(fields: list[Fields], weights: Array) -> Fields:
    """A combination of vectors, by their fields."""

    def add(kind: str) -> list[Array]:
        found: list[Array] = []
        for weight, one in zip(weights, fields, strict=True):
            if weight:
                pieces = [weight * piece for piece in getattr(one, kind)]
                found = [a + b for a, b in zip(found, pieces, strict=True)] if found else pieces
        return found

    stiff, heavy = (
        {k: sum(w * f.cores[which][k] for w, f in zip(weights, fields, strict=True)) for k in fields[0].cores[which]}
        for which in (0, 1)
    )
    return Fields(add("strain"), add("move"), add("places"), (stiff, heavy))


def _bordered(old: Array, columns: Array, before: int) -> Array:
    """A symmetric matrix that has grown by columns."""
    grown = np.zeros((len(columns), len(columns)))
    grown[:before, :before] = old
    grown[:, before:] = columns
    grown[before:, :before] = columns[:before].T
    grown[before:, before:] = (columns[before:] + columns[before:].T) / 2
    return grown
