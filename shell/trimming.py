r"""Trimming plan: masses and places that null a split and preserve the balance.

A mass μ_j taken off at the azimuth θ_j moves the wave of the split of harmonic n by μ_j w_n exp(2 i n θ_j), and the
harmonics of the mass around by μ_j exp(i k θ_j). The least mass that nulls the splits z_n is a linear programme,

    min Σ μ_j,   Σ μ_j w_nj exp(2 i n θ_j) = -φ z_n,   |u_k - Σ μ_j exp(i k θ_j)| <= |u_k|  (k = 1, 2, 3),   0 <= μ_j <= capacity,

u_k the unbalance that is known, of which as little is left as the capacities allow, before the mass counts; where none is known,
nothing may be added to it. Each round takes the share φ that does not overshoot
the goal even where the gain of the cuts is `SURE` standard errors too large: removed too much is not put back.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sqrt

import numpy as np
import scipy

from shell.errors import ShellError
from shell.imperfection import Split
from shell.quadrature import Array

BALANCED = (1, 2, 3)  # harmonics of the mass that must not grow
SURE = 2.0  # standard errors of the gain that a round leaves room for
FAR = 100.0  # errors from 0, from which the size of a wave is normal
ONE_SIDED = 1.645  # standard errors that 95 of 100 stay below
DIRECTIONS = 24  # sides of the polygon that stands for a circle
FIRST = 100.0  # cost of a mass of unbalance that is left over that of a mass taken off, of which about 2 take 1 of unbalance


@dataclass(frozen=True)
class SplitWave(Split):
    """A split as it is measured or expected, most probable, with the standard error of either part of its wave."""

    error: float = 0.0

    @classmethod
    def of(cls, harmonic: int, frequency: float, split: float, slow_axis: float, error: float) -> "SplitWave":
        """From a split and its standard error in Hz and the azimuth of the slower mode's antinode, rad."""
        if not split > 0 or not error > 0:
            raise ShellError(f"a split of {split:g} Hz with a reading error of {error:g} Hz: both must be positive (--split, --reading-error).")  # fmt: skip
        if split < 2 * error:
            raise ShellError(
                f"the split of n = {harmonic}, {1e3 * split:.3g} mHz, cannot be distinguished from its reading error of {1e3 * error:.3g} mHz: measure more accurately before cutting."
            )
        wave = complex(-split / frequency * np.exp(2j * harmonic * slow_axis))
        return cls(harmonic, frequency, 0.0, wave, error / frequency)

    @property
    def most(self) -> float:
        """The split that is not exceeded in 95 of 100 cases, Hz: both parts of the wave have the error, so |wave|²/error² is a non-central χ² of two degrees of freedom."""
        size = abs(self.wave) / self.error if self.error > 0 else np.inf
        if size > FAR:
            return self.frequency * (abs(self.wave) + ONE_SIDED * self.error)
        return self.frequency * self.error * sqrt(float(scipy.special.chndtrix(0.95, 2, size**2)))


@dataclass(frozen=True, eq=False)
class Sites:
    """Places where material can be removed."""

    azimuth: Array  # rad, (sites,)
    position: Array  # of the meridian, (sites,)
    capacity: Array  # most mass at each, kg, (sites,)
    gain: Mapping[int, Array]  # w_n of each site per harmonic n, relative split per kg, of either sign, n -> (sites,)


@dataclass(frozen=True)
class Cut:
    """A mass (kg) to remove at an azimuth (rad) and position."""

    azimuth: float
    position: float
    mass: float


@dataclass(frozen=True)
class TrimPlan:
    """One round of cuts, made without a measurement between them. The next is planned from what is measured after it."""

    before: tuple[SplitWave, ...]
    goal: float  # Hz
    cuts: tuple[Cut, ...]
    share: float  # of the splits, that the cuts take
    after: tuple[SplitWave, ...]
    unbalance: Mapping[int, complex]

    @property
    def mass(self) -> float:
        """All of it, kg."""
        return sum(cut.mass for cut in self.cuts)

    @property
    def is_enough(self) -> bool:
        """Whether the goal is expected to be met, in 95 of 100 cases."""
        return all(state.most <= self.goal for state in self.after)


