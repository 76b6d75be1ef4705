"""Time of one mode by the shell-mode solver: run by hand, OPENBLAS_NUM_THREADS=1 python tests/benchmarks/bench_modes.py.

Processor time, the shortest of several runs; figures go to history.jsonl. "cached" keeps the operators of the geometry (a new material or temperature); "cold" starts from the dimensions.
"""

from collections.abc import Callable
from functools import partial
from time import process_time

from history import record

import shell.corner
import shell.root
import shell.surplus
from shell.assembly import build_system
from shell.elastic import Elastic
from shell.meridian import cylinder, hemisphere
from shell.modes import solve_modes
from shell.resonator import Resonator, Stem
from studies.instrument.card import load_card, shipped_cards

SILICA = Elastic(72.7e9, 0.17, 2203.0)
CASES = {
    "free hemisphere": hemisphere(15e-3, 0.9e-3),
    "stem with fillet": hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, fillet=0.5e-3)),
    "sharp stem": hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3)),
    "clamped cup": cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3),
}


MANY = {  # n, modes, tolerance
    "16 modes": (2, 16, 1e-5),
    "8 modes of n = 5": (5, 8, 1e-5),
    "n = 20": (20, 1, 1e-5),
    "tolerance 1e-3": (2, 1, 1e-3),
    "tolerance 1e-7": (2, 1, 1e-7),
}


def fastest(run: Callable[[], object], times: int) -> float:
    """Shortest of several runs, ms."""
    best = float("inf")
    for _ in range(times):
        start = process_time()
        run()
        best = min(best, process_time() - start)
    return 1e3 * best


def forget() -> None:
    """Empty every cache that depends on the geometry."""
    for cached in (build_system, shell.surplus.extend, shell.root._find_frame, shell.corner._meet):
        cached.cache_clear()


def cold(resonator: Resonator, theory: str) -> None:
    forget()
    solve_modes(resonator, SILICA, theory=theory)  # type: ignore[arg-type]


def main() -> None:
    figures: dict[str, float] = {}
    print(f"{'case':18}{'theory':8}{'frequency Hz':>14}{'estimate':>10}{'cached ms':>11}{'cold ms':>9}")
    for name, resonator in CASES.items():
        for theory in ("shell", "solid"):
            (mode,) = solve_modes(resonator, SILICA, theory=theory)  # type: ignore[arg-type]
            figures[f"{name}, {theory}"] = cached = fastest(
                lambda r=resonator, t=theory: solve_modes(r, SILICA, theory=t), 10
            )  # type: ignore[misc]
            fresh = fastest(lambda r=resonator, t=theory: cold(r, t), 5)  # type: ignore[misc]
            print(
                f"{name:18}{theory:8}{mode.frequency:14.4f}{mode.relative_error_estimate:10.1e}{cached:11.2f}{fresh:9.1f}"
            )
    print("\nof the free hemisphere, solid, operators cached:")
    for name, (n, count, tolerance) in MANY.items():
        run = partial(solve_modes, CASES["free hemisphere"], SILICA, n, count, tolerance=tolerance)
        run()
        figures[name] = fastest(run, 10)
        print(f"{name:18}{figures[name]:8.2f} ms")
    print("\nfrom a card to its frequency, after imports, nothing of the geometry cached:")
    for name in shipped_cards():

        def from_card(name: str = name) -> None:
            forget()
            instrument = load_card(name)
            solve_modes(instrument.resonator, instrument.material.elastic(instrument.reference_temperature))

        figures[name] = fastest(from_card, 20)
        print(f"{name:18}{figures[name]:8.1f} ms")
    record("time of one mode", milliseconds={name: round(value, 3) for name, value in figures.items()})


if __name__ == "__main__":
    main()
