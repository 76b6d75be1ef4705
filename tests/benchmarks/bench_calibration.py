"""Calibrations of devices that were drawn from the priors of the shipped cards.

    python tests/benchmarks/bench_calibration.py [--first 0] [--devices 54] [--rate 0.033]

Set points jump between two rows. Device k is drawn from the card k modulo 4 with seed k, runs through two profiles, and is calibrated
from the undrawn card. A line for each, then, by card too: residual over what the same fit leaves of the noise that is really in the
records (targets: within 3 %; of the noise of all columns, and of that column alone), how often 90 % intervals hold the device (86 to
94 %), and how often the next run, predicted from its chamber alone, is within twice its noise (90 %); the noise of that run is what is
really in it ("drawn"), and the rms of eight such draws ("usual"), since wander differs from run to run. "stated": what is left of the
next run over the root of what calibration and noise state of it. "reached": how often the next run's frequency is within twice
its noise, over 400 draws of that noise: one draw for each device says little, the error of a calibration being of the size of a noise that
itself varies twofold from run to run. "ideal": the same for errors as they would be, were the levels of all noise known: to first order
nothing that is estimated from these records is closer on average.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from compensation.noise import Noise
from studies.calibration.calibrate import Calibration, calibrate
from studies.calibration.fit import CardFit, stated_noise
from studies.calibration.observed import HOUSING
from studies.calibration.priors import gather_priors
from studies.instrument.card import load_card
from studies.instrument.tables.noise import NoiseKeys
from studies.simulation.chamber import load_profile
from studies.simulation.drive import Drive, drive_by_profile, rows_of
from studies.simulation.noise import bias_noise, frequency_noise
from studies.simulation.prediction import predict
from studies.simulation.virtual_gyro import simulate_run

Array = NDArray[np.float64]
CARDS = ("hrg-30mm", "free-dome", "cvg-25mm", "bvg-bell")
PROFILES = ("staircase 20 -10 15 75min", "ramp -10 35 0.5 then soak 35 90min")
UNSEEN = "cycle 20 -5 30 1 40min 1"
RESPONSES = ("frequency_Hz", "bias_deg_per_h", "inverse_q")
DRAWS = 400


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
    columns = [
        {name: record[name] for name in RESPONSES}
        | {HOUSING: predict(device, run.prediction.drive, law=run.law).columns[HOUSING]}
        for record, run in zip(true, runs, strict=True)
    ]
    ratios, alone = zip(*[residual_ratios(found.fit, name, columns) for name in RESPONSES], strict=True)
    truth = {value.name: value.value for value in device.uncertain}
    inside = [one.low <= truth[one.parameter] <= one.high for one in found.estimates]
    told = [hit for hit, one in zip(inside, found.estimates, strict=True) if one.told_by == "data"]
    missed = [one.parameter for hit, one in zip(inside, found.estimates, strict=True) if not hit]
    unseen, count = load_profile(UNSEEN), len(found.fit.problem.priors.values)
    measured = simulate_run(device, unseen, rate, 100 * seed + 9).record
    exact = simulate_run(device, unseen, rate, noise=False).record
    predicted = simulate_run(found.instrument, unseen, rate, noise=False).record
    usual = usual_noise(device.noise, len(exact), rate, exact["inverse_q"], np.random.default_rng(seed))
    left = {name: rms(measured[name] - predicted[name]) for name in RESPONSES}
    drawn = [left[name] / rms(measured[name] - exact[name]) for name in RESPONSES]
    ahead = [left[name] / usual[name] for name in RESPONSES]
    drive = drive_by_profile(unseen, rows_of(unseen, rate))
    slope = slopes_ahead(found, drive)
    spread = {
        name: np.sqrt(np.mean(np.sum(J @ found.fit.covariance[:count, :count] * J, axis=1)))
        for name, J in slope.items()
    }
    stated = [left[name] / np.hypot(spread[name], usual[name]) for name in RESPONSES]
    off = predicted["frequency_Hz"] - exact["frequency_Hz"]
    generator = np.random.default_rng(seed)
    reached = within_twice([off], device.noise, rate, generator)
    ideal = within_twice(
        ideal_errors(found.fit, device.noise, slope["frequency_Hz"], drive, generator), device.noise, rate, generator
    )
    print(
        f"{seed:3d} {card.name:9s} steps {found.fit.steps:2d}{'' if found.fit.converged else ' not converged'}  cpu {spent:5.1f} s"
        f"  residual/noise {' '.join(f'{r:.3f}' for r in ratios)}, alone {alone[0]:.3f}  inside {np.mean(inside):.2f}, told {np.mean(told):.2f}"
        f"  next run/noise drawn {' '.join(f'{r:.2f}' for r in drawn)}, usual {' '.join(f'{r:.2f}' for r in ahead)},"
        f" stated {' '.join(f'{r:.2f}' for r in stated)}, reached {reached:.2f}, ideal {ideal:.2f}"
        f"  missed {' '.join(missed)}",
        *(f"    {warning}" for warning in found.warnings),
        sep="\n",
        flush=True,
    )
    return {
        "ratio": [*ratios], "alone": [*alone], "inside": inside, "told": told, "drawn": drawn, "ahead": ahead,
        "stated": stated, "reached": [reached], "ideal": [ideal], "cpu": [spent],
    }  # fmt: skip


def residual_ratios(fit: CardFit, name: str, true: list[dict[str, Array]]) -> tuple[float, float]:
    """Residual over what the same fit leaves of the noise that is really in all columns, and in this one alone; without means of runs."""
    problem, slope = fit.problem, fit.state.slope
    noise = {response: np.zeros(len(fit.state.residual[response])) for response in problem.responses}
    for response in problem.responses:
        for part, rows in zip(problem.members(response), problem.rows[response].slices, strict=True):
            blocks = problem.runs[part.run].responses[response]
            noise[response][rows] = blocks.value - blocks.average(true[part.run][response])
    J = {one: fit.rows[one].whiten(slope[one], fit.noise[one]) for one in problem.responses}
    square = sum((one.T @ one for one in J.values()), np.eye(fit.problem.count))
    pull = {one: J[one].T @ fit.rows[one].whiten(noise[one], fit.noise[one]) for one in problem.responses}

    def spread(values: Array) -> float:
        return rms(np.concatenate([values[rows] - values[rows].mean() for rows in problem.rows[name].slices]))

    together = noise[name] - slope[name] @ np.linalg.solve(square, sum(pull.values()))
    alone = noise[name] - slope[name] @ np.linalg.solve(square, pull[name])
    left = spread(fit.state.residual[name])
    return left / spread(together), left / spread(alone)


def slopes_ahead(found: Calibration, drive: Drive) -> dict[str, Array]:
    """Derivatives of a run's columns by the coordinates of the card's values."""
    priors = found.fit.problem.priors
    derivatives = predict(found.fit.problem.instrument_at(found.fit.point), drive, priors.names).derivatives
    scale = priors.slopes(found.fit.point[: len(priors.values)])
    return {name: np.column_stack([derivatives[one][name] for one in priors.names]) @ scale for name in RESPONSES}


def within_twice(errors: Sequence[Array], levels: NoiseKeys, rate: float, generator: np.random.Generator) -> float:
    """How often a frequency that is predicted with these errors is within twice the noise of the run."""
    noises = [frequency_noise(levels).draw(len(errors[0]), rate, generator) for _ in range(DRAWS)]
    return float(
        np.mean([rms(off + noise) < 2 * rms(noise) for off, noise in zip(cycle(errors), noises, strict=False)])
    )


def ideal_errors(
    fit: CardFit, levels: NoiseKeys, ahead: Array, drive: Drive, generator: np.random.Generator
) -> list[Array]:
    """Draw errors of a predicted frequency that are left where the levels of all noise are known: (JᵀJ + 1)⁻¹ with them."""
    problem = fit.problem
    total = np.eye(problem.count)
    for name in problem.responses:
        blocks = [problem.runs[part.run].responses[name] for part in problem.members(name)]
        white = {
            "frequency_Hz": levels.frequency_white_Hz,
            "bias_deg_per_h": 60 * levels.bias_white_deg_per_rt_h,
            "inverse_q": levels.inverse_q_white * float(np.mean(np.concatenate([one.value for one in blocks]))),
            HOUSING: levels.housing_white_K,
        }[name]
        noise = replace(stated_noise(levels, name) or Noise(), white=white)
        J = problem.rows[name].whiten(fit.state.slope[name], noise)
        total = total + J.T @ J
    count = ahead.shape[1]
    moves = generator.multivariate_normal(np.zeros(count), np.linalg.inv(total)[:count, :count], size=DRAWS)
    return list(moves @ ahead.T)


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
    for place, card in enumerate(CARDS):
        of_card = [one for seed, one in enumerate(found, given.first) if seed % 4 == place]
        if of_card:
            print(f"{card}, {len(of_card)} devices")
            sum_up(of_card)
    print(f"all, {len(found)} devices")
    sum_up(found)


def sum_up(found: list[dict[str, list[float]]]) -> None:
    """Print what the devices show together."""
    total = {key: [x for one in found for x in one[key]] for key in found[0]}
    for k, name in enumerate(RESPONSES):
        ratio, alone, drawn, ahead, stated = (
            np.array([one[key][k] for one in found]) for key in ("ratio", "alone", "drawn", "ahead", "stated")
        )
        print(
            f"  {name}: residual/noise median {np.median(ratio):.3f}, within 3 % in {np.mean(np.abs(ratio - 1) < 0.03):.0%}"
            f" (alone {np.mean(np.abs(alone - 1) < 0.03):.0%}); next run within twice the noise in {np.mean(drawn < 2):.0%} (drawn),"
            f" {np.mean(ahead < 2):.0%} (usual), median {np.median(drawn):.2f}, {np.median(ahead):.2f}; over stated rms"
            f" {rms(stated):.2f}, below twice in {np.mean(stated < 2):.0%}"
        )
    print(
        f"  next run's frequency within twice the noise, over draws of that noise: {np.mean(total['reached']):.0%}; ideal"
        f" {np.mean(total['ideal']):.0%}"
    )
    print(
        f"  90 % intervals hold the device in {np.mean(total['inside']):.1%} of {len(total['inside'])} values, in"
        f" {np.mean(total['told']):.1%} of the {len(total['told'])} that the data tells; CPU median {np.median(total['cpu']):.1f} s"
    )


if __name__ == "__main__":
    main()
