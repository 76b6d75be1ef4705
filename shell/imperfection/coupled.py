r"""The harmonics of an imperfect resonator solved together: the reference for the split, exact in the imperfection.

An imperfection with a wave m couples the harmonic n with n ± m. The pair u_c, u_s of the perfect resonator leaves forces
r = (K - λ M) u on them, K and M those of the imperfect wall as it is (shell.imperfection.wall). Their answers

    x_k = -(K_k - λ M_k)⁻¹ r_k,      with K_k, M_k of the perfect resonator,

join the pair in a small basis, in which K and M of the imperfect wall are projected. The answers are folded onto the pair,

    T = [1; -A₁₁⁻¹ A₁₀],  A = K - λ M,   (Tᵀ A T) y = δ (Tᵀ M T) y,   ω² = λ + δ,

which keeps a small split free of cancellation. One round of answers leaves an error of the fourth order in the imperfection;
the next round answers the forces that the first has left.
"""

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import SuperLU, splu

from shell.assembly import lay_system
from shell.elastic import Elastic, VaryingElastic
from shell.errors import ShellError
from shell.imperfection.body import Body, Forms, Vector
from shell.imperfection.field import Field
from shell.imperfection.imperfect import FIELDS, Imperfection
from shell.imperfection.split import Split
from shell.imperfection.wall import Part
from shell.levels import Level, Theory
from shell.modes import Mode
from shell.quadrature import Array
from shell.refinement import solve_level
from shell.resonator import Resonator
from shell.solution import Constants, find_constants
from shell.system import System

SMALL = 1e-9  # of the largest wave of a field: smaller ones are left out
REACH = 8  # harmonics beyond n that point masses excite


@dataclass(frozen=True, eq=False)
class Block:
    """One harmonic k of the perfect resonator, with K_k - λ M_k factored; `kept` is M u of the pair in its own block."""

    system: System
    factor: SuperLU
    kept: Array | None

    def answer(self, load: Array) -> Array:
        """-(K_k - λ M_k)⁻¹ load; in the pair's own block without the pair."""
        if self.kept is None:
            return np.asarray(-self.factor.solve(load))
        return np.asarray(-self.factor.solve(np.append(load, 0.0))[:-1])


