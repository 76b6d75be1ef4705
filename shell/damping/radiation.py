"""Waves radiated through the base of a body: axisymmetric elasticity with an absorbing layer, at one harmonic n.

In the layer the coordinates become complex, r̃ = r - i ∫ b dr and z̃ likewise (perfectly matched: nothing is reflected at its
inner edge; Berenger 1994, for elastic waves Chew and Liu 1996, in axisymmetric elements Bindel and Govindjee 2005). Stiffness and
mass become complex and symmetric, and an eigenvalue λ = ω² of K v = λ M v has 1/Q = Im λ/Re λ. From v itself

    1/Q = (k_i m_r - k_r m_i)/(k_r m_r + k_i m_i),   k_r + i k_i = vᴴ K v,   m_r + i m_i = vᴴ M v,

where k_i and m_i are sums over the layer alone: a loss of 1e-15 is not drowned in the digits of λ.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from shell.cells import at_gauss_points, cell_mass, cell_stiffness
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.kernel import lame
from shell.quadrature import Array
from shell.sparse import assemble_elements, factor_symmetric
from shell.system import ShellGroup, SolidGroup, System

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
    """Complex stiffness and mass of body and base on free unknowns, and the body's part of the mass."""

    stiffness: "scipy.sparse.csc_matrix"
    mass: "scipy.sparse.csc_matrix"
    body: "scipy.sparse.csc_matrix"

    def factor(self, shift: complex) -> Callable[[Complex], Complex]:
        """The solution of (K - shift M) x = b as a function of b."""
        return factor_symmetric(self.stiffness - shift * self.mass, 1e-3)

    def judge(self, v: Complex, eigenvalue: complex) -> Radiating:
        """Frequency and loss of an eigenvector."""
        k_r, k_i, m_r, m_i, body = (
            float(np.real(np.conj(v) @ (A @ v)))
            for A in (self.stiffness.real, self.stiffness.imag, self.mass.real, self.mass.imag, self.body.real)
        )
        inverse_q = (k_i * m_r - k_r * m_i) / (k_r * m_r + k_i * m_i)
        return Radiating(float(np.sqrt(eigenvalue.real) / (2 * np.pi)), inverse_q, body / m_r)


def radiating_mode(waves: RadiatingBody, frequency: float) -> Radiating:
    """The mode nearest to a frequency (Hz) that moves the body."""
    shift = complex((2 * np.pi * frequency) ** 2)
    start = np.random.default_rng(0).standard_normal(waves.body.shape[0])
    v: Complex = np.asarray(waves.body @ start, dtype=complex)
    for _ in range(SHIFTS):
        solve, before = waves.factor(shift), shift
        for _ in range(ITERATIONS):
            v = solve(np.asarray(waves.mass @ (v / np.max(abs(v))), dtype=complex))
            now = complex((v @ (waves.stiffness @ v)) / (v @ (waves.mass @ v)))
            if abs(now - before) < 1e-12 * abs(now):
                found = waves.judge(v, now)
                if found.body > 0.5:
                    return found
                break
            before = now
        shift = before
    raise ShellError(
        f"no mode of the resonator on its base converges near {frequency:.6g} Hz: use another stem or base."
    )


def assemble_waves(system: System, materials: Sequence[Elastic], bases: Sequence[Mask], layer: Layer) -> RadiatingBody:
    """Stiffness and mass of body and base; `bases` says of every group which of its cells belong to the base."""
    P, size = system.constraint.astype(complex), system.constraint.shape[0]
    total: list[scipy.sparse.csc_matrix] = [scipy.sparse.csc_matrix((size, size), dtype=complex) for _ in range(3)]
    for group, base in zip(system.groups, bases, strict=True):
        for k, elements in enumerate(_matrices(group, materials, base, layer, system.n)):
            total[k] = total[k] + assemble_elements(group.unknowns, elements, size)
    return RadiatingBody(*(scipy.sparse.csc_matrix(P.T @ one @ P) for one in total))


def _matrices(
    group: ShellGroup | SolidGroup, materials: Sequence[Elastic], base: Mask, layer: Layer, n: int
) -> tuple[Complex, Complex, Complex]:
    """Stiffness, mass, and the body's mass of every element."""
    if isinstance(group, ShellGroup):
        body = materials[0]
        lam, G = lame(np.array(body.E), np.array(body.nu), group.table.plane_stress)
        trace, sheared, mass = group.units
        K, M = (lam * trace + G * sheared).astype(complex), (body.rho * mass).astype(complex)
        return K, M, M
    E, nu, rho = (np.where(base, getattr(materials[1], x), getattr(materials[0], x)) for x in ("E", "nu", "rho"))
    lam, G = lame(E, nu, False)
    products = _products(group, base, layer)
    real, imaginary = np.asarray(products.real, dtype=float), np.asarray(products.imag, dtype=float)
    K = cell_stiffness(real, lam, G, n) + 1j * cell_stiffness(imaginary, lam, G, n)
    M = rho[:, None, None] * (cell_mass(real) + 1j * cell_mass(imaginary))
    return np.asarray(K, dtype=complex), np.asarray(M, dtype=complex), np.where(base[:, None, None], 0.0, M)


def _products(group: SolidGroup, base: Mask, layer: Layer) -> Complex:
    """See `CellTable.products`; in the absorbing layer with complex coordinates."""
    table, grid = group.table, group.place.mesh.grid
    degree = grid.shape[2] - 1
    place = at_gauss_points(degree, degree, degree + 2)
    z = (place.along.values @ grid[1] @ place.across.values.T).reshape(len(base), -1)
    depth = (layer.surface - z) if layer.below else (z - layer.surface)
    by_r, to_r = layer.stretch(np.where(base[:, None], table.radius, 0.0))
    by_z, _ = layer.stretch(np.where(base[:, None], depth, 0.0))
    radius = table.radius + to_r
    scale = np.stack([1 / by_r, 1 / by_z, table.radius / radius], axis=1)[..., None]
    gradients = table.gradients * scale * group.place.signs[:, None, None]
    volume = table.volume[:, 0] * by_r * by_z * radius / table.radius
    cells, _, _, functions = gradients.shape
    found = np.empty((cells, 10, functions, functions), dtype=complex)
    np.matmul(
        np.swapaxes(gradients, 2, 3)[:, :, None],
        (gradients * volume[:, None, :, None])[:, None],
        out=found[:, :9].reshape(cells, 3, 3, functions, functions),
    )
    moved = gradients[:, 2] * radius[..., None]
    np.matmul(np.swapaxes(moved, 1, 2), moved * volume[..., None], out=found[:, 9])
    return np.asarray(found.reshape(cells, 10, functions**2), dtype=complex)
