"""Designs per second of a family with its error estimate, and whether the estimate holds; run by hand.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python tests/benchmarks/bench_family.py [CHECKED]

A free hemisphere of radius 15 mm: thickness 0.5 ... 1.2 mm, four Chebyshev shapes of ±10 % each (±40 % at the corners),
ν 0.14 ... 0.20, and E, ρ, radius free.
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

CHEBYSHEV = [lambda x, k=k: np.cos(k * np.arccos(np.clip(2 * x - 1, -1, 1))) for k in (1, 2, 3, 4)]
DESIGNS = 65_536


def draw(rng, count, faces=False):
    """Return random designs of the box; of `faces` about half the numbers are at the end of their range."""
    unit = np.clip(rng.uniform(-2, 2, (count, 6)), -1, 1) if faces else rng.uniform(-1, 1, (count, 6))
    return scale(unit)


def scale(unit):
    """Return the designs of points of the cube -1 ... 1."""
    return {
        "thickness": np.clip(0.85e-3 + 0.35e-3 * unit[:, 0], 0.5e-3, 1.2e-3),
        "shapes": 0.1 * unit[:, 1:5],
        "nu": np.clip(0.17 + 0.03 * unit[:, 5], 0.14, 0.20),
    }


def main(checked):
    """Print one line for each theory and tolerance."""
    print(f"threads of BLAS: {os.environ.get('OPENBLAS_NUM_THREADS', 'not limited')}; load {os.getloadavg()[0]:.1f}")
    for theory, tolerance in (("shell", 3e-5), ("solid", 3e-5), ("shell", 1e-6), ("solid", 1e-6)):
        began = time.perf_counter()
        family = build_family(
            hemisphere(15e-3, 0.9e-3),
            thickness=(0.5e-3, 1.2e-3),
            nu=(0.14, 0.20),
            shapes=CHEBYSHEV,
            theory=theory,
            tolerance=tolerance,
        )
        built = time.perf_counter() - began
        rng = np.random.default_rng(99)
        designs = draw(rng, DESIGNS) | {"E": rng.uniform(70e9, 75e9, DESIGNS), "rho": rng.uniform(2150, 2250, DESIGNS)}
        times = []
        for _ in range(20):  # short enough to find quiet moments of a shared machine
            began = time.perf_counter()
            found = family.evaluate(**designs)
            times.append(time.perf_counter() - began)
        corners = scale(np.array(list(product((-1.0, 1.0), repeat=6))))
        faces, inside = draw(rng, checked // 2, faces=True), draw(rng, checked // 2)
        some = {name: np.concatenate([corners[name], faces[name], inside[name]]) for name in corners}
        quick = family.evaluate(**some, E=1.0, rho=1.0)
        full = replace(family, tolerance=1e-15).evaluate(**some, E=1.0, rho=1.0)
        error = abs(quick.frequency / full.frequency - 1)
        print(
            f"{theory} {tolerance:g}: {DESIGNS / min(times):,.0f} designs/s at best, {DESIGNS / np.median(times):,.0f} in the median, {found.solved_in_full.sum()} of {DESIGNS} in full; built in "
            f"{built:.1f} s, vectors {[cell.model.size for cell in family.cells]}; of {len(error)} checked {quick.solved_in_full.sum()} in full, "
            f"error at most {error.max():.1e}, stated at most {quick.relative_error_estimate.max():.1e}, beyond the stated "
            f"{np.sum(error > quick.relative_error_estimate)}, largest share {np.max(error / quick.relative_error_estimate):.2f}; "
            f"error of the level {family.theory_error:.1e}; memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
