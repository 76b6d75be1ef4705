"""What a family of designs costs, how many designs it gives in a second, and whether its errors hold; run by hand.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python tests/benchmarks/bench_family.py [--checked 300] [NAME …]

`free`: a hemisphere of radius 15 mm, thickness ± 11 %; `free-wide`: thickness by a factor of 4, to two tolerances; `free-N`:
N thicknesses along the meridian ± 2 %, linear between them; `free-6-wide` ± 10 %. The shipped cards with solid parts:
dimensions ± 2 %, and `…-wide` ± 10 %. ν 0.14 … 0.20 everywhere. Every checked design, a third of them corners of the box, is
solved in full at the tolerance of the family's own solves. Seconds are those of the process. Figures go to history.jsonl.
"""

import argparse
import os
import time
from dataclasses import replace

import numpy as np
from history import record

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.family import Axis, build_family
from shell.meridian import hemisphere
from shell.modes import solve_modes
from studies.instrument.card import load_card
from studies.sweeps.parameters import set_parameters

NU = (0.14, 0.20)
DESIGNS = 10_000
DIMENSIONS = {
    "hrg-30mm": ("thickness_mm", "stem.radius_mm", "radius_mm"),
    "cvg-25mm": ("thickness_mm", "bottom_thickness_mm", "radius_mm"),
    "bvg-bell": ("thickness_mm", "mouth_radius_mm", "stem.radius_mm"),
}


def profiled(count, reach):
    """Return a dome with so many thicknesses along its meridian, each within ±reach of 0.9 mm."""
    at = np.linspace(0, 1, count).tolist()

    def build(values):
        return replace(hemisphere(15e-3, 0.9e-3), thickness=tuple(zip(at, (0.9e-3 * values).tolist(), strict=True)))

    return build, [Axis(f"h{k}", 1 - reach, 1 + reach) for k in range(count)]


def carded(name, reach):
    """Return a shipped card with three of its dimensions within ±reach."""
    card = load_card(name)
    paths = [f"resonator.{key}" for key in DIMENSIONS[name]]
    nominal = []
    for path in paths:
        value = card.content
        for word in path.split("."):
            value = value[word]
        nominal.append(value)

    def build(values):
        return set_parameters(card, dict(zip(paths, values.tolist(), strict=True))).resonator

    return build, [Axis(p, v * (1 - reach), v * (1 + reach)) for p, v in zip(paths, nominal, strict=True)]


def boxes():
    """Return build, axes and tolerance by name."""

    def free(low, high):
        return lambda v: hemisphere(15e-3, 0.9e-3 * v[0]), [Axis("h", low, high)]

    found = {
        "free": (*free(0.89, 1.11), 1e-8),
        "free-wide": (*free(0.5, 2.0), 1e-6),
        "free-wide-fine": (*free(0.5, 2.0), 6.5e-8),
    }
    for count in (6, 8):
        found[f"free-{count}"] = (*profiled(count, 0.02), 1e-6)
    found["free-6-wide"] = (*profiled(6, 0.1), 1e-5)
    for name in DIMENSIONS:
        found[name] = (*carded(name, 0.02), 2e-8)
        found[f"{name}-wide"] = (*carded(name, 0.1), 1e-5)
    return found


def measure(build, axes, tolerance, checked):
    """Return the figures of one box."""
    began = time.process_time()
    try:
        family = build_family(build, axes, nu=NU, tolerance=tolerance)
    except ShellError as error:
        return {"refused": str(error), "seconds": time.process_time() - began}
    seconds = time.process_time() - began
    rng, ranges = np.random.default_rng(99), np.array([*((axis.low, axis.high) for axis in axes), NU])
    middle, half = ranges.mean(axis=1), np.ptp(ranges, axis=1) / 2
    many = middle + half * rng.uniform(-1, 1, (DESIGNS, len(ranges)))
    times = []
    for _ in range(20):  # short enough to find quiet moments of a shared machine
        began = time.process_time()
        family.evaluate(many[:, :-1], nu=many[:, -1], E=72.7e9, rho=2203.0)
        times.append(time.process_time() - began)
    each = max(checked // 3, 1)
    unit = np.vstack(
        [
            rng.uniform(-1, 1, (each, len(ranges))),
            np.clip(rng.uniform(-2, 2, (each, len(ranges))), -1, 1),
            rng.choice([-1.0, 1.0], (each, len(ranges))),
        ]
    )
    some = middle + half * unit
    found = family.evaluate(some[:, :-1], nu=some[:, -1], E=1.0, rho=1.0)
    began = time.process_time()
    modes = [
        solve_modes(build(row[:-1]), Elastic(1.0, float(row[-1]), 1.0), tolerance=family.solver_tolerance)[0]
        for row in some
    ]
    solve = (time.process_time() - began) / len(modes)
    error = abs(found.frequency / np.array([mode.frequency for mode in modes]) - 1)
    turn = abs(found.bryan_factor - np.array([mode.bryan_factor for mode in modes]))
    return {
        "solves": family.solves,
        "terms": len(family.polynomial.indices),
        "seconds": seconds,
        "solver_tolerance": family.solver_tolerance,
        "ms_of_a_full_solve": 1e3 * solve,
        "ms_of_10000_designs": 1e3 * float(np.median(times)),
        "checked": len(modes),
        "stated": family.error.frequency,
        "largest": float(error.max()),
        "beyond": int(np.sum(error > family.error.frequency)),
        "bryan_stated": family.error.bryan_factor,
        "bryan_largest": float(turn.max()),
        "bryan_beyond": int(np.sum(turn > family.error.bryan_factor)),
        "theory_error": family.theory_error,
    }


def main():
    """Measure the boxes that are named, or all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = boxes()
    parser.add_argument("--checked", type=int, default=300, help="designs solved in full (300)")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(known)}; all of them unless given")
    given = parser.parse_args()
    unknown = set(given.names) - set(known)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(known)}")
    print(f"threads of BLAS: {os.environ.get('OPENBLAS_NUM_THREADS', 'not limited')}; load {os.getloadavg()[0]:.1f}")
    for name in given.names or known:
        build, axes, tolerance = known[name]
        figures = measure(build, axes, tolerance, given.checked)
        print(f"{name}, {tolerance:g}: {figures}", flush=True)
        record("families of designs", box=name, tolerance=tolerance, **figures)


if __name__ == "__main__":
    main()
