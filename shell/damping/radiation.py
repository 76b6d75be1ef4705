"""Waves radiated through the base of a body: axisymmetric elasticity with an absorbing layer, at one harmonic n.

In the layer the coordinates become complex, r̃ = r - i ∫ b dr and z̃ likewise (perfectly matched: nothing is reflected at its
inner edge; Berenger 1994, for elastic waves Chew and Liu 1996, in axisymmetric elements Bindel and Govindjee 2005). Stiffness and
mass become complex and symmetric, and an eigenvalue λ = ω² of K v = λ M v has 1/Q = Im λ/Re λ. From v itself

    1/Q = (k_i m_r - k_r m_i)/(k_r m_r + k_i m_i),   k_r + i k_i = vᴴ K v,   m_r + i m_i = vᴴ M v,

where k_i and m_i are sums over the layer alone: a loss of 1e-15 is not drowned in the digits of λ.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shell.cells import cell_mass, cell_stiffness
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.kernel import lame
from shell.quadrature import Array
from shell.sparse import Index, factor_symmetric
from shell.system import ElementSum, ShellGroup, SolidGroup, System, restrict

Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
DEPTH = 12.0  # nepers that a shear wave loses on its way through the layer
SHIFTS = 4
ITERATIONS = 12  # at one shift


@dataclass(frozen=True)
class Layer:
    """An absorbing layer around a half-space: beyond `start` from the axis and from the surface, `width` wide, m."""

    start: float
    width: float
    surface: float  # height of the half-space's surface; `below` whether it fills z < surface
    below: bool
    wavelength: float  # of shear waves in it

    def stretch(self, distance: Array) -> tuple[Complex, Complex]:
        """1 - i b and -i ∫ b at distances from the axis or the surface; b grows as a square to the outer edge."""
        beyond = np.maximum(distance - self.start, 0.0) / self.width
        strength = 3 * DEPTH * self.wavelength / (2 * np.pi * self.width)
        turned = np.asarray(1 - 1j * strength * beyond**2, dtype=complex)
        return turned, np.asarray(-1j * strength * self.width * beyond**3 / 3, dtype=complex)


@dataclass(frozen=True)
class Radiating:
    """A mode that radiates: frequency (Hz), 1/Q, and the body's share of the kinetic energy."""

    frequency: float
    inverse_q: float
    body: float


@dataclass(frozen=True, eq=False)
class RadiatingBody:
    """Complex stiffness and mass of a body with its base, and the mass of the body alone."""

    system: System
    stiffness: ElementSum
    mass: ElementSum
    body: ElementSum

    def factor(self, shift: complex) -> Callable[[Complex], Complex]:
        """The solution of (K - shift M) x = b as a function of b."""
        parts = zip(self.stiffness.blocks, self.mass.blocks, strict=True)
        elements = (one for K, M in parts for one in K - shift * M)
        free = [restrict(one, to) for one, to in zip(elements, self.system.maps, strict=True)]
        return factor_symmetric(self.system.pattern.assemble(free), 1e-3)

    def judge(self, v: Complex, eigenvalue: complex) -> Radiating:
        """Frequency and loss of an eigenvector."""
        both = [(A, part) for A in (self.stiffness, self.mass) for part in (np.real, np.imag)]
        sums = [replace(A, blocks=tuple(part(block) for block in A.blocks)) for A, part in both]
        k_r, k_i, m_r, m_i, body = (float(np.vdot(v, A @ v).real) for A in (*sums, self.body))
        inverse_q = (k_i * m_r - k_r * m_i) / (k_r * m_r + k_i * m_i)
        return Radiating(float(np.sqrt(eigenvalue.real) / (2 * np.pi)), inverse_q, body / m_r)


def radiating_mode(waves: RadiatingBody, frequency: float) -> Radiating:
    """The mode nearest to a frequency (Hz) that moves the body."""
    shift = complex((2 * np.pi * frequency) ** 2)
    v = waves.body @ np.random.default_rng(0).standard_normal(waves.system.constraint.shape[1]).astype(complex)
    for _ in range(SHIFTS):
        solve, before = waves.factor(shift), shift
        for _ in range(ITERATIONS):
            v = solve(waves.mass @ (v / np.max(abs(v))))
            now = complex((v @ (waves.stiffness @ v)) / (v @ (waves.mass @ v)))
            if abs(now - before) < 1e-11 * abs(now):
                found = waves.judge(v, now)
                if found.body > 0.5:
                    return found
                break
            before = now
        shift = before
    raise ShellError(f"no mode of the resonator on its base converges near {frequency:.6g} Hz: use another stem or base.")  # fmt: skip


def assemble_waves(system: System, materials: Sequence[Elastic], bases: Sequence[Mask], layer: Layer) -> RadiatingBody:
    """Stiffness and mass of body and base; `bases` says of every group which of its elements belong to the base."""
    found = [_matrices(one, materials, base, layer, system.n) for one, base in zip(system.groups, bases, strict=True)]
    body = [np.where(base[:, None, None], 0.0, M) for base, (_, M) in zip(bases, found, strict=True)]
    return RadiatingBody(system, *(system.sum(blocks) for blocks in (*zip(*found, strict=True), body)))


def _matrices(
    group: ShellGroup | SolidGroup, materials: Sequence[Elastic], base: Mask, layer: Layer, n: int
) -> tuple[Complex, Complex]:
    """Stiffness and mass of every element."""
    if isinstance(group, ShellGroup):
        body = materials[0]
        lam, G = lame(np.array(body.E), np.array(body.nu), group.table.plane_stress)
        stiffness, mass = group.integrals(lam, G, np.array(body.rho))
        return stiffness.astype(complex), mass.astype(complex)
    E, nu, rho = (np.where(base, getattr(materials[1], x), getattr(materials[0], x)) for x in ("E", "nu", "rho"))
    lam, G = lame(E, nu, False)
    own = group.products
    K, M = (one.astype(complex) for one in (cell_stiffness(own, lam, G, n), cell_mass(own)))
    absorbs, products = _absorbing(group, base, layer)
    parts = [(1, np.ascontiguousarray(products.real)), (1j, np.ascontiguousarray(products.imag))]
    K[absorbs] = sum(unit * cell_stiffness(part, lam[absorbs], G[absorbs], n) for unit, part in parts)
    M[absorbs] = sum(unit * cell_mass(part) for unit, part in parts)
    return K, rho[:, None, None] * M


def _absorbing(group: SolidGroup, base: Mask, layer: Layer) -> tuple[Index, Complex]:
    """The cells of the absorbing layer, and their `CellTable.products` in complex coordinates."""
    z = group.places[1, :, 0]
    depth = (layer.surface - z) if layer.below else (z - layer.surface)
    by_r, to_r = layer.stretch(np.where(base[:, None], group.table.radius, 0.0))
    by_z, _ = layer.stretch(np.where(base[:, None], depth, 0.0))
    absorbs = np.flatnonzero((by_r.imag != 0).any(axis=1) | (by_z.imag != 0).any(axis=1))
    by_r, to_r, by_z = by_r[absorbs], to_r[absorbs], by_z[absorbs]
    r = group.table.radius[absorbs]
    radius = r + to_r
    stretched: dict[str, Any] = {
        "radius": radius,
        "gradients": group.table.gradients[absorbs] * np.stack([1 / by_r, 1 / by_z, r / radius], axis=1)[..., None],
        "volume": group.table.volume[absorbs] * (by_r * by_z * radius / r)[:, None],
    }
    products: Any = replace(group.table, **stretched).products(group.signs[absorbs])
    return absorbs, products
