"""A solid part (root, corner, clamp) of an imperfect resonator: its shape is kept, its density and modulus may vary around.

It moves as the shell's edge drives it (shell.imperfection.block). Its strains go as cos kθ or sin kθ times a section, so that
energies of two harmonics are those of their sections times ∫ (1 + p) cos kθ cos lθ dθ and the like.
"""

from collections.abc import Callable

import numpy as np

from shell.cells import CellTable
from shell.imperfection.block import Block
from shell.kernel import energy_weights
from shell.quadrature import Array
from shell.solution import Constants
from shell.system import SolidGroup

COSINE, SINE = [0, 1, 2, 4], [3, 5]  # strains, in the order of the kernel
ALONG, AROUND = [0, 2], [1]  # displacements


class Core:
    """Energies of one solid part between any two harmonics, per unit of the unknowns that it shares with the shell.

    Parameters
    ----------
    number : of its group. constants : its material. blocks : the harmonics.
    """

    def __init__(self, number: int, constants: Constants, blocks: Callable[[int], Block]) -> None:
        self.number, self.constants, self.blocks = number, constants, blocks
        self._sections: dict[int, tuple[Array, Array]] = {}
        self._energies: dict[tuple[int, int], tuple[Array, ...]] = {}

    def energies(self, k: int, l: int) -> tuple[Array, ...]:
        """Of strains that go as the cosine, as the sine, of displacements that go as the cosine, as the sine: (shared, shared)."""
        if (k, l) not in self._energies:
            (e, d), (f, g) = self._section(k), self._section(l)
            volume = self._table(k).volume
            stress, momentum = self._stress(f) * volume, self.constants.rho[:, :, None] * volume * g
            pairs = [(e, stress, one) for one in (COSINE, SINE)] + [(d, momentum, one) for one in (ALONG, AROUND)]
            self._energies[k, l] = tuple(_flat(a[:, :, one]) @ _flat(b[:, :, one]).T for a, b, one in pairs)
        return self._energies[k, l]

    def _table(self, k: int) -> CellTable:
        group = self.blocks(k).system.groups[self.number]
        assert isinstance(group, SolidGroup)
        return group.table

    def _section(self, k: int) -> tuple[Array, Array]:
        """Strains and displacements per unit of every shared unknown."""
        if k not in self._sections:
            table, moved = self._table(k), self.blocks(k).inner(self.number)
            self._sections[k] = (
                np.array([table.strains(one)[:, 0] for one in moved]),
                np.array([table.displacements(one)[:, 0] for one in moved]),
            )
        return self._sections[k]

    def _stress(self, strain: Array) -> Array:
        """Stresses of strains (vectors, cells, 6, points)."""
        lam, G = (one[:, :, None] for one in self.constants.lame)
        found = G * energy_weights()[:, None] * strain
        found[:, :, :3] += lam * strain[:, :, :3].sum(axis=2, keepdims=True)
        return np.asarray(found)


def _flat(fields: Array) -> Array:
    return fields.reshape(len(fields), -1)
