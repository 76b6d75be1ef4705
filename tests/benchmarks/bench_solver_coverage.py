"""How often the error that the solver states is the error that it has: random cards, n <= 30, eight modes each; run by hand.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python tests/benchmarks/bench_solver_coverage.py --cards 2000 --seconds 170

Every card is solved as users do (tolerance 1e-5) and again with orders two levels higher on elements half as long, from
another start of the iteration: a self-check of orders, cells and iteration, not of the geometry or the equations. Those are
held against NGSolve (fourier_ngsolve.py: its own mesh, basis, quadrature and eigensolver) on `--independent` cards.
A card is covered if no mode is farther from its reference than stated, or if the solver warned or refused by name.
`--first` continues an earlier run, so that 2000 cards are done in pieces; figures go to history.jsonl.
"""

import argparse
import sys
import time
import warnings
from collections import Counter
from dataclasses import replace
from math import pi, sqrt

import numpy as np
from history import record

from shell.assembly import lay_system
from shell.curves import Line
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.meridian import bell, cylinder, hemisphere, meridian
from shell.modes import solve_modes
from shell.refinement import solve_level
from shell.resonator import Stem

TOLERANCE = 1e-5
MODES = 8
SEED = 2207


def random_card(number):
    """Return the kind, resonator, material and harmonic of one card of the endless list."""
    rng = np.random.default_rng([SEED, number])
    R, h = 15e-3, 15e-3 * 10 ** rng.uniform(-3.3, -0.92)
    n = int(rng.integers(0, 6) if rng.random() < 0.5 else rng.integers(6, 31))
    kinds = (dome, profiled, bead, open_dome, tube, cup, bell_shape, stem, cones, sphere)
    build = kinds[rng.integers(len(kinds))]
    return build.__name__, lambda: build(rng, R, h), Elastic(72.7e9, rng.uniform(0, 0.4), 2203.0), n


def dome(rng, R, h):
    """Free hemispheres, shallow and deep."""
    return hemisphere(R, h, rim_angle=rng.uniform(0.8, 2.6))


def profiled(rng, R, h):
    """Thickness that changes linearly between three to six knots."""
    inner = np.sort(rng.uniform(0.05, 0.95, rng.integers(1, 5)))
    return hemisphere(R, [(float(s), h * rng.uniform(0.7, 1.3)) for s in (0.0, *inner, 1.0)])


def bead(rng, R, h):
    """A rim twice as thick."""
    foot = rng.uniform(0.9, 0.98)
    return hemisphere(R, [(0.0, h), (foot, h), (foot + (1 - foot) * rng.uniform(0.05, 0.5), 2 * h), (1.0, 2 * h)])


def open_dome(rng, R, h):
    """Zones, free or clamped at one edge."""
    support = ("free", "clamped-pole", "clamped-rim")[rng.integers(3)]
    return hemisphere(R, h, pole_angle=rng.uniform(0.2, 0.6), support=support)


def tube(rng, R, h):
    """Open tubes."""
    return cylinder(R, h, R * rng.uniform(0.4, 3))


def cup(rng, R, h):
    """Cups with a bottom, free or clamped."""
    clamp = R * rng.uniform(0.1, 0.4) * rng.integers(2)
    return cylinder(R, h, R * rng.uniform(0.8, 2), bottom_thickness=h * rng.uniform(0.8, 2), clamp_radius=clamp)


def bell_shape(rng, R, h):
    """Free bells."""
    return bell(R, h, R * rng.uniform(0.2, 1), R * rng.uniform(0.2, 0.8), R * rng.uniform(1.05, 1.5))


def stem(rng, R, h):
    """Domes on stems of any side, with fillet or sharp."""
    side = ("inner", "outer", "both")[rng.integers(3)]
    a = R * rng.uniform(0.1, 0.3)
    inner, outer = -R * rng.uniform(0, 0.6), R * rng.uniform(1.3, 1.8)
    ends = {"inner": inner, "outer": outer, "both": (inner, outer)}[side]
    return hemisphere(R, h, support="stem", stem=Stem(a, ends, rng.integers(2) * a * rng.uniform(0.05, 0.4), side))


def cones(rng, R, h):
    """Two cones with a kink between them."""
    edge = R * rng.uniform(0.7, 1.3)
    chain = [Line((0.3 * R, R), (R, 0.5 * R)), Line((R, 0.5 * R), (edge, -0.8 * R))]
    return meridian(chain, h, ("clamped-pole", "clamped-rim", "free")[rng.integers(3)])


def sphere(rng, R, h):
    """Closed spheres, whose modes crowd together."""
    return hemisphere(R, h, rim_angle=pi)


def finer(level):
    """Return a level some steps higher in everything, with elements half as long."""
    return replace(
        level,
        through=tuple(k + 4 for k in level.through),
        along=min(level.along + 2, 22),
        block=level.block + 2,
        rings=min(level.rings + 3, 11),  # smaller cells are points in double precision
        split=2 * level.split,
    )


