r"""The harmonics of an imperfect resonator solved together: the reference for the split, exact in the imperfection.

An imperfection with a wave m couples the harmonic n with n ± m. The pair u_c, u_s of the perfect resonator leaves forces
r = (K - λ M) u on them, K and M those of the imperfect wall as it is (shell.imperfection.wall). Their answers

    x_k = -(K_k - λ M_k)⁻¹ r_k,      with K_k, M_k of the perfect resonator,

of all harmonics together, one vector for each of the two, join the pair in a small basis, in which K and M of the imperfect
wall are projected. The answers are folded onto the pair,

    T = [1; -A₁₁⁻¹ A₁₀],  A = K - λ M,   (Tᵀ A T) y = δ (Tᵀ M T) y,   ω² = λ + δ,

which keeps a small split free of cancellation. One round of answers leaves an error of the fourth order in the imperfection;
the next answers the forces r = A T that the first has left. A last round of answers x is not taken into the basis: it moves the
folded A by rᵀ x but for the imperfection's own share of that.
"""

from functools import cache, cached_property, lru_cache
from math import pi, sqrt

import numpy as np

from shell.assembly import build_system
from shell.elastic import Constants, Elastic, VaryingElastic
from shell.errors import ShellError
from shell.imperfection.block import Block, Together, condense
from shell.imperfection.body import Body, Core
from shell.imperfection.imperfect import FIELDS, Imperfection
from shell.imperfection.split import Split
from shell.layout import Level
from shell.modes import Mode
from shell.quadrature import Array
from shell.refinement import solve_level
from shell.resonator import Resonator
from shell.system import System

SMALL = 1e-9  # of the largest wave of a field: smaller ones are left out
MOST = 16  # rounds of answers
REACH = 8  # harmonics beyond n that point masses excite
EXACT = 1e-14  # of ω²: what is less is rounding
KEPT = 8  # sets of harmonics that are kept side by side


class CoupledHarmonics:
    """Harmonics of one resonator, prepared once for any imperfection."""

    def __init__(self, mode: Mode, elastic: Elastic | VaryingElastic, highest: int | None = None) -> None:
        if mode.harmonic < 1:
            raise ShellError("a pair needs a harmonic from 1 up.")
        self.mode = mode
        self.n = mode.harmonic
        self.highest = highest or self.n + REACH
        self.elastic = elastic
        self.level: Level = mode.solution.system.level
        self.resonator: Resonator = mode.resonator
        self.block, self.together = cache(self._condense), lru_cache(KEPT)(self._join)

    def system(self, k: int) -> System:
        """The elements of the perfect resonator at one harmonic, the same for all."""
        return build_system(self.resonator, k, self.level, (0, max(self.highest, self.n)))

    @cached_property
    def constants(self) -> tuple[Constants, ...]:
        """The material of every group."""
        return self.system(self.n).constants(self.elastic)

    @cached_property
    def pair(self) -> tuple[float, Array]:
        """ω² and the vector of the pair on these elements."""
        solved, *_ = solve_level(self.system(self.n), self.resonator.size, self.elastic, self.mode.index + 1, 1e-13)
        found = solved[self.mode.index]
        return found.eigenvalue, found.vector / sqrt(found.mass)

    def _condense(self, k: int) -> Block:
        """One harmonic, its solid parts condensed."""
        value, vector = self.pair
        return condense(self.system(k), self.constants, value, vector if k == self.n else None)

    @cached_property
    def cores(self) -> tuple[Core, ...]:
        """The solid parts."""
        return tuple(Core(k, self.constants[k]) for k in self.system(self.n).solids)

    def _join(self, harmonics: tuple[int, ...]) -> Together:
        """Several of them side by side."""
        return Together([self.block(k) for k in harmonics], self.resonator, self.constants)

    def solve(self, imperfection: Imperfection, tolerance: float = 1e-6, rounds: int = MOST) -> Split:
        """The split with every order of the imperfection, but the first in the height of the rim's edge, to a relative tolerance."""
        waves = _waves_that_count(imperfection)
        reach = waves | (set(range(self.highest + self.n + 1)) if imperfection.masses else set())
        answering = self._answering(reach)
        together = self.together(answering)
        highest, wave = answering[-1], max(waves, default=0)
        azimuths = max(highest + self.n + 4 * wave, 2 * highest + wave) + 1
        theta = 2 * pi * np.arange(azimuths) / azimuths
        body = Body(together, self.cores, imperfection, tuple(waves), theta)
        value, vector = self.pair
        pair = np.zeros((together.size, 2, 2))
        own = vector[self.block(self.n).shell]
        for one in (0, 1):
            pair[together.rows[answering.index(self.n)], one, one] = own
        basis = PairBasis(body, value)
        basis.extend(pair, np.zeros_like(pair))
        before = float(np.abs(basis.A).max())
        for _ in range(rounds if reach else 0):
            folded, T, _ = basis.fold()
            forces = basis.forces(T)
            answers = together.answer(forces)
            closing = products(forces, answers)
            move, split = float(np.abs(closing).max()), 2 * abs(_difference(folded + closing))
            # what the imperfection does to the answers is of its own size, the root of how rounds shrink
            missed = move * sqrt(min(1.0, move / before)) if before else move
            if missed <= max(tolerance * split, EXACT * value if tolerance else 0.0):
                return self._split(basis, closing)
            before, size = move, np.linalg.norm(answers)
            basis.extend(answers / size, -forces / size)
        return self._split(basis)

    def _answering(self, reach: set[int]) -> tuple[int, ...]:
        """The harmonics that the waves couple with the pair and with those that they couple with it."""
        found = {self.n}
        for _ in range(2):
            found |= {k for at in found for m in reach for k in (abs(at - m), at + m) if k <= self.highest}
        return tuple(sorted(found))

    def _split(self, basis: "PairBasis", closing: Array | float = 0.0) -> Split:
        """From the folded pair; closing : what is added to its A."""
        value, at = basis.value, 0.0
        for _ in range(4):
            folded, _, norm = basis.fold(at)
            size, axes = np.linalg.eigh(norm)
            root = (axes / np.sqrt(size)) @ axes.T  # the symmetric root, which turns neither axis
            B = root @ (folded + closing) @ root
            step, z = (B[0, 0] + B[1, 1]) / 2, _difference(B)
            at += step
            if abs(step) < 1e-13 * value:
                break
        return Split.of_squares(self.n, self.mode.frequency, float(at / value), z / value)


