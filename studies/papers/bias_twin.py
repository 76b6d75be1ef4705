"""Twins of the run behind HRG paper figure 6: virtual gyros cooled from room temperature to −20 °C, many of them.

The paper fits its bias model to one run and reports that run's improvement, 3.0143 → 0.5848 °/h. Here the truth is known
and can be repeated: each gyro is cooled, warmed and cooled again for fitting, and then cooled and warmed once more for the
judgement that the paper lacks. Gyros are drawn from typical values; nothing is tuned to the paper's figures.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from compensation.bias import BiasRun, prepare_run
from compensation.bias_selection import HeldOutRows, Method, bias_stability, fit_bias, score_runs
from studies.instrument.card import load_card
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run

if TYPE_CHECKING:
    from shell.law import FrequencyLaw

CARD = "hrg-30mm"
COOLING, WARMING = "step 25 -20 5h", "step -20 25 5h"
ROWS_PER_SECOND = 0.1
PAPER_BEFORE, PAPER_AFTER = 3.0143, 0.5848
Trace: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
METHODS: tuple[Method, ...] = ("paper", "guarded")


@dataclass(frozen=True)
class TwinFit:
    """One method, fitted to one or several runs of a gyro, and judged on a new cooling and a new warming run.

    `training` is the bias stability (°/h) of the first cooling run before and after; `trace` that run as figure 6 shows it: time (s),
    bias and what compensation leaves (°/h).
    """

    method: Method
    runs: int
    terms: tuple[str, ...]
    training: tuple[float, float]
    cooling: HeldOutRows
    warming: HeldOutRows
    trace: Trace = field(compare=False)

    @property
    def training_gain(self) -> float:
        """Improvement on the run that was fitted: the only figure that the paper has."""
        return self.training[0] / self.training[1]


@dataclass(frozen=True)
class GyroSpread:
    """Median and the 5 % and 95 % points over the gyros, and the part of them that got worse."""

    low: float
    median: float
    high: float
    worse: float


def draw_tables(generator: np.random.Generator) -> dict[str, Any]:
    """Draw what makes one gyro's bias: tables of a card.

    Damping: Q from 10⁶ to 10⁷ with 1 % of anisotropy at a random azimuth, 1/Q rising by 0.4 % per kelvin with a curvature
    of about 4·10⁻⁵ 1/K². Gradient: 0.2 °/h per kelvin between housing and resonator, some 1000 s apart, through ḟ.
    Hysteresis: a loop about 1 K wide in which the bias moves by 0.1 °/h per kelvin, which no term of eq. (21) describes.
    Noise: 0.01…0.1 °/√h and a flat Allan deviation of 0.03…0.3 °/h, as data sheets of this class. Each size is
    drawn within a factor of two, signs at random.
    """

    def about(value: float) -> float:
        return float(generator.choice([-1, 1]) * value * 2 ** generator.uniform(-1, 1))

    return {
        "loss": {
            "inverse_q": float(10 ** generator.uniform(-7, -6)),
            "slope_per_K": abs(about(4e-3)),
            "curvature_per_K2": about(4e-5) / 2,
        },
        "bias": {
            "damping_anisotropy": abs(about(0.01)),
            "pattern_angle_deg": float(generator.uniform(0, 90)),
            "k4_deg_per_h_s_per_Hz": about(0.2 * 1000 / 0.354),
        },
        "noise": {
            "bias_white_deg_per_rt_h": float(10 ** generator.uniform(-2, -1)),
            "bias_flicker_deg_per_h": float(0.03 * 10 ** generator.uniform(0, 1)),
        },
        "effect": [
            {
                "name": "hysteresis",
                "response": "bias_deg_per_h",
                "half_width_K": abs(about(0.5)),
                "initial_memory": 0.0,
                "loop_deg_per_h_per_K": about(0.1),
            }
        ],
    }


def run_gyro(tables: dict[str, Any], profile: str, seed: int) -> BiasRun:
    """Run a gyro through a profile and decimate its record as `hrg fit bias` does a measured one."""
    instrument = load_card(CARD)
    for name, table in tables.items():
        instrument = instrument.with_table(name, table)
    record = simulate_run(instrument, load_profile(profile), ROWS_PER_SECOND, seed, law=_law()).record
    return prepare_run(record["time_s"], record["frequency_Hz"], record["bias_deg_per_h"])


def study_twin(seed: int) -> tuple[TwinFit, ...]:
    """Draw one gyro; fit both methods to its first cooling run and to three runs; judge on two runs that no fit saw."""
    generator = np.random.default_rng(seed)
    tables = draw_tables(generator)
    profiles = (COOLING, WARMING, COOLING, COOLING, WARMING)
    seeds = generator.integers(0, 2**31, len(profiles))
    runs = [run_gyro(tables, profile, int(s)) for profile, s in zip(profiles, seeds, strict=True)]
    first, cooling, warming = runs[0], runs[3], runs[4]
    fits = []
    for method in METHODS:
        for count in (1, 3):
            fit = fit_bias(runs[:count], method)
            left = fit.left(first)
            training = bias_stability(first), bias_stability(first, left)
            met, warmed = (score_runs(fit, [run], extrapolate=True) for run in (cooling, warming))
            fits.append(TwinFit(method, count, fit.terms, training, met, warmed, (first.time, first.bias, left)))
    return tuple(fits)


def spread(gains: Sequence[float]) -> GyroSpread:
    """Summarise improvements over many gyros."""
    low, median, high = np.percentile(gains, [5, 50, 95]).tolist()
    return GyroSpread(low, median, high, float(np.mean(np.asarray(gains) < 1)))


@cache
def _law() -> "FrequencyLaw":
    return simulate_run(load_card(CARD), load_profile(COOLING), 0.01, noise=False).law
