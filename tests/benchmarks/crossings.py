"""Modes of one harmonic that cross: does a mode that is followed by its shape arrive where its symmetry says that it must?

    python -m tests.benchmarks.crossings [CASES]

A free tube is its own mirror image, so that its even and odd modes do not mix: where their frequencies cross, they cross truly, and
the k-th even mode at one height is the k-th even one at another. Tubes are drawn (radius, wall, Poisson's ratio, harmonic, two
heights); those count in which the order of two modes of unlike symmetry changes on the way. Of each, one that crosses is followed.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shell.cross_section import cut
from shell.elastic import Elastic
from shell.following import follow
from shell.meridian import cylinder
from shell.modes import Mode, solve_modes

LOWEST = 5  # modes of a harmonic among which crossings are sought
APART = 0.03  # least relative distance of modes of like symmetry: closer ones exchange their shapes
STEPS = 9  # heights at which that is looked at


@dataclass(frozen=True)
class Tube:
    """Free tubes of one family, and the harmonic that is looked at."""

    radius: float
    wall: float
    ratio: float
    harmonic: int
    heights: tuple[float, float]

    def solve(self, place: float, count: int) -> tuple[Mode, ...]:
        """The lowest modes at a place 0 ... 1 of the way between the heights."""
        height = self.heights[0] + place * (self.heights[1] - self.heights[0])
        elastic = Elastic(70e9, self.ratio, 2500.0)
        return solve_modes(cylinder(self.radius, self.wall, height), elastic, self.harmonic, count, "shell", 1e-4)


def is_even(mode: Mode) -> bool:
    """Whether the radial motion is the same at both ends of a tube."""
    assert mode.solution is not None
    assert mode.resonator is not None
    total = 0.0
    for place in (0.05, 0.2, 0.35):
        one, other = (
            cut(mode.resonator, mode.solution.system, s, np.zeros(1)).displacements(mode.solution.unknowns)[:, 0]
            for s in (place, 1 - place)
        )
        total += float(one @ (other * [-1.0, 1.0, 1.0]))
    return total > 0


def draw(rng: np.random.Generator) -> Tube:
    """A family of tubes."""
    R, n = rng.uniform(5e-3, 30e-3), int(rng.integers(0, 5))
    low = R * rng.uniform(0.5, 2.0)
    return Tube(R, R * rng.uniform(0.02, 0.08), rng.uniform(0.1, 0.35), n, (low, low * rng.uniform(1.2, 2.5)))


def planted(tube: Tube) -> tuple[Mode, int] | None:
    """A mode at the start that others of unlike symmetry cross, and its index at the end; None where nothing is decided."""
    places = np.linspace(0.0, 1.0, STEPS)
    found = [tube.solve(float(place), LOWEST) for place in places]
    even = [[is_even(mode) for mode in modes] for modes in found]
    for modes, own in zip(found, even, strict=True):
        for kind in (True, False):
            f = np.array([mode.frequency for mode, same in zip(modes, own, strict=True) if same == kind])
            if len(f) > 1 and np.min(np.diff(f) / f[1:]) < APART:
                return None
    for k in range(LOWEST - 1, -1, -1):
        rank = even[0][:k].count(even[0][k])
        alike = [j for j, kind in enumerate(even[-1]) if kind == even[0][k]]
        if rank < len(alike) and alike[rank] != k:
            return found[0][k], alike[rank]
    return None


def cases(seed: int = 0) -> Iterator[tuple[Tube, Mode, int]]:
    """Planted crossings without end."""
    rng = np.random.default_rng(seed)
    while True:
        tube = draw(rng)
        one = planted(tube)
        if one is not None:
            yield tube, *one


def main(count: int) -> None:
    """Print how many modes arrived, and those that did not."""
    arrived = 0
    for number, (tube, mode, index) in zip(range(1, count + 1), cases(), strict=False):
        try:
            reached = follow(tube.solve, mode).index
        except Exception as error:
            reached = str(error)
        arrived += reached == index
        if reached != index:
            print(f"{tube}: mode {mode.index} is number {index} at the end, not {reached}", flush=True)
        if number % 10 == 0:
            print(f"{arrived} of {number} followed", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
