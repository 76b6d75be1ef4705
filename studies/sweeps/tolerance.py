"""How many designs meet their requirements, with an interval, and how far values lie on the way to their limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError
from studies.sweeps.keys import DRAWN, Requirement
from studies.sweeps.results import Results

COUNTS = 1e-3  # of a value: an error below it is that of a solve that was asked for so


def tell_doubt(label: str, unit: str, value: float, error: float, limits: Sequence[float]) -> str:
    """Say where the own error of a value, of its theory or its solve, exceeds the distance to the nearest of its limits."""
    near = min(limits, key=lambda limit: abs(limit - value))
    if not error > max(abs(near - value), COUNTS * abs(value)):
        return ""
    unit = "" if unit in ("", "1") else f" {unit}"
    return (
        f"{label}: {value:.6g}{unit}, known to ± {error:.4g}{unit} by its theory and solve; its limit {near:.6g} is {abs(near - value):.3g} away, so that"
        ' it may not be kept. Ask for theory = "solid", or a finer tolerance, in its [[quantity]].'
    )


@dataclass(frozen=True)
class Yield:
    """The share of designs that meet requirements."""

    cases: int  # cases, passed, unknown: numbers of designs; `unknown` are those without a value
    passed: int
    unknown: int
    # low, high: a 90 % interval (Wilson) in which every unknown design counts once as failing and once as passing; None
    # where the designs are no sample, such as a grid
    low: float | None = None
    high: float | None = None

    @property
    def share(self) -> float:
        """Passed over those that have a value."""
        return self.passed / max(self.cases - self.unknown, 1)


def resolve_limits(results: Results, requirement: Requirement) -> tuple[float, float]:
    """Return the limits of a requirement, infinite where open; without a target they lie about the nominal design's value."""
    low, high = requirement.limits(results.numbers[requirement.column]["nominal"])
    if np.isnan(low):
        raise InputError(f"the nominal design has no {requirement.column}; give the requirement a target.")
    return low, high


def find_yield(results: Results, requirements: tuple[Requirement, ...]) -> Yield:
    """Return the share of sampled designs that meet all the requirements; unknown is where no known value fails, but one lacks."""
    from scipy.stats import binomtest

    low, high = np.transpose([resolve_limits(results, requirement) for requirement in requirements])
    # rows that are independent draws: of Saltelli's design the first two blocks
    last = 2 * results.study.sampling.cases if results.study.sampling.method == "sensitivity" else len(results)
    n = passed = unknown = 0
    for found in results.pieces([requirement.column for requirement in requirements]):
        values = found[:, : last - n].T
        inside = (values >= low) & (values <= high)
        good, fails = inside.all(axis=1), (np.isfinite(values) & ~inside).any(axis=1)
        n, passed, unknown = n + len(values), passed + int(good.sum()), unknown + int((~good & ~fails).sum())
    if results.study.sampling.method not in DRAWN or n == 0:
        return Yield(n, passed, unknown)
    worst, best = (binomtest(count, n).proportion_ci(0.9, "wilson") for count in (passed, passed + unknown))
    return Yield(n, passed, unknown, float(worst.low), float(best.high))


def place_limits(values: Array, nominal: float, low: float, high: float) -> Array:
    """How far values lie on the way from the nominal design's to the limit that they go towards: 1 at the limit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        up = np.where(np.isfinite(high), (values - nominal) / (high - nominal), -np.inf)
        down = np.where(np.isfinite(low), (nominal - values) / (nominal - low), -np.inf)
    return np.asarray(np.maximum(up, down))
