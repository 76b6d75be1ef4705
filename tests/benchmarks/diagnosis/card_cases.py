"""Campaigns of the virtual gyro of a shipped card that hides one effect, or none.

Every case: a shipped card, one to four runs of chamber programmes in words, one effect of the library with a shape and
coefficients off any grid, scaled to its SNR in 120 s means after a least-squares baseline; one case in four hides nothing.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from compensation.noise import Noise
from studies.effects import library
from studies.errors import InputError
from studies.inference.background import Background
from studies.inference.diagnosis import build_problem
from studies.inference.linear import SCALES, Linear
from studies.inference.signatures import Signatures
from studies.instrument.card import Instrument, load_card
from studies.simulation.chamber import load_drive
from studies.simulation.drive import drive_by_profile, rows_of
from studies.simulation.noise import bias_noise, frequency_noise
from studies.simulation.virtual_gyro import simulate_run
from thermal.profile import Profile

CARDS = ("hrg-30mm", "cvg-25mm", "bvg-bell", "hrg-30mm-loops")
SNRS = (3.0, 6.0, 12.0, 1.0)
RATE = 0.05
STRONGEST = float(SCALES[-1])
"""Largest size of an effect in parts of its strong cases: one that a free law and lag absorb would need far more."""
MEAN = 6
"""Rows to 120 s."""
DRIVES = {"amplitude_squared": "drive_amplitude_V", "voltage_squared": "electrode_bias_V"}
DRIVES |= {"quadrature": "quadrature_V", "pattern_angle": "pattern_angle_deg"}
SEEN = 3.0
"""Largest SNR at which it is asked whether an ideal detector would see the effect."""
RANGES = {"drive_amplitude_V": (0.7, 1.4), "electrode_bias_V": (60.0, 110.0)}
RANGES |= {"quadrature_V": (-2.0, 2.0), "pattern_angle_deg": (0.0, 80.0)}


def draw_profile(rng, path, commanded):
    """Write one chamber programme with held levels and ramps, and its commanded drives."""
    levels = rng.uniform(-20.0, 45.0, int(rng.integers(2, 5)))
    time_s, temperature = [0.0], [20.0]
    for level in levels:
        ramp = abs(level - temperature[-1]) / rng.uniform(0.3, 2.0) * 60.0
        for length in (max(ramp, 60.0), rng.uniform(2400.0, 7200.0)):
            time_s.append(time_s[-1] + length)
            temperature.append(level)
    fine = np.arange(0.0, time_s[-1], 60.0)
    columns = {"time_s": fine, "chamber_temperature_degC": np.interp(fine, time_s, temperature)}
    for name in commanded:
        held = rng.uniform(*RANGES[name], 40)
        columns[name] = held[np.searchsorted(np.cumsum(rng.uniform(1200, 4000, 40)), fine) % 40]
    np.savetxt(path, np.stack(list(columns.values()), 1), "%.4f", ",", header=",".join(columns), comments="")


def run(card, drives, seed, noise=True):
    """Return the virtual gyro's records of a campaign; its card may hold one effect, which acts in the campaign's time."""
    records = []
    for k, drive in enumerate(drives):
        found = simulate_run(within(card, k), drive, seed=seed + k, noise=noise)
        records.append(replace(found.record, path=f"run{k}.csv"))
    return records


def one_after_the_other(profiles):
    """Return the drives of a campaign whose records do not say when they start."""
    drives, start = [], 0.0
    for path in profiles:
        drive = load_drive(str(path), rate=RATE)
        if isinstance(drive, Profile):
            drive = drive_by_profile(drive, rows_of(drive, RATE))
        drives.append(replace(drive, start=start))
        start += drive.time[-1] - drive.time[0]
    return drives


def within(card, k):
    """Return the card as it is in run `k`: a virtual gyro knows one run, and a jump is in one of them."""
    table = card.content.get("effect", [{}])[0]
    if "run" not in table or table["run"] == k:
        return card.with_table("effect", [table | {"run": 0.0}]) if "run" in table else card
    stayed = k > table["run"] and table["stays_in_later_runs"]
    return card.with_table("effect", [table | {"run": 0.0, "time_s": 0.0}] if stayed else [])


def means(values):
    """Means over 120 s."""
    return values[: len(values) // MEAN * MEAN].reshape(-1, MEAN).mean(axis=1)


def left(records, parts, response):
    """What a static law, a lag, initial states and offsets leave of parts given run by run."""
    rows = []
    for k, record in enumerate(records):
        x = means(record["resonator_temperature_degC"]) / 30.0
        t = means(record["time_s"])
        own = [x, x**2, np.gradient(x), np.gradient(x) * x, *([x**3] if response == "bias_deg_per_h" else [])]
        starts = np.zeros((x.size, 2 * len(records)))
        starts[:, k] = 1.0
        starts[:, len(records) + k] = np.exp(-t / 1500.0)
        rows.append(np.concatenate([np.stack(own, 1), starts], axis=1))
    basis = np.linalg.qr(np.concatenate(rows))[0]
    target = np.concatenate([means(part) for part in parts])
    return float(np.sqrt(np.mean((target - basis @ (basis.T @ target)) ** 2)))


def draw_effect(rng, name, response, span):
    """Draw shape and coefficients of an effect."""
    effect = library()[name]
    grid = list(effect.grid(span, response))
    shape = list(grid[int(rng.integers(len(grid)))])
    for k, p in enumerate(effect.shape):
        if p.logarithmic and not p.steady:
            shape[k] = float(np.clip(shape[k] * np.exp(0.15 * rng.standard_normal()), p.low, p.high))
    values = rng.standard_normal(effect.spread.size) * effect.spread
    values[0] = abs(values[0]) + 0.5 * effect.spread[0]
    return shape, values


def entry(name, response, shape, values):
    """The `[[effect]]` table."""
    effect = library()[name]
    table = {"name": name, "response": response}
    table |= {p.name: float(v) for p, v in zip(effect.shape, shape, strict=True)}
    if effect.sees_heat:  # the temperature is solved for with the heat that takes this way
        table[effect.shape[0].name] = float(values[0])
    return table | effect.numbers(values, response)


def hide(card, hidden, drives, seed, rng):
    """Return a card with an effect (name, response) of some SNR in it, its coefficients, and the level of the response."""
    (name, response, snr), effect = hidden, library()[hidden[0]]
    clean = run(card, drives, seed, False)
    noisy = run(card, drives, seed)
    noise = left(clean, [n[response] - c[response] for n, c in zip(noisy, clean, strict=True)], response)
    problem = build_problem(card, noisy, housing=False)
    shape, values = draw_effect(rng, name, response, Signatures.at(problem, np.zeros(problem.count)).span)
    level = abs(float(np.median(clean[0][response]))) if response != "bias_deg_per_h" and not effect.thermal else 1.0
    values = values * effect.sizes[response] * level * 0.03

    def hiding(values):
        return card.with_table("effect", [entry(name, response, shape, values)])

    for _ in range(2):
        values = np.minimum(values, 1.0) if effect.sees_heat else values  # all of the heat at most
        there = run(hiding(values), drives, seed, False)
        size = left(clean, [a[response] - c[response] for a, c in zip(there, clean, strict=True)], response) / noise
        values = values * snr / max(size, 1e-9)
    return hiding(values), values, level


@dataclass(frozen=True)
class Case:
    """A card, the device that hides an effect from it, and how both are driven; `name` is empty where nothing is hidden."""

    card: Instrument
    device: Instrument
    drives: list
    seed: int
    name: str = ""
    response: str = ""
    snr: float = 0.0


def make_case(seed):
    """Return a case."""
    rng = np.random.default_rng(seed)
    card = load_card(CARDS[int(rng.integers(len(CARDS)))])
    acting = [(name, r) for name, effect in library().items() for r in effect.sizes if name != "clock-offset"]
    name, response = acting[int(rng.integers(len(acting)))]
    effect, snr = library()[name], SNRS[int(rng.integers(len(SNRS)))]
    hidden = seed % 4 != 0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        profiles = [folder / f"profile{k}.csv" for k in range(int(rng.integers(1, 5)))]
        for path in profiles:
            draw_profile(rng, path, [DRIVES[n] for n in effect.needs] if hidden else [])
        drives = one_after_the_other(profiles)
    if not hidden:
        return Case(card, card, drives, seed)
    device, values, level = hide(card, (name, response, snr), drives, seed, rng)
    if abs(values[0]) > STRONGEST * effect.sizes[response] * level * effect.spread[0]:
        raise InputError(f"{name}: no gyro shows what SNR {snr:g} would take in {card.name}")
    if effect.sees_heat and values[0] > 1.0:
        raise InputError(f"{name}: even if all heat took this way it would not reach SNR {snr:g} in {card.name}")
    return Case(card, device, drives, seed, name, response, snr)


def ceiling(seed):
    """Return the mean log likelihood ratio of a detector that knows form and noise, but the card's values no better than the card."""
    made = make_case(seed)
    problem = build_problem(made.card, run(made.card, made.drives, seed), housing=False)
    state = problem.evaluate(np.zeros(problem.count))
    linear = Linear(problem, problem.rows, state.residual, state.slope)
    there, bare = (run(card, made.drives, seed, False) for card in (made.device, made.card))
    signals = {name: [] for name in problem.responses}
    for part in problem.parts:
        time, one, two = there[part.run]["time_s"], there[part.run], bare[part.run]
        for name in part.responses:
            on_rows = np.interp(part.drive.time, time, one[name] - two[name])
            signals[name].append(problem.runs[part.run].responses[name].average(on_rows))
    noise = {name: noise_of(made.card, name, made.drives) for name in problem.responses}
    stacked = {name: np.concatenate(own)[:, None] for name, own in signals.items()}
    return float(Background(linear, (), noise).left_of(stacked)[1][0]) / 2


def noise_of(card, response, drives):
    """Return the noise of a response of the virtual gyro: as the card states it, and for 1/Q white, as it is found."""
    if response != "inverse_q":
        return (bias_noise if response == "bias_deg_per_h" else frequency_noise)(card.noise)
    quiet, noisy = (run(card, drives[:1], 0, noise)[0][response] for noise in (False, True))
    return Noise(white=float(np.std(noisy - quiet)) / np.sqrt(RATE))
