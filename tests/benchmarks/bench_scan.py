"""How well planted splits are found in synthetic scans: python tests/benchmarks/bench_scan.py [CASES] [POINTS].

Every case plants waves 1 ... 6 of both faces in three dimensions (tests/shell/scans.py), with 100 nm of noise, 2 % gaps, 0.1 %
outliers, a tilt of 0.5° and an offset of each face's frame; the split that is true is that of the planted waves themselves.
"""

import sys
import time
from math import pi

import numpy as np

from shell.elastic import Elastic
from shell.imperfection import Imperfection, Pair, Sum, find_split, wave
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.scan.alignment import align
from shell.scan.projection import Projector
from shell.scan.survey import survey
from studies.scan import polar_intervals
from tests.shell.scans import dome_points


def field(waves):
    return Sum(tuple((1.0, wave(m, a, t, lambda x, p=p: np.sin(x * pi / 2) ** p)) for m, a, t, p in waves))


def plant(rng):
    return [
        (
            m,
            10 ** rng.uniform(-7, -5.5) * (0.2 if m == 4 else 1.0),
            rng.uniform(0, 2 * pi),
            int(rng.integers(m, 2 * m + 1)),
        )
        for m in (2, 3, 4, 4, 5, 6)
    ]


def main(cases=100, points=20000):
    resonator = hemisphere(radius=15e-3, thickness=0.9e-3)
    (mode,) = solve_modes(resonator, Elastic(72.7e9, 0.17, 2203.0), 2)
    pair, projector = Pair(mode), Projector(resonator)
    rows = []
    for seed in range(cases):
        rng = np.random.default_rng(seed)
        waves = {-1: plant(rng), 1: plant(rng)}
        true = find_split(pair, Imperfection(inner=field(waves[-1]), outer=field(waves[1]))).wave
        found, covariance, start = 0j, np.zeros((2, 2)), time.perf_counter()
        for side in (-1, 1):
            cloud = dome_points(rng, points, waves[side], side, outliers=1e-3)
            motion = align([(cloud, side)], projector, ["face"])
            z, own = survey(cloud, side, motion, projector, "face").project(pair.faces[(side + 1) // 2], 4)
            found, covariance = found + z, covariance + own
        size, axis = polar_intervals(found, covariance, 4)
        turn = np.angle(true / found) / 4
        inside = axis is not None and axis.low - axis.value <= turn <= axis.high - axis.value
        rows.append((
            abs(true) * mode.frequency, abs(found) / abs(true) - 1, np.rad2deg(turn), size.low <= abs(true) <= size.high, inside,
            time.perf_counter() - start,
        ))  # fmt: skip
        if len(rows) % 10 == 0:
            table = np.array(rows, dtype=float)
            print(
                f"{len(rows)} scans of {points} points: split within 5 %: {np.mean(abs(table[:, 1]) < 0.05):.0%}, axis within 1°: "
                f"{np.mean(abs(table[:, 2]) < 1):.0%}, 90 % intervals hold the split {np.mean(table[:, 3]):.0%}, the axis "
                f"{np.mean(table[:, 4]):.0%}; worst {abs(table[:, 1]).max():.2%} of {table[abs(table[:, 1]).argmax(), 0]:.3f} Hz, "
                f"{abs(table[:, 2]).max():.2f}°; {np.median(table[:, 5]):.2f} s each",
                flush=True,
            )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
