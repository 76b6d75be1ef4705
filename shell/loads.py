r"""Static loads on a held resonator: acceleration, spin, the pressure around it, warmth; what they displace, stress, and do to a mode.

Loads and their answers are waves 0 and 1 around the axis, in the frame of the base, to first order:

    K u = ∫ f · ψ dV - ∫ p tr e(ψ) dV + ∫ 3 K β tr e(ψ) dV,      σ = C (e(u) - β),

f = -ρ a by an acceleration a of the base, ρ Ω² r by spin, p the pressure of what surrounds the body, β = ∫ α dT. A wave 0 changes the
mode (shell.prestress); pressure turns with the surface besides, which adds ∫ p [(tr H)² - tr H²] dV, H = ∇u of the mode. A wave
1 couples a pair only with the harmonics n ± 1, so that an acceleration across the axis has no effect of the first order on f.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin
from typing import Literal

import numpy as np

from shell.cells import CellTable, Reference, tabulate_cells
from shell.elastic import COSINE, SINE, Elastic
from shell.errors import ShellError
from shell.finite import displacement_gradients, solved_as_solid
from shell.inertia import MassProperties, weigh
from shell.kernel import NO_FORCE, NO_STRESS, TENSOR, StrainTable
from shell.modes import Mode
from shell.prestress import expansion_shares, mean_answer, neighbour, settle
from shell.quadrature import Array
from shell.solution import Solution, face_table, total
from shell.system import Group, System

Kind = Literal["axial", "lateral", "spin", "pressure", "cooling"]
WAVES: dict[Kind, int] = {"axial": 0, "lateral": 1, "spin": 0, "pressure": 0, "cooling": 0}
ALL_ROUND = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])[:, None]  # stress of a unit pressure
AZIMUTHS = np.linspace(0.0, pi, 13)
ACROSS = np.linspace(-1.0, 1.0, 9) * (1 - 1e-9)  # of a cell; its edges, but not the axis, where φ/r is 0/0


@dataclass(frozen=True)
class Peak:
    """Largest stress: `tension` the largest principal one, `mises` the largest von Mises stress, Pa, in its `part` (wall, root or stem)."""

    tension: float
    mises: float
    part: str

    @property
    def worst(self) -> float:
        """What a strength is to be compared with, the larger of both, Pa."""
        return max(self.tension, self.mises)


@dataclass(frozen=True)
class Sag:
    """How the rim (the end of the meridian that is not held) moves under a load, m, and how it tilts, rad."""

    axial: float
    lateral: float
    tilt: float


@dataclass(frozen=True, eq=False)
class Loads:
    """Answers of one resonator to unit loads, and what they do to one of its modes.

    Units: 1 m/s² of the base along +z (`axial`) and towards the azimuth 0 (`lateral`), 1 rad²/s² (`spin`), 1 Pa (`pressure`), and
    shrinking by 1 at the free end, evenly less along the meridian, 0 at the base (`cooling`).
    """

    mode: Mode
    elastic: Elastic

    def __post_init__(self) -> None:
        solved_as_solid(self.mode)
        if self.mode.resonator.support == "free":
            raise ShellError("a free resonator is held against no load: give it a support.")

    @cached_property
    def answers(self) -> dict[Kind, Solution]:
        """Static answer to each unit load."""
        return {kind: settle(system, self.mode, self.force(kind, system)) for kind, system in self._systems.items()}

    def shift(self, kind: Kind) -> float:
        """δ ln f of the mode by a unit load, in the frame of the base; of spin the stress alone (shell.spin has all of it)."""
        solution = solved_as_solid(self.mode)
        if WAVES[kind] or self.mode.harmonic < 1:
            return 0.0
        if kind == "cooling":
            return -float(expansion_shares(self.mode) @ self.away(self.mode.along.position))
        work = 4 * float(self._answer.vector @ self.force(kind, self._systems[kind]))
        if kind == "pressure":
            for group, q in zip(solution.system.groups, solution.unknowns, strict=True):
                H = displacement_gradients(solution.system, group, q)
                turned = np.einsum("esiip->esp", H) ** 2 - np.einsum("esijp,esjip->esp", H, H)
                work += float(np.sum(turned * group.table.volume))
        return work / (2 * solution.eigenvalue * total(solution.kinetic))

    def force(self, kind: Kind, system: System) -> Array:
        """Load vector of a unit load."""
        rho, bulk = self.elastic.rho, self.elastic.E / (3 * (1 - 2 * self.elastic.nu))
        found = []
        for group in system.groups:
            shape, stress, force = group.table.volume.shape, NO_STRESS, NO_FORCE
            if kind == "pressure":
                stress = ALL_ROUND + NO_STRESS
            elif kind == "cooling":
                stress = 3 * bulk * self.away(group.table.position)[..., None, None] * ALL_ROUND
            elif kind == "spin":
                force = directed(group, rho * group.places[0])
            elif kind == "axial":
                force = directed(group, np.full(shape, -rho), 1)
            else:
                force = directed(group, np.full(shape, -rho))
                force[:, :, 1] = rho
            found.append(-group.table.loads(stress, force))
        return system.gather(found)

    def peak(self, amounts: dict[Kind, float]) -> Peak:
        """Largest stresses of the parts that are `counted` under so many units of each load at once."""
        stresses = [self._stress(kind, amount) for kind, amount in amounts.items() if amount]
        tension, mises = 0.0, (0.0, "wall")
        for k, part in enumerate(group.parts for group in self._systems["axial"].groups):
            if not set(part) & set(self.counted):
                continue
            for theta in AZIMUTHS if amounts.get("lateral") else (0.0,):
                here: Array = np.zeros(1)
                for wave, of in stresses:
                    turned = of[k].copy()
                    turned[:, :, COSINE] *= cos(wave * theta)
                    turned[:, :, SINE] *= sin(wave * theta) if wave else 1.0
                    here = here + turned
                if here.ndim == 1:
                    continue
                square = here[:, :, TENSOR].transpose(0, 1, 4, 2, 3)
                one, two, three = np.linalg.eigvalsh(square).T
                bent = np.sqrt(((one - two) ** 2 + (two - three) ** 2 + (three - one) ** 2) / 2).T
                for name in sorted(set(part) & set(self.counted)):
                    chosen = np.array([p == name for p in part])
                    tension = max(tension, float(three.T[chosen].max()))
                    mises = max(mises, (float(bent[chosen].max()), name))
        return Peak(tension, *mises)

    def sag(self, amounts: dict[Kind, float]) -> Sag:
        """Displacement of the rim's middle surface under loads, and its tilt, the slope of its axial displacement."""
        axial = lateral = tilt = 0.0
        for kind, amount in amounts.items():
            outwards, along_axis, radius = self._rim(self.answers[kind])
            if WAVES[kind]:
                lateral, tilt = lateral + amount * outwards, tilt + amount * along_axis / radius
            else:
                axial += amount * along_axis
        return Sag(axial, lateral, tilt)

    def gap(self, kind: Kind, first: float, last: float) -> float:
        """Mean displacement of the wall outwards between two positions, m per unit, at azimuth 0."""
        solution, sums = self.answers[kind], np.zeros(2)
        for k, group in solution.system.chains.items():
            inside = (group.table.position >= first) & (group.table.position <= last)
            weight = group.table.volume * inside[..., None]
            sums += np.sum(weight * solution.displacement[k][:, :, 2]), np.sum(weight)
        if not sums[1]:
            raise ShellError(f"no part of the wall lies between the positions {first:g} and {last:g}.")
        return self.mode.resonator.outward * float(sums[0] / sums[1])

    def away(self, position: Array) -> Array:
        """0 at the base and in the solid part that it holds, 1 at the free end, even along the meridian between."""
        solids = [g.table.position[0, 0] for g in self._systems["axial"].solids.values()]
        far, ends = position, solids
        if self.mode.resonator.support == "clamped-rim":
            far, ends = 1 - position, [1 - one for one in solids]
        base = min(ends, default=0.0)
        return np.asarray(np.maximum(far - base, 0.0) / (1 - base))

    @property
    def counted(self) -> tuple[str, ...]:
        """Parts whose stresses count: at sharp corners and rigid clamps a linear elastic stress is not finite."""
        stem = self.mode.resonator.stem
        return ("wall", "root") if stem and stem.fillet else ("wall",)

    @cached_property
    def mass(self) -> MassProperties:
        """Of the whole body."""
        return weigh(self.mode.resonator, self.elastic.rho)

    def beam(self, axial: float, lateral: float) -> float:
        """Stress at the clamped end of a single stem as of a beam, N/A + M r/I with the weight of all; 0 without such a stem."""
        stem = self.mode.resonator.stem
        if stem is None or len(stem.roots) != 1:
            return 0.0
        a, arm = stem.radius, abs(self.mass.center - stem.roots[0][1])
        return self.mass.mass * (abs(axial) / (pi * a**2) + abs(lateral) * arm * 4 / (pi * a**3))

    @cached_property
    def _systems(self) -> dict[Kind, System]:
        waves = {wave: neighbour(self.mode, wave) for wave in (0, 1)}
        return {kind: waves[wave] for kind, wave in WAVES.items()}

    @cached_property
    def _answer(self) -> Solution:
        return mean_answer(self.mode)[0]

    def _stress(self, kind: Kind, amount: float) -> tuple[int, list[Array]]:
        solution, found = self.answers[kind], []
        for k, (c, q) in enumerate(zip(solution.constants, solution.unknowns, strict=True)):
            table = _edges(solution, k)
            stress = c.stress(table, table.strains(q))
            if kind == "cooling":
                lam, G = c.lame
                stress[:, :, :3] += ((3 * lam + 2 * G) * self.away(table.position))[..., None, None]
            found.append(amount * stress)
        return WAVES[kind], found

    def _rim(self, solution: Solution) -> tuple[float, float, float]:
        """Displacement along r and z of the middle surface next to the free end of the wall, and its radius."""
        chains = solution.system.chains
        far = {k: self.away(group.table.position) for k, group in chains.items()}
        k = max(chains, key=lambda k: far[k].max())
        group, (e, s) = chains[k], np.unravel_index(int(np.argmax(far[k])), far[k].shape)
        weight, section = group.table.volume[e, s], group.section
        u, _, w = solution.displacement[k][e, s] @ weight / weight.sum()
        t_r, t_z = section.tangent_r[e, s], section.tangent_z[e, s]
        return float(t_r * u - t_z * w), float(t_z * u + t_r * w), float(section.r[e, s])


def directed(group: Group, amount: Array, axis: int = 0) -> Array:
    """A vector field along r (axis 0) or z (1), in the axes of a group: (elements, stations, 3, points)."""
    field = np.zeros((*amount.shape[:2], 3, amount.shape[2]))
    field[:, :, 0], field[:, :, 2] = group.axes[axis] * amount
    return field


def _edges(solution: Solution, number: int) -> StrainTable | CellTable:
    if number in solution.system.chains:
        return face_table(solution, number)
    group = solution.system.solids[number]
    mesh, degree = group.mesh, group.mesh.grid.shape[2] - 1
    place = Reference.at(ACROSS, ACROSS, np.ones((len(ACROSS),) * 2), degree, degree)
    return tabulate_cells(mesh.grid, place, solution.system.n, float(group.table.position[0, 0]))
