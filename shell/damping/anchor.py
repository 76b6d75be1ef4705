"""Anchor loss: the energy that a mode radiates through its stem into the base."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from shell.assembly import assemble, lay_resonator
from shell.blocks import mesh_solid
from shell.cross_section import cut
from shell.damping.radiation import Layer, Radiating, RadiatingBody, assemble_waves, radiating_mode
from shell.elastic import Elastic, VaryingElastic
from shell.errors import ShellError
from shell.modes import Mode
from shell.patches import Patch, box, whole
from shell.quadrature import Array
from shell.resonator import Resonator
from shell.solution import Solution, total
from shell.system import System

GROWTH = 6.0  # of the cells away from the stem
PER_WAVE = 3  # cells over a shear wavelength
LAYER = 3  # cells across the absorbing layer


def anchor_loss(mode: Mode, elastic: Elastic | VaryingElastic, base: Elastic | None = None) -> Radiating:
    """Solve the mode with its stem on an elastic half-space (`base`, else the resonator's material), which absorbs
    waves, instead of a clamp.

    With n >= 2 the motion dies out along the stem as exp(-1.8 z/a) or faster; n = 0 and 1 arrive as a force (`unbalance_loss`).
    """
    _, waves = _stand(mode, elastic, base, _solved(mode).system.n)
    return radiating_mode(waves, mode.frequency)


@dataclass(frozen=True)
class Unbalance:
    """Loss of a mode n = 2 by an unbalanced rim: α₁₁, α₃₃ and α₁₃ of 1/Q, per kg².

    With u_k = Σ m exp(ikθ) of masses on the rim (kg), k = 1 and 3, a pattern with an antinode at θ₀ loses

        1/Q = α₁₁ |u₁|² + α₃₃ |u₃|² + 2 α₁₃ Re(u₁ u₃ exp(-4iθ₀)):

    both harmonics together make the damping differ around.
    """

    first: float
    third: float
    joint: float

    def inverse_q(self, first: complex, third: complex) -> float:
        """1/Q, the mean over the azimuths of the pattern."""
        return self.first * abs(first) ** 2 + self.third * abs(third) ** 2

    def wave(self, first: complex, third: complex) -> complex:
        """Δ(1/Q) exp(4iθ_τ) between the pattern that is damped most, at θ_τ, and the one across."""
        return 4 * self.joint * first * third


def unbalance_loss(mode: Mode, elastic: Elastic | VaryingElastic) -> Unbalance:
    """Loss of a mode n = 2 through its stem, due to an unbalanced rim.

    Masses that move with the mode push the motion of n = 1, which reaches the base: of a mass density with the wave k around,
    (K₁ - ω² M₁) v_k = ω² L_k with L_k = (1/2π)(w₂ w₁ ± v₂ v₁ + z₂ z₁) at the rim, + for k = 1 and - for k = 3, and
    α_kl = -Im(L_kᵀ v_l)/∫ ρ |u₂|² dV.
    """
    solution = _solved(mode)
    if solution.system.n != 2:
        raise ShellError("only the first and third harmonics of the rim's mass couple a mode with n = 2 to the stem.")
    system, waves = _stand(mode, elastic, None, 1)
    radial, around, axial = _rim(mode.resonator, solution.system) @ solution.vector
    loads = np.array([[radial, sign * around, axial] for sign in (1, -1)]) @ _rim(mode.resonator, system) / (2 * np.pi)
    solve = waves.factor(complex(solution.eigenvalue))
    moved = np.array([solve((solution.eigenvalue * load).astype(complex)) for load in loads])
    alpha = -np.imag(loads @ moved.T) / total(solution.kinetic)
    return Unbalance(float(alpha[0, 0]), float(alpha[1, 1]), float(alpha[0, 1]))


def _solved(mode: Mode) -> Solution:
    if mode.resonator.stem is None:
        raise ShellError("anchor loss needs a resonator on a stem.")
    return mode.solution


def _stand(mode: Mode, elastic: Elastic | VaryingElastic, base: Elastic | None, n: int) -> tuple[System, RadiatingBody]:
    """The resonator on its half-space, for motion of harmonic n at the mode's frequency."""
    resonator, solution = mode.resonator, _solved(mode)
    assert resonator.stem is not None
    if len(resonator.stem.roots) != 1 or not isinstance(elastic, Elastic):
        raise ShellError("anchor loss is computed for one stem of one material.")
    base = base or elastic
    ((face, end),) = resonator.stem.roots
    level = solution.system.level
    if n < 2:  # what arrives at the base bends its edge: graded cells there, of lower degree
        level = replace(level, block=4, rings=2)
    layout = lay_resonator(resonator, n, level)
    (root, tied), *others = layout.solids
    r, z = mesh_solid(root, 1).points
    at_end = np.sort(r[abs(z - end) < 1e-9 * r.max()])  # radii where the cells of the stem meet at its end
    radii = [0.0, *at_end[at_end > 1e-9 * r.max()].tolist()]
    wavelength = float(np.sqrt(base.G / base.rho)) / mode.frequency
    patches, layer = lay_half_space(radii, end, face < 0, wavelength)
    far = layer.start + layer.width

    def held(r: float, z: float) -> bool:
        return abs(r - far) < 1e-9 * far or abs(abs(z - end) - far) < 1e-9 * far

    standing = replace(root, patches=(*root.patches, *patches), held=held)
    system = assemble(resonator, replace(layout, solids=((standing, tied), *others)), n, level)
    bases = [np.array(group.parts) == "base" for group in system.groups]
    return system, assemble_waves(system, (elastic, base), bases, layer)


def _rim(resonator: Resonator, system: System) -> Array:
    """Radial, circumferential and axial motion of the middle surface at the free rim, as rows over the free unknowns."""
    if [*system.chains.values()][-1].chain.ends[1] != "free":
        raise ShellError("an imbalance of the rim needs a free rim.")
    rim = cut(resonator, system, 1.0, np.zeros(1))
    along, turned, normal = rim.rows(system.plain[rim.group])
    t_r, t_z = float(rim.section.tangent_r[0, 0]), float(rim.section.tangent_z[0, 0])
    return np.array([t_r * along - t_z * normal, turned, t_z * along + t_r * normal])


def lay_half_space(radii: list[float], surface: float, below: bool, wavelength: float) -> tuple[list[Patch], Layer]:
    """Cells of a half-space whose surface carries a stem."""
    radius, step = radii[-1], radii[-1] - radii[-2]
    start, width = max(4 * radius, 0.5 * wavelength), wavelength
    columns = [*radii, *_grow(radius, step, start, wavelength), *(start + width * np.arange(1, LAYER + 1) / LAYER)]
    rows = [0.0, *_grow(0.0, step, start, wavelength), *(start + width * np.arange(1, LAYER + 1) / LAYER)]
    sign = -1.0 if below else 1.0
    patches = []
    for r_in, r_out in pairwise(columns):
        for near, far in pairwise(rows):
            low, high = sorted((surface + sign * near, surface + sign * far))
            patches.append(box((r_in, low), (r_out, high), whole(), "base"))
    return patches, Layer(start, width, surface, below, wavelength)


def _grow(first: float, step: float, last: float, wavelength: float) -> list[float]:
    """Places from `first` (left out) to `last`, in steps that grow up to a part of the wavelength."""
    at = [first]
    while at[-1] + 1.5 * step < last:
        at.append(at[-1] + step)
        step = min(GROWTH * step, wavelength / PER_WAVE)
    return [*at[1:], last]
