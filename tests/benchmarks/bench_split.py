"""How fast and how exact splits are: python tests/benchmarks/bench_split.py.

Best processor times of several runs: the first-order split after a solved mode, cold (its energies too) and again; the coupled harmonics of one wave and of three,
prepared; and how far first order lies from the coupled solve.
"""

import time

from shell.elastic import Elastic
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, PointMass, Sum, find_split, wave
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem

SILICA = Elastic(72.7e9, 0.17, 2203.0)
H = 0.9e-3


def best(work, count=15):
    times = []
    for _ in range(count):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return 1e3 * min(times)


def main():
    one = Imperfection(thickness=wave(4, 0.01 * H, 0.3))
    three = Imperfection(
        thickness=Sum(((1.0, wave(1, 0.02 * H)), (1.0, wave(3, 0.01 * H, 0.4)), (1.0, wave(4, 0.01 * H, 0.3)))),
        masses=(PointMass(1e-8, 0.2),),
    )
    domes = {
        "free dome": hemisphere(radius=15e-3, thickness=H),
        "dome on a stem": hemisphere(radius=15e-3, thickness=H, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3)),
    }
    for name, resonator in domes.items():
        (mode,) = solve_modes(resonator, SILICA, 2)
        _ = mode.solution.strain, mode.solution.displacement, mode.solution.eigenvalue
        pair, coupled = Pair(mode), CoupledHarmonics(mode, SILICA)
        first = best(lambda mode=mode: find_split(Pair(mode), one))
        again = best(lambda pair=pair: find_split(pair, one))
        coupled.solve(three)
        single, several = (best(lambda c=coupled, flaw=flaw: c.solve(flaw), 60) for flaw in (one, three))
        small = coupled.solve(Imperfection(thickness=wave(4, 1e-5 * H))).relative / 1e-5
        far = coupled.solve(one).relative / 1e-2 / small - 1
        print(
            f"{name}: first order {first:.2f} ms, again {again:.3f} ms; coupled {single:.1f} ms (one wave), {several:.1f} ms (three waves and a mass); "
            f"at 1 % of thickness they differ by {far:.1e}; perfect {coupled.solve(Imperfection()).relative:.1e}"
        )


if __name__ == "__main__":
    main()
