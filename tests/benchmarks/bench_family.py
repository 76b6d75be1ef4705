"""Designs per second of a family with its error estimate, and whether the estimate holds; run by hand.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python tests/benchmarks/bench_family.py [CHECKED [NAME …]]

`free`: a hemisphere of radius 15 mm, thickness 0.5 ... 1.2 mm, four Chebyshev shapes of ±10 % each (±40 % at the corners),
ν 0.14 ... 0.20. The shipped cards with solid parts in a wide box of the same kind (`hrg-30mm-wide`; the cup's wall has two
shapes), and in a box of ±5 % (`hrg-30mm`); E, ρ, radius free. Seconds are those of the process.
"""

import os
import resource
import sys
import time
from dataclasses import replace
from itertools import product

import numpy as np

from shell.family import build_family
from shell.meridian import hemisphere
from studies.instrument.card import load_card

CHEBYSHEV = [lambda x, k=k: np.cos(k * np.arccos(np.clip(2 * x - 1, -1, 1))) for k in (1, 2, 3, 4)]
DESIGNS = 65_536
CARDS = ("hrg-30mm", "cvg-25mm", "bvg-bell")
NU = (0.14, 0.20)


def boxes():
    """Return resonator and ranges by name."""
    free = hemisphere(15e-3, 0.9e-3)
    found = {"free": (free, {"thickness": (0.5e-3, 1.2e-3), "nu": NU, "shapes": CHEBYSHEV})}
    others = {name: load_card(name).resonator for name in CARDS}
    others["clamped-rim"] = hemisphere(15e-3, 0.9e-3, support="clamped-rim")
    for name, resonator in others.items():
        h = max(value for _, value in resonator.thickness)
        stem = {"stem": (0.99, 1.01)} if resonator.stem else {}
        foot = resonator.thickness[1][0]
        wall = [((0, 0), (foot, 0), (foot, 1), (1, 1)), ((0, 0), (foot, 0), (foot, -1), (1, 1))]
        shapes = wall if name == "cvg-25mm" else CHEBYSHEV
        found[name + "-wide"] = (resonator, {"thickness": (0.6 * h, 1.35 * h), "nu": NU, "shapes": shapes, **stem})
        found[name] = (resonator, {"thickness": (0.95 * h, 1.05 * h), "nu": (0.16, 0.18), **stem})
    return found


def scale(family, unit):
    """Return the designs of points of the cube -1 ... 1: thickness, ν, stem, shapes."""
    spans = (family.thickness, family.nu, family.stem)
    values = [(low + high) / 2 + (high - low) / 2 * x for (low, high), x in zip(spans, unit.T, strict=False)]
    return dict(zip(("thickness", "nu", "stem"), values, strict=True)) | {"shapes": family.amplitude * unit[:, 3:]}


def main(checked, names):
    """Print one line for each box, theory and tolerance."""
    print(f"threads of BLAS: {os.environ.get('OPENBLAS_NUM_THREADS', 'not limited')}; load {os.getloadavg()[0]:.1f}")
    for name, (resonator, ranges) in boxes().items():
        for theory, tolerance in (("shell", 3e-5), ("solid", 3e-5), ("shell", 1e-6), ("solid", 1e-6)):
            solid_parts = name != "free"
            if (names and name not in names) or (
                solid_parts and (theory == "shell" or ("wide" in name and tolerance < 1e-5))
            ):
                continue
            began = time.process_time()
            family = build_family(resonator, theory=theory, tolerance=tolerance, **ranges)
            built = time.process_time() - began
            print(f"{name}, {theory} {tolerance:g}: {measure(family, built, checked)}", flush=True)


def measure(family, built, checked):
    """Return rate, sizes and errors in words."""
    if not family.cells:
        return family.reason
    rng, d = np.random.default_rng(99), family.shape_count + 3
    designs = scale(family, rng.uniform(-1, 1, (DESIGNS, d)))
    designs |= {"E": rng.uniform(70e9, 75e9, DESIGNS), "rho": rng.uniform(2150, 2250, DESIGNS)}
    times = []
    for _ in range(20):  # short enough to find quiet moments of a shared machine
        began = time.process_time()
        found = family.evaluate(**designs)
        times.append(time.process_time() - began)
        if found.solved_in_full.any():
            break
    inside, faces = rng.uniform(-1, 1, (checked // 2, d)), np.clip(rng.uniform(-2, 2, (checked // 2, d)), -1, 1)
    some = scale(family, np.vstack([list(product((-1.0, 1.0), repeat=d)), inside, faces]))
    quick = family.evaluate(**some, E=1.0, rho=1.0)
    began = time.process_time()
    full = replace(family, tolerance=1e-15).evaluate(**some, E=1.0, rho=1.0)
    seconds = (time.process_time() - began) / len(full.frequency)
    error = abs(quick.frequency / full.frequency - 1)
    kept = ~quick.solved_in_full
    share = error[kept] / (quick.relative_error_estimate + full.relative_error_estimate)[kept]
    models = [cell.model for cell in family.cells]
    return (
        f"{DESIGNS / min(times):,.0f} designs/s at best, {DESIGNS / np.median(times):,.0f} in the median, "
        f"{found.solved_in_full.sum()} of {DESIGNS} in full; built in {built:.1f} s; vectors {[one.size for one in models]}, "
        f"{[str(one.stiffness.dtype) for one in models]}; of {len(error)} checked {quick.solved_in_full.sum()} in full "
        f"({1e3 * seconds:.0f} ms each), error at most {error.max():.1e}, stated at most "
        f"{quick.relative_error_estimate.max():.1e}, beyond the stated {np.sum(share > 1)}, largest share {share.max():.2f}; "
        f"error of the level {family.theory_error:.1e}; "
        f"memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000, sys.argv[2:])
