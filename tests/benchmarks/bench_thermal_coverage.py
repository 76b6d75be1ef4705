"""Count, over many seeds, how often 90 % intervals of thermal constants hold the planted value; run by hand.

    python tests/benchmarks/bench_thermal_coverage.py [SEEDS]

Linear lags with white noise, random walks and wanders of two memories, and a radiating shell with a random walk.
"""

import importlib.util
import sys
import time
from pathlib import Path

import numpy as np

PATH = Path(__file__).parents[1] / "studies" / "test_recovery_thermal_constants.py"
SPEC = importlib.util.spec_from_file_location("planted", PATH)
planted = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(planted)

NOISES = {
    "white 3 mHz": {"white": 3e-3},
    "white 3 mHz, walk 0.05 mHz": {"white": 3e-3, "walk": 5e-5},
    "white 3 mHz, walk 0.3 mHz": {"white": 3e-3, "walk": 3e-4},
    "white 1 mHz, wander 3 mHz over 400 s": {"white": 1e-3, "wander": 3e-3, "memory": 400.0},
    "white 1 mHz, wander 3 mHz over 5000 s": {"white": 1e-3, "wander": 3e-3, "memory": 5000.0},
}
LAW = {"slope": planted.SLOPE, "curvature": planted.CURVATURE}


def report(name, fits, truth, began):
    for constant, value in truth.items():
        estimates = [fit.estimates[constant] for fit in fits]
        held = np.mean([planted.covers(estimate, value) for estimate in estimates])
        width = np.median([(e.high - e.low) / abs(value) for e in estimates])
        print(f"{name:40s} {constant:16s} held {100 * held:5.1f} %  width {100 * width:.3g} %")
    print(f"{'':40s} {(time.perf_counter() - began) / len(fits):.2f} s per fit", flush=True)


def main(seeds):
    for name, noise in NOISES.items():
        began = time.perf_counter()
        runs = [planted.one_lag(np.random.default_rng(seed), **noise) for seed in range(seeds)]
        fits = [planted.identify([run], planted.make_lags(1000.0), planted.FREE_LAW) for run in runs]
        report(name, fits, {"time_constant_1": 1800.0, **LAW}, began)
    began = time.perf_counter()
    follower = planted.NetworkFollower((planted.CONDUCTANCE, planted.EXCHANGE), planted.radiating, "shell", 1)
    runs = [planted.radiative_record(np.random.default_rng(seed)) for seed in range(max(seeds // 4, 1))]
    fits = [planted.identify([run], follower, planted.FREE_LAW) for run in runs]
    report("radiation, walk 0.1 mHz", fits, {"conductance": 8e-4, "exchange": 1.2e-4, **LAW}, began)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
