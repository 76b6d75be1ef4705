"""A reduced basis of shell modes: a few snapshots span the modes of a whole box of designs.

The reduced stiffness and mass are sums over the stations of odd powers of the thickness there; a small set of these
powers, at stations chosen greedily, reproduces them. Solid parts add polynomials of what shapes them. So the matrices
of many designs come out of one product.
The residual of the reduced mode is tested on further snapshots W, in the norm of their own energies:

    δ = Σ_w r_w² / (K_ww - μ M_ww),   r = (K - μ M) V c,   μ = min over c of the Rayleigh quotient in V.

δ is the first-order distance of μ from the eigenvalue: it is subtracted, and it is the error estimate.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import eigh

from shell.designs import Designs
from shell.interpolated import Polynomials, Solids
from shell.kernel import lame
from shell.quadrature import Array
from shell.system import Pair

CHUNK = 1536  # designs that are evaluated together; fixed, so that a design's numbers never depend on its company
MOST_FEATURES = 160


@dataclass(frozen=True, eq=False)
class Features:
    """Powers of the thickness at chosen stations: h = h_0 (base + slopes @ amplitudes), features h, h³, h⁵, …

    places : for each power, rows of `base` and `slopes`.
    """

    base: Array
    slopes: Array
    places: tuple[np.ndarray, ...]

    def evaluate(self, thickness: Array, amplitudes: Array) -> Array:
        """Features (features, designs) of thicknesses (designs,) over the reference and amplitudes (shapes, designs)."""
        h = (self.base[:, None] + self.slopes @ amplitudes) * thickness
        square = h * h
        powers = [h]
        for _ in self.places[1:]:
            powers.append(powers[-1] * square)
        return np.concatenate([power[rows] for power, rows in zip(powers, self.places, strict=True)])


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """The operators of one box of designs on V (r vectors) and W, as products with the features.

    solids : the polynomials e of the solid parts.
    stiffness : rows for the packed lower triangle of Vᵀ K V, Wᵀ K V (v by v) and diag Wᵀ K W; columns for [e, g, τ g]
        with τ = λ/G, per unit G.
    mass : the same rows of M, columns for the leading part of [e, g], per unit density.
    start : V-coefficients of the mode, the first being 1, as a linear function of [e, g, τ g].
    reference : thickness that features are measured in, m.
    iterations : of inverse iteration, each of which takes (ω_1/ω_2)² off the error of the starting vector.
    slope, floor : the stated relative error of ω² is slope δ/μ + floor, from designs solved in full.

    The precision of the matrices is that of the arithmetic; the stated error holds what it does.
    """

    solids: tuple[Polynomials, ...]
    features: Features
    stiffness: Array
    mass: Array
    start: Array
    size: int
    tests: int
    reference: float
    iterations: int
    slope: float
    floor: float

    def evaluate(
        self, thickness: Array, amplitudes: Array, stem: Array, nu: Array, ratio: Array
    ) -> tuple[Array, Array]:
        """ω² ρ/G of one chunk and its relative error estimate.

        Parameters
        ----------
        thickness : m, (CHUNK,).
        amplitudes : (shapes, CHUNK).
        stem : (CHUNK,).
        nu, ratio : ν and λ/G, (CHUNK,); λ is that of plane stress in shell theory.
        """
        r, w = self.size, self.tests
        terms = self.terms(thickness, amplitudes, stem, nu, ratio).astype(self.stiffness.dtype, copy=False)
        K, M = self.stiffness @ terms, self.mass @ terms[: self.mass.shape[1]]
        packed = r * (r + 1) // 2
        c = self.start @ terms
        with np.errstate(invalid="ignore", divide="ignore"):  # an indefinite stiffness gives no number
            L = factor(K[:packed], r)
        for _ in range(self.iterations):
            loaded = multiply(M[:packed], c, r)
            c = substitute(L, loaded)
        energy = np.add.reduce(c * loaded)
        mu = energy / np.add.reduce(c * multiply(M[:packed], c, r))
        residual, inertia = K[packed : packed + w] * c[0], M[packed : packed + w] * c[0]
        for v in range(1, r):
            rows = slice(packed + v * w, packed + (v + 1) * w)
            residual += K[rows] * c[v]
            inertia += M[rows] * c[v]
        residual -= mu * inertia
        gaps = K[-w:] - mu * M[-w:]
        delta = np.add.reduce(residual * residual / gaps) / energy  # relative to μ
        return (mu * (1 - delta)).astype(float), self.slope * delta.astype(float) + self.floor

    def with_precision(self, kind: type[np.floating[Any]], iterations: int) -> "ReducedModel":
        """The same operators in another precision, with another number of iterations."""
        matrices = {name: getattr(self, name).astype(kind) for name in ("stiffness", "mass", "start")}
        return replace(self, **matrices, iterations=iterations)

    def terms(self, thickness: Array, amplitudes: Array, stem: Array, nu: Array, ratio: Array) -> Array:
        """The terms [e, g, τ g] (terms, designs)."""
        g = self.features.evaluate(thickness / self.reference, amplitudes)
        e = [one.evaluate(thickness, amplitudes, stem, nu) for one in self.solids]
        return np.concatenate([*e, g, ratio * g])


def factor(K: Array, r: int) -> Array:
    """Cholesky of packed symmetric matrices (columns of the lower triangle, designs), many at once; in place.

    The diagonal holds the inverse of Cholesky's.
    """
    starts = _column_starts(r)
    for j in range(r):
        column = K[starts[j] : starts[j] + r - j]
        np.sqrt(column[0], out=column[0])
        np.divide(1.0, column[0], out=column[0])
        column[1:] *= column[0]
        for k in range(j + 1, r):
            K[starts[k] : starts[k] + r - k] -= column[k - j :] * column[k - j]
    return K


def substitute(L: Array, load: Array) -> Array:
    """Solve K x = load with the factor."""
    r = len(load)
    starts = _column_starts(r)
    x = load.copy()
    for j in range(r):
        x[j] *= L[starts[j]]
        x[j + 1 :] -= L[starts[j] + 1 : starts[j] + r - j] * x[j]
    for j in reversed(range(r)):
        x[j] -= np.add.reduce(L[starts[j] + 1 : starts[j] + r - j] * x[j + 1 :])
        x[j] *= L[starts[j]]
    return x


def multiply(M: Array, x: Array, r: int) -> Array:
    """M x of packed symmetric matrices."""
    starts = _column_starts(r)
    y = np.zeros_like(x)
    for j in range(r):
        column = M[starts[j] : starts[j] + r - j]
        y[j:] += column * x[j]
        y[j] += np.add.reduce(column[1:] * x[j + 1 :])
    return y


def _column_starts(r: int) -> list[int]:
    return [j * r - j * (j - 1) // 2 for j in range(r)]


@dataclass(frozen=True, eq=False)
class Snapshots:
    """Designs that were solved: ω² for E = ρ = 1, vectors."""

    designs: Designs
    eigenvalues: Array
    vectors: Array

    def __len__(self) -> int:
        return len(self.designs)


def solve_all(solids: Solids, designs: Designs) -> Snapshots:
    """Solve every design with the unknowns of all shell elements."""
    pairs = solids.at(designs)
    found = [
        solids.shell.solve(h, float(nu), pair)
        for h, nu, pair in zip(solids.box.profile(designs), designs.nu, pairs, strict=True)
    ]
    return Snapshots(designs, np.array([value for value, _ in found]), np.array([vector for _, vector in found]))


def span(solids: Solids, snapshots: Snapshots, most: int) -> Array:
    """The leading directions of the snapshots, orthonormal in the strain energy of the first one (POD)."""
    vectors, first = snapshots.vectors.T, snapshots.designs.part(slice(0, 1))
    X = solids.shell.strain_energy(vectors, solids.box.profile(first)[0], float(first.nu[0]), solids.at(first)[0])
    scale = 1 / np.sqrt(np.diag(X))
    values, turn = np.linalg.eigh(X * scale * scale[:, None])
    kept = slice(len(values) - 1, len(values) - 1 - min(most, int(np.sum(values > 1e-11 * values[-1]))), -1)
    return np.asarray(vectors @ (scale[:, None] * turn[:, kept] / np.sqrt(values[kept])))


@dataclass(frozen=True, eq=False)
class Projected:
    """VᵀAV of the station energies per unit λ, G, ρ: (nodes x elements x stations, pairs).

    parts : the same of the solid parts' stiffness per unit G and mass, as coefficients of their polynomials.
    """

    solids: Solids
    trace: Array
    shear: Array
    mass: Array
    parts: tuple[Pair, ...]

    @classmethod
    def on(cls, solids: Solids, basis: Array) -> "Projected":
        """Project on a basis (unknowns, vectors)."""
        shell = solids.shell
        trace, shear, mass = (kind.reshape(-1, basis.shape[1] ** 2) for kind in shell.energies(basis))
        parts = []
        for part, one in zip(shell.parts, solids.parts, strict=True):
            held = basis[part.columns]
            parts.append((held.T @ one.stiffness @ held, held.T @ one.mass @ held))
        return cls(solids, trace, shear, mass, tuple(parts))

    def at(self, designs: Designs) -> tuple[Array, Array, Array]:
        """Trace, shear and mass of the shell's elements (designs, vectors, vectors)."""
        weights = self.solids.shell.interpolate(self.solids.box.profile(designs))
        weights = np.moveaxis(weights, 1, 0).reshape(len(designs), -1)
        width = round(np.sqrt(self.trace.shape[1]))
        trace, shear, mass = (
            (weights @ kind).reshape(-1, width, width) for kind in (self.trace, self.shear, self.mass)
        )
        return trace, shear, mass

    def pencils(self, designs: Designs) -> tuple[Array, Array]:
        """K per unit G and M per unit density, of everything."""
        trace, shear, mass = self.at(designs)
        K, M = shear + self.ratio(designs.nu)[:, None, None] * trace, mass
        for one, (stiff, heavy) in zip(self.solids.parts, self.parts, strict=True):
            terms = one.terms(designs)
            K, M = K + np.tensordot(terms, stiff, 1), M + np.tensordot(terms, heavy, 1)
        return K, M

    def ratio(self, nu: Array) -> Array:
        """λ/G."""
        lam, G = lame(np.ones_like(nu), nu, self.solids.shell.plane_stress)
        return lam / G


def rayleigh_ritz(K: Array, M: Array, r: int, w: int) -> tuple[Array, Array, Array]:
    """μ, δ/μ and c (unit energy) of many designs on the first r vectors, with the next w as tests: the readable form."""
    mu, delta, c = np.zeros(len(K)), np.zeros(len(K)), np.zeros((len(K), r))
    tests = slice(r, r + w)
    for k, (stiff, heavy) in enumerate(zip(K, M, strict=True)):
        value, vector = eigh(stiff[:r, :r], heavy[:r, :r], subset_by_index=[0, 0])
        mu[k], c[k] = value[0], vector[:, 0] / np.sqrt(value[0]) * np.sign(vector[0, 0])
        residual = (stiff[tests, :r] - mu[k] * heavy[tests, :r]) @ c[k]
        delta[k] = np.sum(residual**2 / np.diag(stiff - mu[k] * heavy)[tests])
    return mu, delta, c
