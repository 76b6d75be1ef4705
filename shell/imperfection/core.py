"""A solid part (root, corner, clamp) of an imperfect resonator: its shape is kept, its density and modulus may vary around.

Its strains go as cos kθ or sin kθ times a section, so that energies of two vectors are those of their sections times
∫ (1 + p) cos kθ cos lθ dθ and the like.
"""

from collections.abc import Callable

import numpy as np

from shell.cells import CellTable
from shell.imperfection.wall import Part
from shell.kernel import energy_weights
from shell.quadrature import Array
from shell.solution import Constants

COSINE, SINE = [0, 1, 2, 4], [3, 5]  # strains, in the order of the kernel
ALONG, AROUND = [0, 2], [1]  # displacements


class Core:
    """Sections of the vectors of a basis in one solid part.

    Parameters
    ----------
    tables : of the part at each harmonic.
    constants : its material.
    stiff, heavy : 1 + relative change of E and of ρ, (θ,). theta : azimuths, equal steps.
    """

    def __init__(
        self, tables: Callable[[int], CellTable], constants: Constants, stiff: Array, heavy: Array, theta: Array
    ) -> None:
        self.tables, self.constants, self.theta = tables, constants, theta
        self.step = 2 * np.pi / theta.size
        self.stiff, self.heavy = stiff * self.step, heavy * self.step
        self.parts: list[Part] = []
        self.strains: list[Array] = []
        self.moves: list[Array] = []

    def extend(self, fresh: list[tuple[Part, Array]]) -> tuple[Array, Array]:
        """Add vectors, (cells, size) each, and return the columns of K and M that they bring, (all, new)."""
        before = len(self.parts)
        for part, unknowns in fresh:
            table = self.tables(part.harmonic)
            self.parts.append(part)
            self.strains.append(table.strains(unknowns)[:, 0])
            self.moves.append(table.displacements(unknowns)[:, 0])
        e, d = np.array(self.strains), np.array(self.moves)
        volume = self.tables(self.parts[0].harmonic).volume
        stress, momentum = self._stress(e[before:]) * volume, self.constants.rho[:, :, None] * volume * d[before:]
        around = self._around(self.parts)
        K = M = np.zeros((len(e), len(e) - before))
        for which, strains, moves in ((0, COSINE, ALONG), (1, SINE, AROUND)):
            fields, waves = _flat(e[:, :, strains]), around[which]
            K = K + (waves * self.stiff) @ waves[before:].T * (fields @ _flat(stress[:, :, strains]).T)
            M = M + (waves * self.heavy) @ waves[before:].T * (_flat(d[:, :, moves]) @ _flat(momentum[:, :, moves]).T)
        return K, M

    def loads(self, weights: Array, value: float, part: Part) -> Array:
        """∫ (σ : ε - value ρ u · u) of a combination of the vectors on the functions of one part, (cells, functions, 3)."""
        own, around = self._around([part]), self._around(self.parts)
        strain, move = np.zeros_like(self.strains[0]), np.zeros_like(self.moves[0])
        for which, strains, moves in ((0, COSINE, ALONG), (1, SINE, AROUND)):
            for b, weight in enumerate(weights):
                wave = own[which][0] * around[which][b]
                stiff, heavy = weight * float(self.stiff @ wave), weight * float(self.heavy @ wave)
                if abs(stiff) > 1e-14 * self.step or abs(heavy) > 1e-14 * self.step:
                    strain[:, strains] += stiff * self.strains[b][:, strains]
                    move[:, moves] += heavy * self.moves[b][:, moves]
        force = value * self.constants.rho[:, :, None] * move
        return self.tables(part.harmonic).loads(self._stress(strain[None])[0][:, None], force[:, None])

    def _stress(self, strain: Array) -> Array:
        """Stresses of strains (vectors, cells, 6, points)."""
        lam, G = (one[:, :, None] for one in self.constants.lame)
        found = G * energy_weights()[:, None] * strain
        found[:, :, :3] += lam * strain[:, :, :3].sum(axis=2, keepdims=True)
        return np.asarray(found)

    def _around(self, parts: list[Part]) -> tuple[Array, Array]:
        pairs = [part.around(self.theta) for part in parts]
        return np.array([c for c, _ in pairs]), np.array([s for _, s in pairs])


def _flat(fields: Array) -> Array:
    return fields.reshape(len(fields), -1)
