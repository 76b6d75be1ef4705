"""The CVG cross-damping paper's compensation on a virtual gyro: figures 1 and 2, and what sets the improvement.

The paper prints the shape of ζ₁₂(T), two figures without their data and "approximately 8 times". The twin takes the
printed shape and typical values for all else; none of them was chosen to arrive at 8.
"""

from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from compensation.arrays import Array
from compensation.cross_damping import RestRun, evaluate_cross_damping, fit_cross_damping, simulate_bias
from compensation.improvement import Change, compare_outputs
from compensation.transfer import TransferFunction
from shell.constants import zero_Celsius
from studies.fits.cross_damping import CrossDampingStudy, study_cross_damping

DEG_PER_H = np.pi / 180 / 3600
CALIBRATION = 293.15
FREQUENCY, QUALITY = 5000.0, 10_000.0  # a metal cylinder of a few centimetres (Hz, 1): assumed
K, ZETA = 2 * np.pi * FREQUENCY, 1 / (2 * QUALITY)
BIAS_AT_CALIBRATION = 40.0  # scale that the printed shape is given (°/h): assumed; over −40…60 °C it makes 4…290 °/h
RANDOM_WALK, WANDER = 0.05, 2.0
"""White noise of the rate (°/√h) and random walk of the bias (°/h per √h): assumed, typical of tactical grade."""
LAG = 300.0
"""Lag (s) of the resonator behind the temperature sensor: assumed; conduction in a silica shell and stem takes 700 to 1500 s, metal conducts better."""
STEP = 10.0
LAGS = (0.0, 60.0, 300.0, 900.0)
NOISES = (0.05, 0.5, 5.0)
PRINTED_IMPROVEMENT = 8.0


def read_shape() -> Array:
    """Return the printed coefficients of eq. (10), constant first."""
    text = (files("studies.papers") / "cvg_cross_damping.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in text.splitlines() if line and line[0].isdigit()]
    return np.array([float(row[1]) for row in rows])


def make_profile(soak_h: float = 1.0, slope_K_per_min: float = 1.0) -> tuple[Array, Array]:
    """Return times (s) and chamber temperatures (K) of a cycle 20 → 60 → −40 → 20 °C with soaks.

    The paper's figure 1 is a picture only; this is a usual chamber cycle and not its copy.
    """
    corners_degC = [20.0, 60.0, -40.0, 20.0]
    time, temperature = [0.0], [corners_degC[0]]
    for corner in corners_degC:
        ramp = abs(corner - temperature[-1]) / slope_K_per_min * 60
        time += [time[-1] + ramp, time[-1] + ramp + soak_h * 3600]
        temperature += [corner, corner]
    at = np.arange(0.0, time[-1], STEP)
    return at, np.interp(at, time, temperature) + zero_Celsius


def simulate_rest(
    generator: np.random.Generator, *, lag: float = LAG, random_walk: float = RANDOM_WALK, soak_h: float = 1.0
) -> RestRun:
    """Return a virtual zero-rate run: sensed temperature, and the output of a resonator that lags behind it by `lag` (s), with white noise (°/√h)."""
    time, sensed = make_profile(soak_h)
    resonator = sensed
    if lag:
        resonator = TransferFunction((1.0,), (lag, 1.0)).simulate(time, sensed, settled=True)
    coefficients = read_shape() / read_shape()[0] * BIAS_AT_CALIBRATION * DEG_PER_H / K
    zeta12 = evaluate_cross_damping(coefficients, resonator - CALIBRATION)
    rate = simulate_bias(time, zeta12, K, ZETA)
    white = random_walk * 60 / np.sqrt(STEP) * generator.standard_normal(len(time))
    wander = WANDER * np.sqrt(STEP / 3600) * np.cumsum(generator.standard_normal(len(time)))
    return RestRun(time, rate + (white + wander) * DEG_PER_H, sensed)


@dataclass(frozen=True)
class CrossDampingTwin:
    """Calibration on one virtual run and its use on another."""

    study: CrossDampingStudy
    second: RestRun  # with other soaks and other noise
    improvement: Change  # there
    spread: tuple[float, float, float]  # of it over seeds: 5 %, median, 95 %
    lags: tuple[float, ...]  # s
    noises: tuple[float, ...]  # °/√h
    table: Array  # median improvement by lag (rows) and noise (columns), on runs that were not fitted


def reproduce_cross_damping(seeds: int = 20) -> CrossDampingTwin:
    """Return the twin of figures 1 and 2, its spread over seeds, and the improvement over lag and noise."""
    first, second = _draw_runs(0, LAG, RANDOM_WALK)
    study = study_cross_damping([first], k=K, zeta=ZETA, calibration_temperature=CALIBRATION)
    low, middle, high = np.percentile([_improve(seed, LAG, RANDOM_WALK).ratio for seed in range(seeds)], [5, 50, 95])
    few = range(max(seeds // 4, 3))
    table = [[np.median([_improve(seed, lag, noise).ratio for seed in few]) for noise in NOISES] for lag in LAGS]
    spread = (float(low), float(middle), float(high))
    return CrossDampingTwin(study, second, _improve(0, LAG, RANDOM_WALK), spread, LAGS, NOISES, np.array(table))


def _draw_runs(seed: int, lag: float, random_walk: float) -> tuple[RestRun, RestRun]:
    """A run to calibrate on, and a later one with shorter soaks to use the model on."""
    generator = np.random.default_rng(seed)
    first = simulate_rest(generator, lag=lag, random_walk=random_walk)
    return first, simulate_rest(generator, lag=lag, random_walk=random_walk, soak_h=0.5)


def _improve(seed: int, lag: float, random_walk: float) -> Change:
    first, second = _draw_runs(seed, lag, random_walk)
    model = fit_cross_damping([first], k=K, zeta=ZETA, calibration_temperature=CALIBRATION)
    after = model.compensate(second.time, second.rate, second.temperature)
    return compare_outputs([second.time], [second.rate], [after]).rows


def count_bias_of_printed_values(carrier: float = FREQUENCY) -> float:
    """Return the bias (rad/s) that the printed ζ₀ would mean as it stands, 2k/g₂ ζ₀: why it is shape only."""
    return float(2 * np.pi * carrier * read_shape()[0])
