"""Condensed solid parts as polynomials of the few numbers that shape them in a box of designs.

These numbers are the local thickness (its mean first, then what else varies near the part), the size of the stem, and
ν. The polynomials are products of Chebyshev's, T_i(x) T_j(y) …, up to a weighted degree: a direction of relative
half-range ε needs terms up to where (ε/2)^i falls below the accuracy. They are fitted to designs whose parts were
condensed, and held against others.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import log

import numpy as np

from shell.condensed import Part, UnfitSolids, condense_parts
from shell.designs import Box, Designs
from shell.errors import ShellError
from shell.frozen import FrozenShell
from shell.profiles import Profiles
from shell.quadrature import Array, gauss
from shell.system import Pair

POINTS = 5  # on each piece of the meridian near a part
MOST_TERMS = 400
OVERSAMPLING = 2.0  # designs over terms
DIGITS = 0.5  # more that the next attempt asks for
FIRST = 3.0  # digits of the first attempt
SHARE = 0.1  # of the tolerance that the polynomials may take
MARGIN = 2.0  # on the largest error among the held-out designs
FAR = 0.03  # relative distance of ω² from the one of the condensation beyond which it is done again
TOO_MANY = "the solid parts vary too much in this box: narrow its ranges or allow a larger tolerance."


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The numbers that shape one part, each within -1 ... 1 in the box.

    base, slopes, offset : local thickness, thickness (base + slopes @ amplitudes) - offset, (directions, shapes).
    stem, nu : middle and half-range of the others; None where the stem does not count.
    scales : relative half-ranges of all.
    """

    base: Array
    slopes: Array
    offset: Array
    stem: tuple[float, float] | None
    nu: tuple[float, float]
    scales: tuple[float, ...]

    def evaluate(self, thickness: Array, amplitudes: Array, stem: Array, nu: Array) -> Array:
        """The coordinates (numbers, designs) of thicknesses (m), amplitudes (shapes, designs), stems and ν."""
        local = (self.base[:, None] + self.slopes @ amplitudes) * thickness - self.offset[:, None]
        rest = [(nu - self.nu[0]) / self.nu[1]]
        if self.stem:
            rest.insert(0, (stem - self.stem[0]) / self.stem[1])
        return np.concatenate([local, *(row[None] for row in rest)])


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Products of Chebyshev polynomials of some coordinates; `degrees` (terms, coordinates) is closed downwards."""

    coordinates: Coordinates
    degrees: np.ndarray

    def evaluate(self, thickness: Array, amplitudes: Array, stem: Array, nu: Array) -> Array:
        """The terms (terms, designs)."""
        x = self.coordinates.evaluate(thickness, amplitudes, stem, nu)
        tables = [_chebyshev(row, int(most)) for row, most in zip(x, self.degrees.max(axis=0), strict=True)]
        found = np.empty((len(self.degrees), x.shape[1]))
        for k, (parent, coordinate, degree) in enumerate(self.steps):
            if degree:
                np.multiply(found[parent], tables[coordinate][degree], out=found[k])
            else:
                found[k] = 1.0
        return found

    @property
    def steps(self) -> list[tuple[int, int, int]]:
        """For each term an earlier one, and the coordinate and degree that it is multiplied with."""
        known = {tuple(row): k for k, row in enumerate(self.degrees.tolist())}
        steps = []
        for row in self.degrees.tolist():
            used = [k for k, degree in enumerate(row) if degree]
            last = used[-1] if used else 0
            parent = [0 if k == last else degree for k, degree in enumerate(row)]
            steps.append((known[tuple(parent)], last, row[last]))
        return steps

    def part(self, kept: np.ndarray) -> "tuple[Polynomials, np.ndarray]":
        """The chosen terms with those that they are made of, and their numbers."""
        wanted = set(np.flatnonzero(kept).tolist()) | {0}
        for k in sorted(wanted, reverse=True):
            parent = self.steps[k][0]
            while parent not in wanted:
                wanted.add(parent)
                parent = self.steps[parent][0]
        numbers = np.array(sorted(wanted))
        return Polynomials(self.coordinates, self.degrees[numbers]), numbers


@dataclass(frozen=True, eq=False)
class Interpolated:
    """One solid part: K per unit G and M per unit density as coefficients (terms, unknowns, unknowns)."""

    polynomials: Polynomials
    stiffness: Array
    mass: Array

    def terms(self, designs: Designs) -> Array:
        """The polynomials (designs, terms)."""
        return self.polynomials.evaluate(designs.thickness, designs.amplitudes.T, designs.stem, designs.nu).T

    def at(self, designs: Designs) -> Pair:
        """The matrices (designs, unknowns, unknowns)."""
        terms = self.terms(designs)
        return np.tensordot(terms, self.stiffness, 1), np.tensordot(terms, self.mass, 1)


@dataclass(frozen=True, eq=False)
class Solids:
    """The solid parts of a box of designs.

    mu : ω² for E = ρ = 1 at which they are condensed.
    parts : their interpolations.
    error : relative, that these leave in ω².
    """

    shell: FrozenShell
    box: Box
    profiles: Profiles
    mu: float = 0.0
    parts: tuple[Interpolated, ...] = ()
    error: float = 0.0

    def at(self, designs: Designs) -> list[list[Pair]]:
        """The interpolated matrices of every design."""
        found = [part.at(designs) for part in self.parts]
        return [[(K[k], M[k]) for K, M in found] for k in range(len(designs))]

    def condense(self, designs: Designs, k: int, mu: float) -> list[Pair]:
        """The matrices of one design, from its own cells."""
        if not self.shell.parts:
            return []
        resonator = self.profiles.build(float(designs.thickness[k]), designs.amplitudes[k], float(designs.stem[k]))
        system = self.shell.system
        return condense_parts(self.shell.parts, resonator, system.n, system.level, float(designs.nu[k]), mu)

    def solve(self, designs: Designs, k: int) -> tuple[float, Array]:
        """The lowest ω² for E = ρ = 1 and its vector of one design in full, condensed at its own frequency.

        Statically where there is no `mu` yet, which is enough to compare levels.
        """
        h, nu = self.box.profile(designs.part(slice(k, k + 1)))[0], float(designs.nu[k])
        value, vector = self.shell.solve(h, nu, self.condense(designs, k, self.mu))
        if self.shell.parts and self.mu and abs(value / self.mu - 1) > FAR:
            value, vector = self.shell.solve(h, nu, self.condense(designs, k, value))
        return value, vector


def interpolate_solids(shell: FrozenShell, box: Box, profiles: Profiles, tolerance: float) -> Solids:
    """Fit polynomials to the solid parts until ω of held-out designs lies within a share of `tolerance`.

    Raises
    ------
    UnfitSolids
        When too many terms would be needed, or when the parts of some design have other cells.
    """
    middle = box.designs(np.zeros((1, box.dimensions)))
    mu, _ = Solids(shell, box, profiles).solve(middle, 0)
    solids = Solids(shell, box, profiles, mu)
    if not shell.parts:
        return solids
    rng = np.random.default_rng(2028)
    coordinates = [_find_coordinates(part, box, profiles) for part in shell.parts]
    count = 6 + box.dimensions
    inside, wide = (rng.uniform(-1, 1, (count, box.dimensions)) for _ in range(2))
    held_out = box.designs(np.vstack([inside, np.clip(2 * wide, -1, 1)]))
    true = np.array([solids.solve(held_out, k)[0] for k in range(len(held_out))])
    pool = _pool(box.dimensions, rng)
    units: list[Array] = []
    known: list[list[Pair]] = []
    digits = FIRST
    while True:
        polynomials = [Polynomials(one, _choose_degrees(one.scales, digits)) for one in coordinates]
        most = max(len(one.degrees) for one in polynomials)
        if most > MOST_TERMS:
            raise UnfitSolids(TOO_MANY)
        while len(known) < OVERSAMPLING * most + box.dimensions:
            units.append(next(pool))
            known.append(solids.condense(box.designs(units[-1][None]), 0, mu))
        designs = box.designs(np.array(units))
        parts = tuple(_fit(one, designs, [pairs[k] for pairs in known]) for k, one in enumerate(polynomials))
        error = _largest_error(Solids(shell, box, profiles, mu, parts), held_out, true)
        if MARGIN * error / 2 < SHARE * tolerance:
            return Solids(shell, box, profiles, mu, parts, MARGIN * error)
        digits += DIGITS


def _largest_error(solids: Solids, designs: Designs, true: Array) -> float:
    """The largest relative error of ω² with interpolated parts; infinite where these are not definite."""
    try:
        values = [
            solids.shell.solve(h, float(nu), pairs)[0]
            for h, nu, pairs in zip(solids.box.profile(designs), designs.nu, solids.at(designs), strict=True)
        ]
    except ShellError:
        return np.inf
    return float(np.max(abs(np.array(values) / true - 1)))


def _fit(polynomials: Polynomials, designs: Designs, known: list[Pair]) -> Interpolated:
    empty = Interpolated(polynomials, np.zeros(0), np.zeros(0))
    inverse = np.linalg.pinv(empty.terms(designs), rcond=1e-12)
    K, M = (np.array([pair[kind] for pair in known]) for kind in (0, 1))
    return Interpolated(polynomials, np.tensordot(inverse, K, 1), np.tensordot(inverse, M, 1))


def _pool(d: int, rng: np.random.Generator) -> Iterator[Array]:
    """Points of the cube: its middle, its corners, then points that crowd towards the faces as Chebyshev's do."""
    yield np.zeros(d)
    yield from np.array(list(product((-1.0, 1.0), repeat=d)))
    while True:
        yield np.cos(np.pi * rng.uniform(0, 1, d))


