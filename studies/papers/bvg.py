"""The BVG paper's compensation chain on a virtual gyro, beside its printed claims and what can explain them.

The paper prints coefficients and results but no data. The twin is a gyro whose output the printed coefficients bring
to the applied rate exactly, with white noise and a wandering bias added; nothing was tuned to the printed results.
"""

from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from compensation.arrays import Array
from compensation.bell import BellChain, PolynomialCurve, invert_chain
from compensation.bell_calibration import BellRun, fit_chain
from compensation.fir import design_smoother
from compensation.linearity import measure_nonlinearity
from shell.constants import zero_Celsius
from studies.fits.scale import StepFigures, judge_steps

DEG = float(np.pi / 180)
STEP = 0.1  # output step (s), printed
RANDOM_WALK, WANDER = 2.7821, 20.0
"""White noise (°/√h): the printed random walk before compensation. Random walk of the bias (°/h per √h): assumed."""
LOWEST, HIGHEST, ROOM = -45.0, 55.0, 25.0
SWEEP, DWELL = 10_000.0, 60.0  # length (s) of a temperature sweep at 0.6 °C/min and of one applied rate: assumed
CUTOFF, ORDER = 1.0, 50
PRINTED = {
    "nonlinearity": (0.002, 0.0003),
    "deviation_at_rest": (0.1624, 0.0619),
    "deviation_turning": (0.1663, 0.0638),
    "bias_instability": (20.5, 4.67),
    "random_walk": (2.7821, 0.6982),
}


def read_printed_chain() -> BellChain:
    """Return the chain with the printed coefficients (rough scale 0.0242, as eq. (33) has it), valid everywhere."""
    text = (files("studies.papers") / "bvg_compensation.csv").read_text(encoding="utf-8")
    lines = [line.split(",") for line in text.splitlines() if line and not line.startswith(("#", "quantity"))]
    row = {name: np.array([float(value) for value in values]) for name, *values in lines}

    def curve(coefficients: Array, reference: float) -> PolynomialCurve:
        return PolynomialCurve(coefficients, np.zeros((3, 3)), reference, -np.inf, np.inf)

    return BellChain(
        null=float(row["rough"][0]),
        scale=float(row["rough"][1]) * DEG,
        rough_covariance=np.zeros((2, 2)),
        bias=curve(row["bias"] * DEG, zero_Celsius),
        scale_over_rate=curve(row["scale_over_rate"] * DEG ** np.array([1.0, 0.0, -1.0]), 0.0),
        scale_over_temperature=curve(row["scale_over_temperature"], zero_Celsius),
        taps=np.empty(0),
        sampling=STEP,
    )


def simulate_runs(generator: np.random.Generator, random_walk: float = RANDOM_WALK) -> tuple[BellRun, BellRun, BellRun]:
    """Return virtual runs with so much white noise (°/√h): rates ±360 °/s at 25 °C, rest and 300 °/s over −45…55 °C."""
    gyro = read_printed_chain()
    sweep = (zero_Celsius + np.linspace(LOWEST, HIGHEST, round(SWEEP / STEP))).astype(np.float64)
    plateaus = np.repeat(np.arange(-360.0, 361.0, 40.0) * DEG, round(DWELL / STEP)).astype(np.float64)

    def run(rate: Array, temperature: Array) -> BellRun:
        white = random_walk * 60 / np.sqrt(STEP) * generator.standard_normal(len(rate))
        wander = WANDER * np.sqrt(STEP / 3600) * np.cumsum(generator.standard_normal(len(rate)))
        noise = (white + wander) / 3600 * DEG / gyro.scale
        time = (STEP * np.arange(len(rate))).astype(np.float64)
        return BellRun(time, invert_chain(gyro, rate, temperature) + noise, temperature, rate)

    return (
        run(plateaus, np.full(len(plateaus), zero_Celsius + ROOM)),
        run(np.zeros(len(sweep)), sweep),
        run(np.full(len(sweep), 300 * DEG), sweep),
    )


@dataclass(frozen=True)
class BellTwin:
    """The fitted chain, its figures step by step on the runs fitted and on runs not seen, and the printed claims tested."""

    chain: BellChain
    runs: tuple[BellRun, BellRun, BellRun]
    fitted: list[StepFigures]
    held_out: list[StepFigures]
    claims: "Claims"


def reproduce_bell(seed: int = 0) -> BellTwin:
    """Return the twin for one seed."""
    generator = np.random.default_rng(seed)
    runs, fresh = simulate_runs(generator), simulate_runs(generator)
    chain = fit_chain(*runs, cutoff=CUTOFF, order=ORDER)
    return BellTwin(chain, runs, judge_steps(chain, *runs), judge_steps(chain, *fresh), examine_claims())


@dataclass(frozen=True)
class Claims:
    """What the printed coefficients imply for the printed results."""

    # standard deviations (°/s) of (34), and of (36) at 300 °/s, over −45…55 °C; and those that the printed before and after imply
    bias_deviation: tuple[float, float]
    scale_deviation: tuple[float, float]
    curvature_nonlinearity: float  # that the quadratic term of (35) makes over ±360 °/s
    mapped: tuple[float, float]  # what (35), and (35) with (36) at 25 °C, make of the printed −361.4 °/s
    noise_deviation: float  # (°/s) of samples that are white noise of the printed random walk before the filter
    averaging: tuple[
        tuple[float, float], ...
    ]  # τ (s), factor by which the FIR filter lowers white noise's Allan deviation
    cutoff_for_printed: float  # Hz, with which the order-50 filter lowers it at τ = 1 s by the printed ratio


def examine_claims() -> Claims:
    """Return the printed results computed from the printed coefficients, where that can be done."""
    from scipy.optimize import brentq

    gyro = read_printed_chain()
    sweep = zero_Celsius + np.linspace(LOWEST, HIGHEST, 2001)
    rates = np.linspace(-360, 360, 2001) * DEG
    curved = measure_nonlinearity(rates, gyro.scale_over_rate.value(rates))
    over_rate = float(gyro.scale_over_rate.value(-361.4 * DEG))
    taps = design_smoother(STEP, CUTOFF, ORDER)
    before, after = PRINTED["random_walk"]
    cutoff = brentq(lambda f: reduce_white(design_smoother(STEP, f, ORDER), 10) - before / after, 0.05, 4.0)
    return Claims(
        (float(np.std(gyro.bias.value(sweep))) / DEG, _removed("deviation_at_rest")),
        (float(np.std(gyro.scale_over_temperature.value(sweep))) * 300, _removed("deviation_turning")),
        curved,
        (over_rate / DEG, over_rate * float(gyro.scale_over_temperature.value(zero_Celsius + ROOM)) / DEG),
        float(before / 60 / np.sqrt(STEP)),
        tuple((rows * STEP, reduce_white(taps, rows)) for rows in (1, 10, 100, 1000)),
        float(cutoff),
    )


def reduce_white(taps: Array, rows: int) -> float:
    """Return the factor by which a FIR filter lowers the Allan deviation of white noise over `rows` samples.

    The Allan variance is half the mean square of the difference of neighbouring means, a window (−1…−1, 1…1) on the
    samples; behind the filter the window is convolved with the taps, so the ratio of their lengths is exact.
    """
    window = np.r_[-np.ones(rows), np.ones(rows)]
    return float(np.linalg.norm(window) / np.linalg.norm(np.convolve(window, taps)))


def _removed(name: str) -> float:
    before, after = PRINTED[name]
    return float(np.sqrt(before**2 - after**2))
