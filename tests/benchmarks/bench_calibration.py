"""Calibrations of devices that were drawn from the priors of the shipped cards.

    python tests/benchmarks/bench_calibration.py [--first 0] [--devices 54] [--rate 0.033]

Set points jump between two rows. Device k is drawn from the card k modulo 4 with seed k, runs through two profiles, and is calibrated from the undrawn card. A line for
each, then: residual over what the same fit leaves of the noise that is really in the records (targets: within 3 %), how often 90 %
intervals hold the device (86 to 94 %), and how often the next run, predicted from its chamber alone, is within twice its noise (90 %);
the noise of that run is what is really in it ("drawn"), and the rms of eight such draws ("usual"), since wander differs from run to run.
"""

import argparse
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from studies.calibration.calibrate import calibrate
from studies.calibration.fit import CardFit
from studies.calibration.priors import gather_priors
from studies.instrument.card import load_card
from studies.simulation.chamber import load_profile
from studies.simulation.noise import bias_noise, frequency_noise
from studies.simulation.virtual_gyro import simulate_run

Array = NDArray[np.float64]
CARDS = ("hrg-30mm", "free-dome", "cvg-25mm", "bvg-bell")
PROFILES = ("staircase 20 -10 15 75min", "ramp -10 35 0.5 then soak 35 90min")
UNSEEN = "cycle 20 -5 30 1 40min 1"
RESPONSES = ("frequency_Hz", "bias_deg_per_h", "inverse_q")


def measure(seed: int, rate: float) -> dict[str, list[float]]:
    """Draw, run, calibrate and predict one device."""
    card = load_card(CARDS[seed % 4])
    priors = replace(gather_priors(card), wave=None)
    device = card.with_values(priors.at(priors.inside(np.random.default_rng(seed).standard_normal(len(priors.values)))))
    runs = [simulate_run(device, load_profile(words), rate, 100 * seed + k) for k, words in enumerate(PROFILES)]
    true = [
        simulate_run(device, load_profile(words), rate, noise=False, law=run.law).record
        for words, run in zip(PROFILES, runs, strict=True)
    ]
    began = time.process_time()
    found = calibrate(card, [run.record for run in runs])
    spent = time.process_time() - began
    ratios = [residual_ratio(found.fit, name, [record[name] for record in true]) for name in RESPONSES]
    truth = {value.name: value.value for value in device.uncertain}
    inside = [one.low <= truth[one.parameter] <= one.high for one in found.estimates]
    told = [hit for hit, one in zip(inside, found.estimates, strict=True) if one.told_by == "data"]
    missed = [one.parameter for hit, one in zip(inside, found.estimates, strict=True) if not hit]
    unseen = load_profile(UNSEEN)
    measured = simulate_run(device, unseen, rate, 100 * seed + 9).record
    exact = simulate_run(device, unseen, rate, noise=False).record
    predicted = simulate_run(found.instrument, unseen, rate, noise=False).record
    usual = usual_noise(device.noise, len(exact), rate, exact["inverse_q"], np.random.default_rng(seed))
    left = {name: rms(measured[name] - predicted[name]) for name in RESPONSES}
    drawn = [left[name] / rms(measured[name] - exact[name]) for name in RESPONSES]
    ahead = [left[name] / usual[name] for name in RESPONSES]
    print(
        f"{seed:3d} {card.name:9s} steps {found.fit.steps:2d}{'' if found.fit.converged else ' not converged'}  cpu {spent:5.1f} s"
        f"  residual/noise {' '.join(f'{r:.3f}' for r in ratios)}  inside {np.mean(inside):.2f}, told {np.mean(told):.2f}"
        f"  next run/noise drawn {' '.join(f'{r:.2f}' for r in drawn)}, usual {' '.join(f'{r:.2f}' for r in ahead)}"
        f"  missed {' '.join(missed)}",
        *(f"    {warning}" for warning in found.warnings),
        sep="\n",
        flush=True,
    )
    return {"ratio": ratios, "inside": inside, "told": told, "drawn": drawn, "ahead": ahead, "cpu": [spent]}


def residual_ratio(fit: CardFit, name: str, true: list[Array]) -> float:
    """Residual over what a fit of the same columns leaves of the noise that is really there, means of the runs left out."""
    problem, slope = fit.problem, fit.state.slope
    noise = {}
    for response in problem.responses:
        noise[response] = np.zeros(len(fit.state.residual[response]))
    for part, rows in zip(problem.members(name), problem.rows[name].slices, strict=True):
        blocks = problem.runs[part.run].responses[name]
        noise[name][rows] = blocks.value - blocks.average(true[part.run])
    J = np.vstack([fit.rows[one].whiten(slope[one], fit.noise[one]) for one in problem.responses])
    e = np.concatenate([fit.rows[one].whiten(noise[one], fit.noise[one]) for one in problem.responses])
    rest = noise[name] - slope[name] @ np.linalg.solve(J.T @ J + np.eye(J.shape[1]), J.T @ e)
    left = fit.state.residual[name]
    spread = [np.concatenate([x[rows] - x[rows].mean() for rows in problem.rows[name].slices]) for x in (left, rest)]
    return rms(spread[0]) / rms(spread[1])


def usual_noise(levels, count: int, rate: float, loss: Array, generator: np.random.Generator) -> dict[str, float]:  # type: ignore[no-untyped-def]
    """Rms of the noise of a run, over eight draws."""
    draws = {
        "frequency_Hz": [frequency_noise(levels).draw(count, rate, generator) for _ in range(8)],
        "bias_deg_per_h": [bias_noise(levels).draw(count, rate, generator) for _ in range(8)],
        "inverse_q": [loss * levels.inverse_q_white * np.sqrt(rate)],
    }
    return {name: rms(np.array(values)) for name, values in draws.items()}


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    """Run the devices and add up."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--devices", type=int, default=54)
    parser.add_argument("--rate", type=float, default=0.033)
    given = parser.parse_args()
    found = [measure(seed, given.rate) for seed in range(given.first, given.first + given.devices)]
    total = {key: [x for one in found for x in one[key]] for key in found[0]}
    for k, name in enumerate(RESPONSES):
        ratio, drawn, ahead = (np.array([one[key][k] for one in found]) for key in ("ratio", "drawn", "ahead"))
        print(
            f"{name}: residual/noise median {np.median(ratio):.3f}, within 3 % in {np.mean(np.abs(ratio - 1) < 0.03):.0%};"
            f" next run within twice the noise in {np.mean(drawn < 2):.0%} (drawn), {np.mean(ahead < 2):.0%} (usual),"
            f" median {np.median(drawn):.2f}, {np.median(ahead):.2f}"
        )
    print(
        f"90 % intervals hold the device in {np.mean(total['inside']):.1%} of {len(total['inside'])} values, in"
        f" {np.mean(total['told']):.1%} of the {len(total['told'])} that the data tells; CPU median {np.median(total['cpu']):.1f} s"
    )


if __name__ == "__main__":
    main()