def reference(resonator, elastic, n, level):
    """Return frequencies by the finer level."""
    solutions = solve_level(lay_system(resonator, n, finer(level)), resonator.size, elastic, MODES, 1e-13)
    return np.array([sqrt(one.eigenvalue) / (2 * pi) for one in solutions])


def judge(number):
    """Return (verdict, kind, worst ratio of error and estimate, worst error, details) of one card."""
    kind, build, elastic, n = random_card(number)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            resonator = build()
            modes = solve_modes(resonator, elastic, n, MODES, tolerance=TOLERANCE)
        except ShellError as fault:
            return "refused", kind, np.nan, np.nan, str(fault)
    level = modes[0].solution.system.level
    stated = np.array([mode.relative_error_estimate for mode in modes])
    exact = reference(resonator, elastic, n, level)
    error = abs(np.array([mode.frequency for mode in modes]) / exact - 1)
    ratio = error / stated
    k = int(ratio.argmax())
    h = min(value for _, value in resonator.thickness)
    details = (
        f"n={n} h/R={h / resonator.size:.2e} mode {k} error {error[k]:.1e} stated {stated[k]:.1e} level {level.through}"
    )
    warned = any("known to" in str(one.message) for one in said)
    verdict = "within" if ratio.max() <= 1 else "warned" if warned else "missed"
    return verdict, kind, float(ratio.max()), float(error.max()), details


def independent(count):
    """Hold domes with stems, which have every kind of region, against NGSolve; yield (card, worst difference, stated)."""
    from fourier_ngsolve import modes as by_ngsolve
    from fourier_ngsolve import section, stemmed_dome

    number = done = 0
    while done < count:
        number += 1
        kind, build, elastic, n = random_card(number)
        if kind != "stem" or n == 1 or n > 12:
            continue
        try:
            resonator = build()
            h = resonator.thickness[0][1]
            if h / resonator.size < 0.01:
                continue
            found = solve_modes(resonator, elastic, n, 2, tolerance=TOLERANCE)
        except ShellError:
            continue
        outline, clamped, sharp = stemmed_dome(resonator.size, h, resonator.stem)
        mesh = section(outline, clamped, 2 * h, [])
        f, unknowns = by_ngsolve(mesh, elastic, n, 4, 7, 0.99 * found[0].frequency, sharp, 9 if sharp else 0)
        apart = [float(min(abs(mode.frequency / f - 1))) for mode in found]
        done += 1
        yield number, max(apart), max(mode.relative_error_estimate for mode in found), unknowns


def main():
    """Print the table and keep the figures."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--cards", type=int, default=2000, help="number of the last card")
    options.add_argument("--first", type=int, default=0, help="number of the first card")
    options.add_argument("--seconds", type=float, default=170.0, help="processor time after which to stop")
    options.add_argument("--independent", type=int, default=0, help="cards to hold against NGSolve instead")
    chosen = options.parse_args()
    if chosen.independent:
        rows = list(independent(chosen.independent))
        for number, apart, stated, unknowns in rows:
            print(
                f"card {number:4d}: differs by {apart:.1e}, stated {stated:.1e} ({unknowns} unknowns in NGSolve)",
                flush=True,
            )
        worst = max(apart / stated for _, apart, stated, _ in rows)
        record("solver against NGSolve", cards=len(rows), worst_ratio=worst, worst=max(row[1] for row in rows))
        return 0
    verdicts, ratios, errors, number = Counter(), [], [], chosen.first
    for number in range(chosen.first, chosen.cards):
        if time.process_time() > chosen.seconds:
            break
        verdict, kind, ratio, error, details = judge(number)
        if not number % 50:
            print(f"{number:5d} at {time.process_time():.0f} s", flush=True)
        verdicts[verdict] += 1
        ratios.append(ratio)
        errors.append(error)
        if verdict != "within":
            print(f"{number:5d} {verdict:8} {kind:10} {ratio:8.2f}  {details}", flush=True)
    else:
        number = chosen.cards
    done = sum(verdicts.values())
    covered = (done - verdicts["missed"]) / done
    print(f"cards {chosen.first} ... {number - 1}: {dict(verdicts)}; covered {100 * covered:.2f} %")
    print(
        f"error over estimate: median {np.nanmedian(ratios):.2f}, 99 % {np.nanquantile(ratios, 0.99):.2f}; continue with --first {number}"
    )
    record(
        "coverage of stated errors",
        cards=done,
        first=chosen.first,
        **verdicts,
        covered=covered,
        ratio_median=float(np.nanmedian(ratios)),
        ratio_99=float(np.nanquantile(ratios, 0.99)),
        seconds=time.process_time(),
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