def plan_trim(
    readings: Sequence[SplitWave], sites: Sites, *, goal: float, removal_error: float = 0.02,
    gain_error: float = 0.03, unbalance: Mapping[int, complex] | None = None,
) -> TrimPlan:  # fmt: skip
    """The next round of cuts, which brings the splits towards the goal (Hz each) and not beyond.

    Relative standard errors: `removal_error` of each cut's mass, `gain_error` common to all; `unbalance`: k -> Σ m exp(i k θ), kg.
    """
    if not goal > 0:
        raise ShellError("the goal is a positive split in Hz.")
    known = dict(unbalance or {})
    before = tuple(readings)
    # leaves no split on the far side of 0 by more than the goal, `SURE` errors of the gain allowed for
    surely = 1 + SURE * sqrt(gain_error**2 + removal_error**2 / 4)
    share = min([1.0, *((s.hertz + goal / 2) / (s.hertz * surely) for s in before if s.hertz > goal / 2)])
    masses = _least_mass(before, sites, share, sites.capacity, known)
    after = []
    for state in before:
        moves = masses * sites.gain[state.harmonic] * np.exp(2j * state.harmonic * sites.azimuth)
        total = complex(moves.sum())
        # what is left before it is measured: the reading, the error of each cut and that of all
        spread = state.error**2 + removal_error**2 * float((abs(moves) ** 2).sum()) / 2 + (gain_error * abs(total)) ** 2
        after.append(replace(state, wave=state.wave + total, error=sqrt(spread)))
    known = {k: u - complex(masses @ np.exp(1j * k * sites.azimuth)) for k, u in known.items()}
    cuts = tuple(
        Cut(float(a), float(p), float(m))
        for a, p, m in zip(sites.azimuth, sites.position, masses, strict=True)
        if m > 1e-6 * masses.max()
    )
    return TrimPlan(before, goal, cuts, share, tuple(after), known)


def _least_mass(
    states: Sequence[SplitWave], sites: Sites, share: float, capacity: Array, unbalance: Mapping[int, complex]
) -> Array:
    count = len(sites.azimuth)
    rows: list[Array] = []
    wanted: list[float] = []
    for state in states:
        gain = sites.gain[state.harmonic]
        scale = float(abs(gain).max())
        column = gain / scale * np.exp(2j * state.harmonic * sites.azimuth)
        rows += [column.real, column.imag]
        target = -share * state.wave / scale
        wanted += [target.real, target.imag]
    size = max(abs(value) for value in (*wanted, *unbalance.values()))
    limits: list[Array] = []
    bounds: list[float] = []
    turns = np.exp(-2j * pi * np.arange(DIRECTIONS) / DIRECTIONS)
    for k in BALANCED:
        around = np.exp(1j * k * sites.azimuth)
        u = unbalance.get(k)
        if u is None or abs(u) < 1e-9 * size:
            rows += [around.real, around.imag]
            wanted += [0.0, 0.0]
            continue
        # Re((u - Σ μ e^{ikθ}) turn) <= t_k: a polygon around what is left, with a corner at u, so that t_k <= |u| cos(π/24) keeps it below |u|
        for turn in turns * np.exp(-1j * (np.angle(u) + pi / DIRECTIONS)):
            row = np.zeros(count + len(BALANCED))
            row[:count] = -(around * turn).real
            row[count + k - 1] = -1.0
            limits.append(row)
            bounds.append(-float((u * turn).real) / size)
    padded = np.zeros((len(rows), count + len(BALANCED)))
    padded[:, :count] = np.array(rows)
    most = [(0.0, max(float(c), 0.0) / size) for c in capacity]
    most += [(0.0, abs(unbalance.get(k, 0.0)) * cos(pi / DIRECTIONS) / size) for k in BALANCED]
    cost = np.concatenate([np.ones(count), np.full(len(BALANCED), FIRST)])
    found = scipy.optimize.linprog(
        cost, A_eq=padded, b_eq=np.array(wanted) / size, A_ub=np.array(limits) if limits else None,
        b_ub=np.array(bounds) if limits else None, bounds=most,
    )  # fmt: skip
    if found.x is None:
        room, need = 1e6 * float(capacity.sum()), 1e6 * size
        raise ShellError(
            f"the cuts would be deeper than allowed: about {need:.3g} mg must be removed near the antinodes, but the {count} sites "
            f"give {room:.3g} mg in all, at most {1e9 * float(capacity.max()):.3g} µg each, with the balance preserved. Allow longer, wider or more cuts. Is the split in Hz?"
        )
    return np.asarray(np.maximum(found.x[:count], 0.0) * size)
