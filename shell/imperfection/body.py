"""The difference between the imperfect and the perfect resonator: products of δK and δM with vectors, by quadrature."""

from collections.abc import Sequence
from functools import cache
from math import pi

import numpy as np

from shell.cross_section import free_edge
from shell.elastic import COSINE, SINE, Constants
from shell.imperfection.block import Block, Together
from shell.imperfection.field import values_around
from shell.imperfection.imperfect import Imperfection, fade
from shell.imperfection.wall import ALONG, AROUND, Around, Stretch, Wall, go_around
from shell.kernel import Section
from shell.quadrature import Array, Basis


class Core:
    """Energies of one solid part (root, corner, clamp) between any two harmonics, per unit of the unknowns that it shares with the shell.

    It keeps its shape and moves as the shell's edge drives it: energies of its sections times ∫ (1 + p) cos kθ cos lθ dθ.
    """

    def __init__(self, number: int, constants: Constants) -> None:
        self.number, self.constants = number, constants
        self._section, self._energies = cache(self._find_section), cache(self._find_energies)

    def respond(self, X: Array, changes: Sequence[Array], around: Around, together: Together) -> tuple[Array, Array]:
        """δK and δM times vectors (unknowns, vectors, 2), for changes of E and of ρ."""
        found = np.zeros_like(X), np.zeros_like(X)
        turns = [[(one * change) @ one.T for one in (around.cosine, around.sine)] for change in changes]
        least = [1e-14 * float(np.abs(change).sum()) for change in changes]
        parts = list(enumerate(zip(together.blocks, together.rows, strict=True)))
        for j, (other, columns) in parts:
            moved = X[columns][other.shared]
            for i, (block, rows) in parts if moved.any() else ():
                here = np.s_[2 * i : 2 * i + 2, 2 * j : 2 * j + 2]
                for k, both in enumerate(turns):
                    if max(np.abs(turn[here]).max() for turn in both) > least[k]:
                        energies = zip(self._energies(block, other)[k], both, strict=True)
                        forces = (np.tensordot(energy, moved, 1) @ turn[here].T for energy, turn in energies)
                        found[k][rows][block.shared] += sum(forces)
        return found

    def _find_energies(self, one: Block, other: Block) -> tuple[list[Array], list[Array]]:
        """Of strains and of displacements per s⁻², what goes as the cosine and what goes as the sine, (shared, shared) each."""
        (e, d), (f, g), table = self._section(one), self._section(other), one.system.solids[self.number].table
        volume = table.volume[:, :, None]
        stress = self.constants.stress(table, f) * volume
        momentum = self.constants.rho[..., None, None] * volume * g
        return (
            [_flat(e[..., some, :]) @ _flat(stress[..., some, :]).T for some in (COSINE, SINE)],
            [_flat(d[..., some, :]) @ _flat(momentum[..., some, :]).T for some in (ALONG, AROUND)],
        )

    def _find_section(self, block: Block) -> tuple[Array, Array]:
        """Strains and displacements per unit of every shared unknown."""
        table, moved = block.system.solids[self.number].table, block.inner(self.number)
        return np.array([table.strains(one) for one in moved]), np.array([table.displacements(one) for one in moved])


def _flat(fields: Array) -> Array:
    return fields.reshape(len(fields), -1)


RUN = 4  # elements that are treated at once: fields that stay in the fast memory


