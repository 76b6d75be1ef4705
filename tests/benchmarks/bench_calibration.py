"""Calibrations of devices that were drawn from the priors of the shipped cards.

    python tests/benchmarks/bench_calibration.py [--first 0] [--devices 54]

Device k is drawn from the card k modulo 4 with seed k, runs through two profiles, and is calibrated from the undrawn card. A line for
each, then: residual over the noise that is really in the records (targets: within 3 %), how often 90 % intervals hold the device (86 to 94 %),
and how often the next run, predicted from its chamber alone, is within twice its noise (90 %).
"""

import argparse
import time

import numpy as np

from studies.calibration.calibrate import calibrate
from studies.calibration.priors import gather_priors
from studies.instrument.card import load_card
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run

CARDS = ("hrg-30mm", "free-dome", "cvg-25mm", "bvg-bell")
PROFILES = ("staircase 20 -10 15 75min", "ramp -10 35 0.5 then soak 35 90min")
UNSEEN = "cycle 20 -5 30 1 40min 1"
RATE = 1 / 30
RESPONSES = ("frequency_Hz", "bias_deg_per_h", "inverse_q")


def measure(seed: int) -> dict[str, list[float]]:
    """Draw, run, calibrate and predict one device."""
    card = load_card(CARDS[seed % 4])
    priors = gather_priors(card)
    device = card.with_values(priors.at(priors.inside(np.random.default_rng(seed).standard_normal(len(priors.values)))))
    runs = [simulate_run(device, load_profile(words), RATE, 100 * seed + k) for k, words in enumerate(PROFILES)]
    true = [
        simulate_run(device, load_profile(words), RATE, noise=False, law=run.law)
        for words, run in zip(PROFILES, runs, strict=True)
    ]
    began = time.process_time()
    found = calibrate(card, [run.record for run in runs], profile=False)
    spent = time.process_time() - began
    problem, state = found.fit.problem, found.fit.state
    ratios = []
    for name in RESPONSES:
        noise, residual = [], []
        for part, rows in zip(problem.members(name), problem.rows[name].slices, strict=True):
            blocks = problem.runs[part.run].responses[name]
            really = blocks.value - blocks.average(true[part.run].record[name])
            noise.append(really - really.mean())
            residual.append(state.residual[name][rows] - state.residual[name][rows].mean())
        ratios.append(float(np.linalg.norm(np.concatenate(residual)) / np.linalg.norm(np.concatenate(noise))))
    truth = {value.name: value.value for value in device.uncertain}
    inside = [one.low <= truth[one.parameter] <= one.high for one in found.estimates]
    told = [hit for hit, one in zip(inside, found.estimates, strict=True) if one.told_by == "data"]
    unseen = load_profile(UNSEEN)
    measured = simulate_run(device, unseen, RATE, 100 * seed + 9).record
    exact = simulate_run(device, unseen, RATE, noise=False).record
    predicted = simulate_run(found.instrument, unseen, RATE, noise=False).record
    ahead = [
        float(np.linalg.norm(measured[name] - predicted[name]) / np.linalg.norm(measured[name] - exact[name]))
        for name in RESPONSES
    ]
    print(
        f"{seed:3d} {card.name:9s} steps {found.fit.steps:2d}{'' if found.fit.converged else ' not converged'}  cpu {spent:5.1f} s"
        f"  residual/noise {' '.join(f'{r:.3f}' for r in ratios)}  inside {np.mean(inside):.2f}, told {np.mean(told):.2f}"
        f"  next run/noise {' '.join(f'{r:.2f}' for r in ahead)}",
        flush=True,
    )
    return {"ratio": ratios, "inside": inside, "told": told, "ahead": ahead, "cpu": [spent]}


def main() -> None:
    """Run the devices and add up."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--devices", type=int, default=54)
    given = parser.parse_args()
    found = [measure(seed) for seed in range(given.first, given.first + given.devices)]
    total = {key: [x for one in found for x in one[key]] for key in found[0]}
    for k, name in enumerate(RESPONSES):
        ratio = np.array([one["ratio"][k] for one in found])
        ahead = np.array([one["ahead"][k] for one in found])
        print(
            f"{name}: residual/noise median {np.median(ratio):.3f}, within 3 % in {np.mean(np.abs(ratio - 1) < 0.03):.0%};"
            f" next run within twice the noise in {np.mean(ahead < 2):.0%}, median {np.median(ahead):.2f}"
        )
    print(
        f"90 % intervals hold the device in {np.mean(total['inside']):.1%} of {len(total['inside'])} values, in"
        f" {np.mean(total['told']):.1%} of the {len(total['told'])} that the data tells; CPU median {np.median(total['cpu']):.1f} s"
    )


if __name__ == "__main__":
    main()
