"""A mode at one position of its shell: strains and displacements on a cross-section."""

from dataclasses import dataclass

import numpy as np
import scipy

from shell.assembly import sections
from shell.errors import ShellError, mm
from shell.kernel import Section, StrainTable, shell_table
from shell.quadrature import Array, gauss, nodal
from shell.resonator import Resonator
from shell.system import System


@dataclass(frozen=True, eq=False)
class CrossSection:
    """Where a position of the meridian lies among the elements, and the table of strains there, one station."""

    group: int  # group, element: numbers of the group and of the element in it
    element: int
    along: Array  # values and ξ-derivatives of the functions along the element, (2, functions)
    section: Section  # the middle surface
    # at the heights that were asked for; its volumes are those of a slice of unit arc length and unit η
    table: StrainTable

    def strains(self, unknowns: list[Array]) -> Array:
        """Strain (6, heights) of the unknowns of every group."""
        q = unknowns[self.group][self.element][None]
        return np.asarray(self.table.strains(q)[0, 0])

    def displacements(self, unknowns: list[Array]) -> Array:
        """Displacement (3, heights) along tangent, circle and normal."""
        q = unknowns[self.group][self.element][None]
        return np.asarray(self.table.displacements(q)[0, 0])

    def rows(self, plain: "scipy.sparse.csr_matrix") -> Array:
        """Displacement at the first height per unit of what `plain` takes to the group's element unknowns, (3, columns)."""
        local = np.einsum("f,ca->cfa", self.along[0], self.table.displacement[0, 0, :, 0]).reshape(3, -1)
        first = self.element * local.shape[1]
        return np.asarray((plain[first : first + local.shape[1]].T @ local.T).T)


def cut(resonator: Resonator, system: System, position: float, heights: Array) -> CrossSection:
    """The cross-section at a position of the meridian, at heights η, -1 ... 1 along the normal."""
    if not 0 <= position <= 1:
        raise ShellError(f"a position on the meridian lies in 0 (start) ... 1 (rim), not at {position:g}.")
    s, margin = position * resonator.length, 1e-9 * resonator.length
    for number, group in system.chains.items():
        breaks = np.array(group.chain.breaks)
        if not breaks[0] - margin <= s <= breaks[-1] + margin:
            continue
        element = int(np.clip(np.searchsorted(breaks, s, side="right") - 1, 0, len(breaks) - 2))
        one, two = breaks[element], breaks[element + 1]
        xi = np.array([np.clip((2 * s - one - two) / (two - one), -1.0, 1.0)])
        along = nodal(group.table.along.shape[2] - 1, xi)
        section = sections(resonator, group.chain.element(element), xi, np.array([2 / (two - one)]))
        table = shell_table(section, system.n, system.level.through, (heights, np.ones(len(heights))), along)
        return CrossSection(number, element, np.stack([along.values[0], along.slopes[0]]), section, table)
    raise ShellError(
        f"the position {position:g} ({mm(s)} along the meridian) lies in a solid root, corner or clamp, where no mass can be placed: choose one on the shell, 1 for the rim."
    )


def free_edge(resonator: Resonator, system: System, position: float) -> tuple[CrossSection, Array]:
    """The edge where the meridian ends, at Gauss points through the wall, and the areas per radian that these stand for."""
    eta, weights = gauss(max(system.level.through) + 2)
    edge = cut(resonator, system, position, eta)
    return edge, edge.table.volume[0, 0] * weights
