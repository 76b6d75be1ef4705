"""How often the intervals of a whole-angle run cover, and how far its values are from the truth: python tests/benchmarks/bench_whole_angle.py.

Cards of several Q, splits, axes and errors of the electronics, each run through the loops with noise, turned both ways for an hour
and a half, and fitted by `fit_whole_angle`. Targets: values within 2 %, intervals of 95 % that cover.
"""

import time

import numpy as np

from compensation.electronics import Channels, Electronics, LoopNoise
from compensation.wave import from_quality
from tests.compensation.test_recovery_whole_angle import run_and_fit

CARDS = {
    # Q, anisotropy, split (Hz), precession (deg/s), gain ratio, phase (rad), pick-off noise (1/√Hz)
    "Q 1e5": (1e5, 0.02, 0.05, 1.0, 0.005, 0.01, 1e-6),
    "Q 1e6": (1e6, 0.03, 0.01, 0.5, 0.01, 0.01, 1e-6),
    "Q 1e6, noisy": (1e6, 0.03, 0.01, 0.5, 0.01, 0.01, 1e-5),
    "Q 1e7": (1e7, 0.01, 0.002, 0.1, 0.002, 0.005, 1e-6),
    "Q 1e7, 60 mHz": (1e7, 0.05, 0.06, 0.2, 0.005, 0.003, 1e-6),
}
SEEDS = 8
NAMES = (
    "decay",
    "damping_split",
    "damping_axis",
    "frequency_split",
    "frequency_axis",
    "gain_ratio",
    "phase_error",
    "rate",
)


def one_run(card: tuple[float, ...], seed: int) -> dict[str, tuple[float, bool]]:
    """Return of each value its error (of its size; axes: of 1/4 rad) and whether its interval covers."""
    quality, anisotropy, split, precession, gain, phase, noise = card
    rng = np.random.default_rng(seed)
    axis_tau, axis_omega = rng.uniform(-0.6, 0.6, 2)
    gain, phase = gain * rng.choice([-1, 1]), phase * rng.uniform(0.7, 1.3)
    wave = from_quality(
        4432.0,
        quality,
        damping_anisotropy=anisotropy,
        damping_axis=axis_tau,
        frequency_split=split,
        frequency_axis=axis_omega,
    )
    pickoff = Channels(gain, 0.0, rng.uniform(-3e-3, 3e-3))
    electronics = Electronics(pickoff, Channels(phase=phase), LoopNoise(noise, 10 * noise, 5e-5, thermal=3e-9))
    fit = run_and_fit(wave, electronics, lambda t: np.radians(precession) * np.where(t < 2700, 1.0, -1.0), rng)
    drift = wave.damping_split / (2 * wave.coupling)
    truth = {
        "decay": 1 / wave.tau,
        "damping_split": wave.damping_split,
        "damping_axis": axis_tau,
        "frequency_split": wave.frequency_split,
        "frequency_axis": axis_omega,
        "gain_ratio": gain,
        "phase_error": phase,
        "rate": 0.0,
    }
    found = {}
    for name, value in truth.items():
        estimate = fit.estimates[name]
        off = estimate.value - value
        if name.endswith("_axis"):
            off = (off + np.pi / 4) % (np.pi / 2) - np.pi / 4
        size = 0.25 if name.endswith("_axis") else drift if name == "rate" else abs(value)
        found[name] = abs(off) / size, bool(abs(off) <= estimate.high - estimate.value)
    return found


def main() -> None:
    """Print one line per card."""
    covered = []
    for label, card in CARDS.items():
        begin = time.process_time()
        runs = [one_run(card, seed) for seed in range(SEEDS)]
        worst = ", ".join(f"{name} {100 * max(run[name][0] for run in runs):.2g} %" for name in NAMES)
        hits = [run[name][1] for run in runs for name in NAMES]
        covered += hits
        print(f"{label}: covers {sum(hits)}/{len(hits)}; worst {worst} ({time.process_time() - begin:.0f} s)")
        missed = {name: sum(not run[name][1] for run in runs) for name in NAMES}
        print("   missed:", ", ".join(f"{name} {count}" for name, count in missed.items() if count) or "none")
    print(f"coverage {100 * np.mean(covered):.1f} % of {len(covered)} intervals of 95 %")


if __name__ == "__main__":
    main()