def _difference(B: Array) -> complex:
    """Half of what a symmetric 2 x 2 matrix makes of two equal values, with the direction."""
    return complex((B[0, 0] - B[1, 1]) / 2, (B[0, 1] + B[1, 0]) / 2)


def _waves_that_count(imperfection: Imperfection) -> set[int]:
    x = np.linspace(0.0, 1.0, 33)
    found: set[int] = set()
    for one in (getattr(imperfection, name) for name in FIELDS):
        size = {m: float(np.abs(one.wave(m, x)).max()) for m in one.orders}
        found |= {m for m, value in size.items() if value > SMALL * max(size.values())}
    return found


class PairBasis:
    """The pair, of eigenvalue λ, which the perfect body leaves without forces, and its answers to loads."""

    def __init__(self, body: Body, value: float) -> None:
        self.body, self.value = body, value
        self.X = self.force = self.mass = np.zeros(
            (body.together.size, 0, 2)
        )  # vectors, A X and M X, (unknowns, basis, 2)

    def extend(self, X: Array, load: Array) -> None:
        """Add two vectors (unknowns, 2, 2) with what the perfect body's A makes of them (but for what holds back the pair)."""
        change, mass = self.body.respond(X, self.value)
        grown = ((self.X, X), (self.force, load + change), (self.mass, mass))
        self.X, self.force, self.mass = (np.concatenate(both, axis=1) for both in grown)
        self.A, self.M = (_symmetric(products(loads, self.X)) for loads in (self.force, self.mass))

    def forces(self, T: Array) -> Array:
        """A of combinations T (basis, 2) of the vectors."""
        return np.asarray(np.einsum("ubc,bv->uvc", self.force, T, optimize=True))

    def fold(self, at: float = 0.0) -> tuple[Array, Array, Array]:
        """A at λ + at on the pair with the rest folded onto it, T, and Tᵀ M T."""
        A = self.A - at * self.M
        rest = np.linalg.pinv(A[2:, 2:], rcond=1e-13, hermitian=True) @ A[2:, :2]
        T = np.vstack([np.eye(2), -rest])
        return A[:2, :2] - A[:2, 2:] @ rest, T, T.T @ self.M @ T


def products(one: Array, other: Array) -> Array:
    """Of vectors (unknowns, vectors, 2) with others."""
    return np.asarray(np.tensordot(one, other, ((0, 2), (0, 2))))


def _symmetric(P: Array) -> Array:
    """Of products of loads with vectors, two a round, those of the earlier round's loads: the later ones lack what holds back the pair."""
    rounds = np.arange(len(P)) // 2
    return np.where(rounds[:, None] == rounds, (P + P.T) / 2, np.where(rounds[:, None] < rounds, P, P.T))
