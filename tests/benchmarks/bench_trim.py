"""Trimming simulated: python tests/benchmarks/bench_trim.py [SEEDS].

A dome with waves 1 ... 6 of its density is read (0.1 mHz of error on either part of the split), cut as the plan's first round says (2 % of
error on every cut, 2 % on all of them together), and read again, until the reading is below 0.35 mHz or three rounds are done. What the cuts do is the coupled
harmonics' answer to the masses that are gone, all orders included; the planner sees only the first-order gain of the perfect dome.
"""

import sys
import time
from math import pi

import numpy as np

from shell.elastic import Elastic
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, PointMass, Sum, wave
from shell.inertia import weigh
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.trimming import SplitWave, plan_trim
from studies.trim import rim_sites

RHO = 2203.0


def simulate(seed, coupled, pair, mass, rounds=3, goal=5e-4):
    """Final split (Hz), rounds, largest growth of the mass harmonics 1 ... 3, first split."""
    rng = np.random.default_rng(seed)
    f = pair.mode.frequency
    amplitude = {1: 3e-3, 2: 3e-3, 3: 3e-3, 5: 1e-3, 6: 1e-3}
    waves = [(m, a * rng.uniform(0.3, 1.0), rng.uniform(0, 2 * pi)) for m, a in amplitude.items()]
    planted = 10 ** rng.uniform(np.log10(5e-3), 0.0)
    waves.append((4, planted / f / 0.3608, rng.uniform(0, 2 * pi)))
    density = Sum(tuple((1.0, wave(m, a, t)) for m, a, t in waves))
    unbalance = {m: mass * a / 2 * np.exp(1j * m * t) for m, a, t in waves if m <= 3}
    start = dict(unbalance)
    sites = rim_sites(pair.resonator, {2: pair}, RHO, 0.0)
    gone, first, done, all_gain = [], None, 0, 1 + 0.02 * rng.standard_normal()
    for done in range(rounds + 1):
        split = coupled.solve(Imperfection(density=density, masses=tuple(gone)))
        if first is None:
            first = split.hertz
        z = split.wave + 1e-4 / f * complex(*rng.standard_normal(2))
        if done == rounds or abs(z) * f < 0.35e-3:
            break
        axis = float(np.angle(-z) / 4)
        sites = rim_sites(pair.resonator, {2: pair}, RHO, axis)
        plan = plan_trim([SplitWave.of(2, f, abs(z) * f, axis, 1e-4)], sites, goal=goal)
        for cut in plan.round.cuts:
            removed = cut.mass * all_gain * (1 + 0.02 * rng.standard_normal())
            gone.append(PointMass(-removed, cut.azimuth, cut.position))
            for k in unbalance:
                unbalance[k] -= removed * np.exp(1j * k * cut.azimuth)
    growth = max(abs(unbalance[k]) / abs(start[k]) for k in unbalance)
    return split.hertz, done, growth, first


def main(seeds=100):
    elastic = Elastic(72.7e9, 0.17, RHO)
    resonator = hemisphere(radius=15e-3, thickness=0.9e-3)
    (mode,) = solve_modes(resonator, elastic, 2)
    pair, coupled = Pair(mode), CoupledHarmonics(mode, elastic)
    mass = weigh(resonator, RHO).mass
    start = time.perf_counter()
    rows = np.array([simulate(seed, coupled, pair, mass) for seed in range(seeds)])
    good = (rows[:, 0] <= 5e-4) & (rows[:, 2] <= 1.1)
    print(
        f"{seeds} seeds, splits {1e3 * rows[:, 3].min():.1f} ... {1e3 * rows[:, 3].max():.0f} mHz: {good.sum()} end at or below 0.5 mHz "
        f"with no mass harmonic raised by more than 10 %; worst {1e3 * rows[:, 0].max():.3f} mHz, growth {rows[:, 2].max():.3f}, "
        f"rounds {np.bincount(rows[:, 1].astype(int))}; {time.perf_counter() - start:.0f} s"
    )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