class Body:
    """Layers on faces, changes of the material, the rim's edge, masses; `flaw` is cut down to `waves`, `theta` are azimuths (rad)."""

    def __init__(
        self, together: Together, cores: Sequence[Core], flaw: Imperfection, waves: tuple[int, ...], theta: Array
    ) -> None:
        self.together = together
        self.around = go_around(together.harmonics, theta)
        self.walls = _walls(together, flaw, waves, theta)
        self.cores: list[tuple[Core, Array, Array]] = []
        for core in cores if flaw.modulus or flaw.density else ():
            x = together.blocks[0].system.groups[core.number].table.position[:1, 0]
            stiff, heavy = (values_around(field, waves, x, theta)[0] for field in (flaw.modulus, flaw.density))
            self.cores.append((core, stiff * (2 * pi / theta.size), heavy * (2 * pi / theta.size)))
        self.masses: list[tuple[tuple[float, float], Array, Around]] = []
        for place in dict.fromkeys((m.position, m.height) for m in flaw.masses):
            here = [m for m in flaw.masses if (m.position, m.height) == place]
            azimuths = go_around(together.harmonics, np.array([m.azimuth for m in here]))
            self.masses.append((place, np.array([m.mass for m in here]), azimuths))

    def respond(self, X: Array, value: float) -> tuple[Array, Array]:
        """δK - λ δM, of what is there more, and M, of all, times vectors (unknowns, vectors, 2); λ = value."""
        together, vectors = self.together, X.shape[1]
        change, mass = np.zeros_like(X), together.weigh(X)
        for number, walls in self.walls.items():
            plain = together.plain(number, X)
            loads = np.zeros((*plain.shape[:3], 2 * vectors, *plain.shape[4:]))
            for wall in walls:
                stiff, heavy = wall.respond(plain[:, wall.elements], self.around)
                loads[:, wall.elements] += np.concatenate([stiff - value * heavy, heavy], axis=3)
            both = together.gather(number, loads)
            change += both[:, :vectors]
            mass += both[:, vectors:]
        heavy = np.zeros_like(X)
        for place, masses, around in self.masses:
            turns = around.cosine, around.sine, around.cosine
            moves, pulled = self.together.moves(*place)
            u = (moves @ X.reshape(len(X), -1)).reshape(len(self.together.harmonics), 3, vectors, 2)
            pull = np.empty_like(u)
            for component, turn in enumerate(turns):
                at = u[:, component].transpose(1, 0, 2).reshape(vectors, -1) @ turn
                pull[:, component] = ((at * masses) @ turn.T).reshape(vectors, -1, 2).transpose(1, 0, 2)
            heavy += (pulled @ pull.reshape(-1, 2 * vectors)).reshape(X.shape)
        for core, *changes in self.cores:
            stiff, more = core.respond(X, changes, self.around, self.together)
            change, heavy = change + stiff, heavy + more
        return change - value * heavy, mass + heavy


def _walls(together: Together, flaw: Imperfection, waves: tuple[int, ...], theta: Array) -> dict[int, list[Wall]]:
    """What is there more on every chain."""
    system = together.blocks[0].system
    orders, resonator = system.level.through, together.resonator
    faces = flaw.faces(fade(resonator, system))[:: resonator.outward]
    found: dict[int, list[Wall]] = {number: [] for number in system.chains}
    for number, walls in found.items():
        group, c = system.chains[number], together.constants[number]
        for first in range(0, len(group.unknowns), RUN):
            run = slice(first, min(first + RUN, len(group.unknowns)))
            section = Section(**{name: value[run] for name, value in vars(group.section).items()})
            here = Stretch(section, c.at(run), run, Basis(*group.table.along), orders, theta)
            stiff, heavy = here.values(flaw.modulus, waves), here.values(flaw.density, waves)
            if any(faces):
                walls += here.layers(faces, waves, 1 + stiff, 1 + heavy)
            if flaw.modulus or flaw.density:
                walls.append(here.change(stiff, heavy))
    if flaw.rim:
        edge, _ = free_edge(resonator, system, 1.0)
        width = values_around(flaw.rim, flaw.rim.orders, np.ones((1, 1)), theta)
        c, at = together.constants[edge.group], slice(edge.element, edge.element + 1)
        here = Stretch(edge.section, c.at((at, slice(-1, None))), at, Basis(*edge.along[:, None]), orders, theta)
        found[edge.group].append(here.change(width, width))  # a strip as wide
    return found
