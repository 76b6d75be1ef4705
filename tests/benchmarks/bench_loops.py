"""How long ten hours of a gyro's loops take, held and free, with every error of the electronics and noise.

python tests/benchmarks/bench_loops.py
"""

import time

import numpy as np

from compensation.controllers import Loops
from compensation.electronics import Channels, Electronics, LoopNoise
from compensation.rebalance import simulate_rebalance
from compensation.wave import from_quality
from compensation.wave_fit import fit_whole_angle
from compensation.whole_angle import simulate_whole_angle

TARGET = 10.0  # s


def main() -> None:
    """Print seconds of processor time beside the target."""
    wave = from_quality(
        4432.0, 1e7, damping_anisotropy=0.01, damping_axis=0.2, frequency_split=5e-3, frequency_axis=0.1
    )
    electronics = Electronics(
        Channels(0.01, 0.002, 0.003, 0.001, 0.01),
        Channels(-0.02, 0.001, 0.002, 5e-4, 0.02),
        LoopNoise(1e-6, 1e-5, 5e-5),
    )
    rows = np.arange(0.0, 36000.0)
    begin = time.process_time()
    simulate_rebalance(wave, electronics, Loops(), rows, rate=7e-5, angle=0.4, generator=np.random.default_rng(1))
    print(f"force to rebalance, 36000 rows of 1000 samples: {time.process_time() - begin:.2f} s (target {TARGET:g} s)")
    precession = np.radians(0.5) * np.where(rows < 18000, 1.0, -1.0)
    begin = time.process_time()
    run = simulate_whole_angle(
        wave, electronics, Loops(), rows, rate=7e-5, precession=precession, generator=np.random.default_rng(1)
    )
    print(f"whole angle, self-precession of 0.5 deg/s: {time.process_time() - begin:.2f} s (target {TARGET:g} s)")
    begin = time.process_time()
    fit_whole_angle(
        rows,
        run.angle,
        run.rate,
        coupling=wave.coupling,
        decay=run.decay,
        frequency=run.omega,
        quadrature=run.quadrature,
    )
    print(f"its fit: {time.process_time() - begin:.2f} s")


if __name__ == "__main__":
    main()
