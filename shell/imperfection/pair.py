r"""What each place of a harmonic pair contributes to its mean shift and to its split (degenerate perturbation, first order).

The two modes of a pair, cos nθ and sin nθ, share ω². Energies of the first vary as e_c cos² nθ + e_s sin² nθ, of the second
with cos and sin exchanged, and those between them as (e_c - e_s) sin nθ cos nθ. So of a field p = Re Σ c_m exp(-i m θ) that
multiplies an energy only two waves are felt,

    δ(ω²) = c_0 Σ (e_c + e_s)/T ± |z|,   z = ½ c_2n Σ (e_c - e_s)/T,

with T = ∫ ρ (u_c² + u_s²) over the section. The mode of higher frequency has its antinode where 2n α = arg z. A face that moves brings
the energy density at the face (Hadamard's formula); masses bring -ω² times their kinetic energy.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shell.cross_section import CrossSection, cut, free_edge
from shell.elastic import Constants
from shell.errors import ShellError
from shell.imperfection.field import Field
from shell.imperfection.imperfect import fade
from shell.modes import Mode
from shell.quadrature import Array
from shell.resonator import FaceName, Resonator
from shell.solution import Solution, squares_of, surface_energies, total


@dataclass(frozen=True, eq=False)
class Density:
    """Change of ln ω² per unit of a field at stations (position 0 ... 1): of the `mean`, and of z with the `wave` 2n."""

    position: Array
    mean: Array
    wave: Array

    def apply(self, field: Field, harmonic: int) -> tuple[float, complex]:
        """The mean shift and z, both relative to ω²."""
        mean = float(self.mean @ field.wave(0, self.position).real)
        return mean, complex(self.wave @ field.wave(2 * harmonic, self.position))


@dataclass(frozen=True, eq=False)
class Pair:
    """A solved mode n >= 1 as a degenerate pair, with the effect of every kind of imperfection."""

    mode: Mode

    def __post_init__(self) -> None:
        if self.mode.harmonic < 1:
            raise ShellError("a mode with n = 0 is single and cannot split: choose a harmonic from 1 up.")
        _ = self.solution  # of Rayleigh's closed form there is none

    @property
    def solution(self) -> Solution:
        """The eigenvector."""
        return self.mode.solution

    @property
    def resonator(self) -> Resonator:
        """The body of revolution."""
        return self.mode.resonator

    @cached_property
    def scale(self) -> float:
        """ω² T: twice the kinetic energy, which is twice the strain energy."""
        return self.solution.eigenvalue * total(self.solution.kinetic)

    @cached_property
    def fade(self) -> Callable[[Array], Array] | None:
        """Factor with which the faces of the shell join solid parts and clamps, which keep their shape."""
        return fade(self.resonator, self.solution.system)

    @cached_property
    def faces(self) -> tuple[Density, Density]:
        """Per metre that the inner and the outer face stand out of the material; solid roots and corners are left out."""
        walls = [(g, surface_energies(self.solution, k)) for k, g in self.solution.system.chains.items()]
        inner, outer = (
            [
                _columns(g.table.position, 2 / g.section.thickness[..., None], *(e[..., k : k + 1] for e in energies))
                for g, energies in walls
            ]
            for k in (0, 1)[:: self.resonator.outward]
        )
        return _gather(inner, self.scale), _gather(outer, self.scale)

    @cached_property
    def density(self) -> Density:
        """Per unit relative change of ρ."""
        found = []
        for group, c, d in zip(
            self.solution.system.groups, self.solution.constants, self.solution.displacement, strict=True
        ):
            heavy = -self.solution.eigenvalue * c.rho[..., None] * group.table.volume
            found.append(_columns(group.table.position, heavy, *squares_of(d)))
        return _gather(found, self.scale)

    @cached_property
    def modulus(self) -> Density:
        """Per unit relative change of E at constant ν."""
        found = []
        for group, c, e in zip(self.solution.system.groups, self.solution.constants, self.solution.strain, strict=True):
            found.append(_columns(group.table.position, group.table.volume, *c.parts(group.table, e)))
        return _gather(found, self.scale)

    def rim(self) -> Density:
        """Per metre that the edge of the rim stands out along the meridian: the energies of the edge, free of traction."""
        edge, area = self._edge()
        mean, wave = self._of_material(edge, 2 * np.pi * float(self._material(edge).rho[0, 0]) * area)
        return Density(np.ones(1), np.array([mean]), np.array([wave]) / 2)

    def mass(self, position: float = 1.0, height: float = 0.0) -> tuple[float, float]:
        """Per kilogram of a point mass at a height -1 (inner) ... 1 (outer face): the mean shift, and z for the azimuth 0, exp(2 i n θ) at θ: -ω² m (u_c² cos² + u_s² sin²)."""
        here = cut(self.resonator, self.solution.system, position, np.array([self.resonator.outward * height]))
        u, v, w = here.displacements(self.solution.unknowns)[:, 0]
        norm = -self.solution.eigenvalue / (np.pi * self.scale)
        return float(norm * (u**2 + w**2 + v**2) / 2), float(norm * (u**2 + w**2 - v**2) / 2)

    def shaving(self, position: float, face: FaceName) -> tuple[float, float]:
        """Like `mass` for a kilogram of material on a face with its strain energy: a shallow cut."""
        here = cut(self.resonator, self.solution.system, position, np.array([float(self.resonator.height_of(face))]))
        return self._of_material(here, np.ones(1))

    def edging(self) -> tuple[float, float]:
        """Like `mass` for a kilogram of material on the edge of the rim, over the whole wall."""
        edge, area = self._edge()
        return self._of_material(edge, area / area.sum())

    def _edge(self) -> tuple[CrossSection, Array]:
        """The edge of the rim, and the areas per radian that its heights stand for."""
        if self.resonator.support == "clamped-rim" or self.resonator.ends_on_axis:
            raise ShellError("the meridian has no free rim, so no edge that could depart.")
        return free_edge(self.resonator, self.solution.system, 1.0)

    def _of_material(self, here: CrossSection, share: Array) -> tuple[float, float]:
        e, d = (find(self.solution.unknowns)[None, None] for find in (here.strains, here.displacements))
        c = self._material(here)
        heavy = self.solution.eigenvalue * c.rho[..., None]
        pairs = zip(c.parts(here.table, e), squares_of(d), strict=True)
        one, two = (float(np.sum(share * (energy - heavy * square))) for energy, square in pairs)
        norm = 1 / (2 * np.pi * self.scale * float(c.rho[0, 0]))
        return norm * (one + two), norm * (one - two)

    def _material(self, edge: CrossSection) -> Constants:
        return self.solution.constants[edge.group].at((slice(edge.element, edge.element + 1), slice(-1, None)))


def _columns(position: Array, volume: Array, cosine: Array, sine: Array) -> Array:
    integrals = [np.sum(volume * energy, axis=-1) for energy in (cosine, sine)]
    return np.array([np.broadcast_to(position, integrals[0].shape).ravel(), *(one.ravel() for one in integrals)])


def _gather(found: list[Array], scale: float) -> Density:
    position, cosine, sine = np.concatenate(found, axis=1)
    return Density(position, (cosine + sine) / scale, (cosine - sine) / (2 * scale))
