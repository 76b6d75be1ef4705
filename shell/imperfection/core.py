"""A solid part (root, corner, clamp) of an imperfect resonator: its shape is kept, density and modulus may vary around.

It moves as the shell's edge drives it; energies of two harmonics are those of their sections times ∫ (1 + p) cos kθ cos
lθ dθ.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from shell.cells import CellTable
from shell.elastic import COSINE, SINE, Constants
from shell.imperfection.block import Block
from shell.imperfection.together import Together
from shell.imperfection.wall import Around
from shell.quadrature import Array
from shell.system import SolidGroup

ALONG, AROUND = [0, 2], [1]  # displacements
Energies: TypeAlias = Callable[[Block, Block], tuple[Array, Array]]
"""Of two harmonics, what goes as the cosine and what goes as the sine, (shared, shared) each."""


class Core:
    """Energies of one solid part between any two harmonics, per unit of the unknowns that it shares with the shell."""

    def __init__(self, number: int, constants: Constants) -> None:
        self.number, self.constants = number, constants
        self._sections: dict[int, tuple[Array, Array]] = {}
        self._products: dict[tuple[int, int], tuple[Array, ...]] = {}

    def respond(self, X: Array, energies: Energies, weight: Array, around: Around, together: Together) -> Array:
        """What a change of its material does to vectors (unknowns, vectors, 2)."""
        found = np.zeros_like(X)
        cosine, sine = ((one * weight) @ one.T for one in (around.cosine, around.sine))
        least = 1e-14 * float(np.abs(weight).sum())
        parts = list(enumerate(zip(together.blocks, together.rows, strict=True)))
        for j, (other, columns) in parts:
            moved = X[columns][other.shared]
            for i, (block, rows) in parts if moved.any() else ():
                here = np.s_[2 * i : 2 * i + 2, 2 * j : 2 * j + 2]
                if max(np.abs(cosine[here]).max(), np.abs(sine[here]).max()) > least:
                    one, two = (np.tensordot(part, moved, 1) for part in energies(block, other))
                    found[rows][block.shared] += one @ cosine[here].T + two @ sine[here].T
        return found

    def stiffness(self, one: Block, other: Block) -> tuple[Array, Array]:
        """Energies of strains."""
        return self._energies(one, other)[:2]  # type: ignore[return-value]

    def mass(self, one: Block, other: Block) -> tuple[Array, Array]:
        """Energies of displacements per s⁻²."""
        return self._energies(one, other)[2:]  # type: ignore[return-value]

    def _energies(self, one: Block, other: Block) -> tuple[Array, ...]:
        key = one.system.n, other.system.n
        if key not in self._products:
            (e, d), (f, g), table = self._section(one), self._section(other), self._table(one)
            volume = table.volume[:, :, None]
            stress = self.constants.stress(table, f) * volume
            momentum = self.constants.rho[..., None, None] * volume * g
            pairs = [(e, stress, some) for some in (COSINE, SINE)] + [(d, momentum, some) for some in (ALONG, AROUND)]
            self._products[key] = tuple(_flat(a[..., some, :]) @ _flat(b[..., some, :]).T for a, b, some in pairs)
        return self._products[key]

    def _table(self, block: Block) -> CellTable:
        group = block.system.groups[self.number]
        assert isinstance(group, SolidGroup)
        return group.table

    def _section(self, block: Block) -> tuple[Array, Array]:
        """Strains and displacements per unit of every shared unknown."""
        if block.system.n not in self._sections:
            table, moved = self._table(block), block.inner(self.number)
            self._sections[block.system.n] = (
                np.array([table.strains(one) for one in moved]),
                np.array([table.displacements(one) for one in moved]),
            )
        return self._sections[block.system.n]


def _flat(fields: Array) -> Array:
    return fields.reshape(len(fields), -1)
