"""An imperfect resonator as quadrature in the wall, on the edge of the rim and at masses; forms of vectors on it."""

from collections.abc import Callable
from math import pi
from typing import TypeAlias

import numpy as np

from shell.imperfection.field import values_around
from shell.imperfection.imperfect import Imperfection
from shell.imperfection.place import cut, fade
from shell.imperfection.wall import Part, Wall, deform
from shell.kernel import energy_weights
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
        orders = system.level.through
        eta = gauss(max(orders) + 2)
        faces = flaw.faces(fade(resonator, system))
        self.walls: list[tuple[int, Wall]] = []
        self.solids: list[tuple[int, Array, Array]] = []
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
                self.solids.append((number, stiff, heavy))
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


class Forms:
    """K and M of the imperfect body in a growing basis, and the forces that it leaves."""

    def __init__(self, body: Body, value: float) -> None:
        self.body, self.value = body, value
        self.vectors: list[Vector] = []
        self.strains: list[list[Array]] = []
        self.moves: list[list[Array]] = []
        self.K = self.M = np.zeros((0, 0))
        self.size = 0.0

    def extend(self, fresh: list[Vector]) -> None:
        """Add vectors to the basis."""
        before = len(self.vectors)
        for part, vector in fresh:
            strain, move = self._fields(part, vector)
            self.vectors.append((part, vector))
            self.strains.append(strain)
            self.moves.append(move)
        count = len(self.vectors)
        K, M = np.zeros((count, count)), np.zeros((count, count))
        K[:before, :before], M[:before, :before] = self.K, self.M
        for b in range(before, count):
            stress, inertia = self._duals(self.strains[b], self.moves[b])
            for a in range(b + 1):
                K[a, b] = K[b, a] = sum(float(np.vdot(e, s)) for e, s in zip(self.strains[a], stress, strict=True))
                M[a, b] = M[b, a] = sum(float(np.vdot(d, f)) for d, f in zip(self.moves[a], inertia, strict=True))
        self.K, self.M = K, M

    def _fields(self, part: Part, vector: Array) -> tuple[list[Array], list[Array]]:
        """Strains of walls and solids; displacements of walls, solids and masses."""
        body = self.body
        system = body.systems(part.harmonic)
        unknowns = system.spread(vector)
        strains, moves = [], []
        for number, wall in body.walls:
            strain, move = wall.move(wall.jets(unknowns[number]), part)
            strains.append(strain)
            moves.append(move)
        C, S = part.around(body.theta)
        for number, _, _ in body.solids:
            table = system.groups[number].table
            strains.append(_spin(table.strains(unknowns[number]), C, S, (3, 5)))
            moves.append(_spin(table.displacements(unknowns[number]), C, S, (1,)))
        for position, height, theta, _ in body.masses:
            u = cut(body.resonator, system, position, np.array([height])).displacements(unknowns)[:, 0]
            one, other = part.around(theta)
            moves.append(np.stack([u[0] * one, u[1] * other, u[2] * one]))
        return strains, moves

    def _duals(self, strains: list[Array], moves: list[Array]) -> tuple[list[Array], list[Array]]:
        """Stresses and momenta, with their volumes."""
        body = self.body
        stress = [wall.stress(e) for (_, wall), e in zip(body.walls, strains, strict=False)]
        inertia = [wall.rho * wall.volume * d for (_, wall), d in zip(body.walls, moves, strict=False)]
        system, step = body.own, 2 * pi / body.theta.size
        first = len(body.walls)
        for (number, stiff, heavy), e, d in zip(body.solids, strains[first:], moves[first:], strict=False):
            group, c = system.groups[number], body.constants[number]
            volume = (group.table.volume * step)[..., None]
            lam, G = (one[..., None, None] for one in c.lame)
            found = (G[:, :, None] * energy_weights()[:, None, None]) * e
            found[:, :, :3] += (lam * e[:, :, :3].sum(axis=2))[:, :, None]
            stress.append(found * (volume * stiff)[:, :, None])
            inertia.append(d * (c.rho[..., None, None] * volume * heavy)[:, :, None])
        masses = moves[first + len(body.solids) :]
        inertia += [m * d for (*_, m), d in zip(body.masses, masses, strict=True)]
        return stress, inertia

    def forces(self, T: Array, parts: list[Part]) -> list[Array]:
        """(K - λ M) of the two folded vectors on the free unknowns of every part, (unknowns, 2) each."""
        columns: list[list[Array]] = [[] for _ in parts]
        for weights in T.T:
            strains = [
                sum(w * s[k] for w, s in zip(weights, self.strains, strict=True)) for k in range(len(self.strains[0]))
            ]
            moves = [sum(w * d[k] for w, d in zip(weights, self.moves, strict=True)) for k in range(len(self.moves[0]))]
            stress, inertia = self._duals(strains, moves)
            force = [self.value * one for one in inertia]
            for column, load in zip(columns, self._gather(stress, force, parts), strict=True):
                column.append(load)
        found = [np.stack(column, axis=1) for column in columns]
        self.size = max(self.size, max(float(np.abs(one).max()) for one in found))
        return found

    def _gather(self, stress: list[Array], force: list[Array], parts: list[Part]) -> list[Array]:
        body = self.body
        per_part: list[list[Array]] = []
        for part in parts:
            groups = body.systems(part.harmonic).groups
            per_part.append([np.zeros(_load_shape(group)) for group in groups])
        for (number, wall), s, f in zip(body.walls, stress, force, strict=False):
            for loads, duals in zip(per_part, wall.pull(s, f, parts), strict=True):
                loads[number] += wall.loads(duals, loads[number].shape)
        first = len(body.walls)
        for (number, _, _), s, f in zip(body.solids, stress[first:], force[first:], strict=False):
            for part, loads in zip(parts, per_part, strict=True):
                table = body.systems(part.harmonic).groups[number].table
                C, S = part.around(body.theta)
                volume = table.volume[:, :, None]
                loads[number] += table.loads(_project(s, C, S, (3, 5)) / volume, _project(f, C, S, (1,)) / volume)
        masses = force[first + len(body.solids) :]
        for (position, height, theta, _), f in zip(body.masses, masses, strict=True):
            for part, loads in zip(parts, per_part, strict=True):
                here = cut(body.resonator, body.systems(part.harmonic), position, np.array([height]))
                C, S = part.around(theta)
                pull = np.array([f[0] @ C, f[1] @ S, f[2] @ C])
                amplitudes = pull @ here.table.displacement[0, 0, :, 0]
                loads[here.group][here.element] -= np.outer(here.along[0], amplitudes)
        return [body.systems(part.harmonic).gather(loads) for part, loads in zip(parts, per_part, strict=True)]


def _load_shape(group: ShellGroup | SolidGroup) -> tuple[int, ...]:
    elements, size = group.unknowns.shape
    if isinstance(group, SolidGroup):
        return elements, size // 3, 3
    functions = group.table.along.shape[2]
    return elements, functions, size // functions


def _spin(fields: Array, C: Array, S: Array, sine: tuple[int, ...]) -> Array:
    """Fields (cells, 1, components, points) at azimuths: those in `sine` vary as v does."""
    turned = np.array([S if k in sine else C for k in range(fields.shape[2])])
    return np.asarray(fields[..., None] * turned[:, None])


def _project(fields: Array, C: Array, S: Array, sine: tuple[int, ...]) -> Array:
    turned = np.array([S if k in sine else C for k in range(fields.shape[2])])
    return np.asarray(np.einsum("esckq,cq->esck", fields, turned))