def _find_coordinates(part: Part, box: Box, profiles: Profiles) -> Coordinates:
    """The directions in which the thickness near a part varies in the box, the largest first (SVD)."""
    resonator = profiles.resonator
    xi, _ = gauss(POINTS)
    s = np.concatenate([(a + b) / 2 + (b - a) / 2 * xi for a, b in part.reach(resonator)])
    base, shapes = profiles.at(s / resonator.length)
    d, rng = box.dimensions, np.random.default_rng(2029)
    designs = box.designs(np.vstack([np.array(list(product((-1.0, 1.0), repeat=d))), rng.uniform(-1, 1, (200, d))]))
    nominal = sum(box.thickness) / 2 * base
    relative = designs.thickness[:, None] * (base + designs.amplitudes @ shapes) / nominal - 1
    directions = np.linalg.svd(relative, full_matrices=False)[2] / np.sqrt(len(s))
    reach = np.max(abs(relative @ directions.T), axis=0)
    used = reach > 1e-9
    turn = directions[used] / reach[used, None]
    nu = (sum(box.nu) / 2, (box.nu[1] - box.nu[0]) / 2)
    stem = (sum(box.stem) / 2, (box.stem[1] - box.stem[0]) / 2)
    has_stem = resonator.stem is not None and part.number == 0 and stem[1] > 0
    scales = [*reach[used].tolist(), *([stem[1]] if has_stem else []), nu[1] / (0.5 - nu[0])]
    return Coordinates(
        turn @ (base / nominal),
        turn @ (shapes / nominal).T,
        turn.sum(axis=1),
        stem if has_stem else None,
        nu,
        tuple(float(x) for x in scales),
    )


def _choose_degrees(scales: tuple[float, ...], digits: float) -> np.ndarray:
    """Degrees (terms, coordinates) whose coefficients reach 10^-digits, Π (ε/2)^i."""
    weights = [log(2 / min(scale, 0.9)) for scale in scales]

    def below(left: float, k: int) -> Iterator[tuple[int, ...]]:
        if k == len(weights):
            yield ()
            return
        for degree in range(int(left / weights[k]) + 1):
            for rest in below(left - degree * weights[k], k + 1):
                yield (degree, *rest)

    return np.array(list(below(digits * log(10), 0)))


def _chebyshev(x: Array, most: int) -> list[Array]:
    found = [np.ones_like(x), x]
    while len(found) <= most:
        found.append(2 * x * found[-1] - found[-2])
    return found