class CoupledHarmonics:
    """Harmonics of one resonator, prepared once for any imperfection.

    Parameters
    ----------
    mode : the solved pair; theory, level and index are its own.
    elastic : the material that it was solved with.
    highest : the highest harmonic k that may take part.
    """

    def __init__(self, mode: Mode, elastic: Elastic | VaryingElastic, highest: int | None = None) -> None:
        if mode.harmonic < 1 or mode.solution is None or mode.resonator is None:
            raise ShellError("a pair needs a harmonic from 1 up and theory solid or shell.")
        self.mode = mode
        self.n = mode.harmonic
        self.highest = highest or self.n + REACH
        self.elastic = elastic
        self.theory: Theory = mode.theory
        self.level: Level = mode.solution.system.level
        self.resonator: Resonator = mode.resonator
        self.together = (0, max(self.highest, self.n))
        self._systems: dict[int, System] = {}
        self._blocks: dict[int, Block] = {}

    def system(self, k: int) -> System:
        """The elements of the perfect resonator at one harmonic, the same for all."""
        if k not in self._systems:
            self._systems[k] = lay_system(self.resonator, k, self.theory, self.level, self.together)
        return self._systems[k]

    @cached_property
    def constants(self) -> tuple[Constants, ...]:
        """The material of every group."""
        groups = self.system(self.n).groups
        return tuple(find_constants(g.table.position, self.elastic, g.table.plane_stress) for g in groups)

    @cached_property
    def pair(self) -> tuple[float, Array]:
        """ω² and the vector of the pair on these elements."""
        solved = solve_level(self.system(self.n), self.resonator.size, self.elastic, self.mode.index + 1, 1e-13)
        found = solved[self.mode.index]
        return found.eigenvalue, found.vector / sqrt(found.mass)

    def block(self, k: int) -> Block:
        """One harmonic, factored."""
        if k not in self._blocks:
            self._blocks[k] = self._factor(k)
        return self._blocks[k]

    def _factor(self, k: int) -> Block:
        system, (value, vector) = self.system(k), self.pair
        lam, G = ([one.lame[which] for one in self.constants] for which in (0, 1))
        matrices, mass = system.operators(lam, G, [one.rho for one in self.constants], False, -value)
        around = pi * (2 if k == 0 else 1)
        rows = [np.repeat(members, len(members)) for members in system.pattern.unknowns]
        columns = [np.tile(members, len(members)) for members in system.pattern.unknowns]
        entries = [around * one.ravel() for one in matrices]
        size, kept = system.pattern.size, None
        if k == self.n:
            # a border keeps the answer free of the pair, whose own block is singular
            kept = np.asarray(mass @ vector[:, None])[:, 0] * around
            scale = float(np.max(np.abs(np.concatenate(entries)))) / float(np.max(np.abs(kept)))
            every, last = np.arange(size), np.full(size, size)
            rows += [every, last]
            columns += [last, every]
            entries += [scale * kept, scale * kept]
            size += 1
        whole = coo_matrix(
            (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size)
        )
        return Block(system, splu(whole.tocsc()), kept)

    def solve(self, imperfection: Imperfection, rounds: int = 1) -> Split:
        """The split with every order of the imperfection, up to what further rounds and higher harmonics would change.

        Parameters
        ----------
        imperfection : fields and masses. The edge of the rim counts to first order in its height.
        rounds : of answers: one is exact through the third order in the imperfection, two beyond what is ever asked.
        """
        waves = _waves_that_count(imperfection)
        reach = set(waves) | (set(range(self.highest + self.n + 1)) if imperfection.masses else set())
        loaded = {self.n}
        azimuths = self._azimuths(waves)
        body = Body(self.system, self.constants, self.resonator, imperfection, tuple(waves), azimuths, self.n)
        value, vector = self.pair
        basis: list[Vector] = [(Part(self.n, turned), vector) for turned in (0, 1)]
        forms = Forms(body, value)
        forms.extend(basis)
        T = np.eye(2)
        for _ in range(rounds if reach else 0):
            loaded = {k for at in loaded for m in reach for k in (abs(at - m), at + m) if k <= self.highest}
            fresh = self._answers(forms, T, sorted(loaded))
            if not fresh:
                break
            forms.extend(fresh)
            _, T, _ = _fold(forms, value)
        shift, wave = 0.0, 0j
        at = value
        for _ in range(4):
            reduced, T, norm = _fold(forms, at)
            size, axes = np.linalg.eigh(norm)
            root = (axes / np.sqrt(size)) @ axes.T  # the symmetric root, which turns neither axis
            B = root @ reduced @ root
            mean, z = (B[0, 0] + B[1, 1]) / 2, complex((B[0, 0] - B[1, 1]) / 2, (B[0, 1] + B[1, 0]) / 2)
            shift, wave, at = at - value + mean, z, at + mean
            if abs(mean) < 1e-13 * value:
                break
        slow, fast = (sqrt(1 + (shift + sign * abs(wave)) / value) for sign in (-1, 1))
        base = (slow + fast) / 2
        turn = wave / abs(wave) if wave else 1.0
        # f_fast - f_slow from δ(ω²), which keeps its digits
        relative = 2 * abs(wave) / value / (slow + fast)
        return Split(self.n, self.mode.frequency, base - 1, complex(relative * turn))

    def _azimuths(self, waves: set[int]) -> Array:
        count = 2 * self.highest + 4 * max(waves, default=0) + 4
        return np.asarray(2 * pi * np.arange(count) / count)

    def _answers(self, forms: Forms, T: Array, harmonics: list[int]) -> list[Vector]:
        """Vectors that answer the forces of the two folded vectors T, orthonormal in each part."""
        parts = [Part(k, turned) for k in harmonics for turned in (0, 1)]
        loads = dict(zip(parts, forms.forces(T, parts), strict=True))
        found: list[Vector] = []
        for k in harmonics:
            # what answers cos kθ answers sin kθ too, or the result would depend on where θ begins; n = 0 has no two
            for turned in ((0,), (1,)) if k == 0 else ((0, 1),):
                columns = np.hstack([loads[Part(k, which)] for which in turned])
                size = np.abs(columns).max()
                if not size > 1e-14 * forms.size:
                    continue
                known = [vector for at, vector in forms.vectors if at == Part(k, turned[0])]
                for column in columns.T[np.abs(columns).max(axis=0) > 1e-9 * size]:
                    x = self.block(k).answer(column)
                    length = np.linalg.norm(x)
                    for _ in range(2):
                        for other in known:
                            x = x - other * (other @ x) / (other @ other)
                    if np.linalg.norm(x) > 1e-8 * length:
                        known.append(x / np.linalg.norm(x))
                        found += [(Part(k, which), known[-1]) for which in turned]
        return found


def _fold(forms: Forms, at: float) -> tuple[Array, Array, Array]:
    A = forms.K - at * forms.M
    rest = np.linalg.solve(A[2:, 2:], A[2:, :2]) if len(A) > 2 else np.zeros((0, 2))
    T = np.vstack([np.eye(2), -rest])
    return A[:2, :2] - A[:2, 2:] @ rest, T, T.T @ forms.M @ T


def _waves_that_count(imperfection: Imperfection) -> set[int]:
    x = np.linspace(0.0, 1.0, 33)
    found: set[int] = set()
    fields: list[Field] = [getattr(imperfection, name) for name in FIELDS if getattr(imperfection, name) is not None]
    for field in [*fields, *(line.per_length for line in imperfection.lines)]:
        size = {m: float(np.abs(field.wave(m, x)).max()) for m in field.orders}
        found |= {m for m, value in size.items() if value > SMALL * max(size.values())}
    return found
