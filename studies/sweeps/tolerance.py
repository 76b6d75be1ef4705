"""How many designs meet their requirements, with an interval, and how far the tolerances may reach."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError
from studies.sweeps.keys import DRAWN, Requirement

if TYPE_CHECKING:
    from studies.sweeps.results import Results


@dataclass(frozen=True)
class RequirementLimits:
    """What a requirement asks of a column; an end that is open is infinite."""

    column: str
    low: float
    high: float


@dataclass(frozen=True)
class Yield:
    """The share of designs that meet requirements."""

    limits: tuple[RequirementLimits, ...]
    cases: int  # cases, passed, unknown: numbers of designs; `unknown` are those without a value
    passed: int
    unknown: int
    # low, high: a 90 % interval (Wilson) in which every unknown design counts once as failing and once as passing; None
    # where the designs are no sample, such as a grid
    low: float | None
    high: float | None

    @property
    def share(self) -> float:
        """Passed over those that have a value."""
        return self.passed / max(self.cases - self.unknown, 1)


@dataclass(frozen=True)
class Reach:
    """How far tolerances may reach: the largest part of the box about the nominal design without a failing one; None: none fails."""

    part: float | None
    inside: int


def resolve_limits(results: "Results", requirement: Requirement) -> RequirementLimits:
    """Return the limits of a requirement; without a target they lie about the nominal design's value."""
    place = [column.name for column in results.study.columns].index(requirement.column)
    low, high = requirement.limits(float(results.nominal.values[place]) if results.nominal is not None else np.nan)
    if np.isnan(low):
        raise InputError(f"the nominal design has no {requirement.column}; give the requirement a target.")
    return RequirementLimits(requirement.column, low, high)


def find_yield(results: "Results", requirements: tuple[Requirement, ...]) -> Yield:
    """Return the share of sampled designs that meet all the requirements."""
    from scipy.special import ndtri

    limits = tuple(resolve_limits(results, requirement) for requirement in requirements)
    # rows that are independent draws: of Saltelli's design the first two blocks
    last = 2 * results.study.sampling.cases if results.study.sampling.method == "sensitivity" else len(results)
    n = passed = open_ = 0
    for values in results.pieces([], [limit.column for limit in limits]):
        good, unknown = (one[: last - n] for one in _judge(values, limits))
        n, passed, open_ = n + len(good), passed + int(good.sum()), open_ + int(unknown.sum())
    if results.study.sampling.method not in DRAWN or n == 0:
        return Yield(limits, n, passed, open_, None, None)
    ends = []
    for count, z in ((passed, -ndtri(0.95)), (passed + open_, ndtri(0.95))):  # Wilson's interval
        ends.append((count + z**2 / 2 + z * np.sqrt(count * (n - count) / n + z**2 / 4)) / (n + z**2))
    return Yield(limits, n, passed, open_, float(ends[0]), float(ends[1]))


def find_reach(results: "Results", requirements: "tuple[Requirement, ...]") -> Reach:
    """Return the largest box about the nominal design, in parts of the asked ranges, without a failing design; no value is a failure."""
    limits = tuple(resolve_limits(results, requirement) for requirement in requirements)
    numeric = [p for p in results.study.parameters if not isinstance(p.nominal, str)]
    nominal = np.array([[p.nominal] for p in numeric], dtype=float)
    above, below = (
        np.maximum([[sign * (getattr(p, end) - p.nominal)] for p in numeric], 1e-300)
        for sign, end in ((1, "high"), (-1, "low"))
    )
    part, sound = np.inf, []
    for found in results.pieces([p.name for p in numeric], [limit.column for limit in limits]):
        x, values = np.split(found, [len(numeric)])
        distance = np.max(np.maximum((x - nominal) / above, (nominal - x) / below), axis=0, initial=0.0)
        good, _ = _judge(values, limits)
        part = min(part, float(distance[~good].min(initial=np.inf)))
        sound.append(distance[distance < part])
    if np.isinf(part):
        return Reach(None, len(results))
    return Reach(part, sum(int((one < part).sum()) for one in sound))


def place_limits(values: NDArray[np.float64], nominal: float, low: float, high: float) -> NDArray[np.float64]:
    """How far values lie on the way from the nominal design's to the limit that they go towards: 1 at the limit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        up = np.where(np.isfinite(high), (values - nominal) / (high - nominal), -np.inf)
        down = np.where(np.isfinite(low), (nominal - values) / (nominal - low), -np.inf)
    return np.asarray(np.maximum(up, down))


def _judge(
    values: NDArray[np.float64], limits: tuple[RequirementLimits, ...]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which cases (limits, m) meet all limits, and of which that is unknown: no known value fails, but one lacks."""
    low, high = (np.array([[getattr(limit, end)] for limit in limits]) for end in ("low", "high"))
    inside = (values >= low) & (values <= high)
    fails = (np.isfinite(values) & ~inside).any(axis=0)
    good = inside.all(axis=0)
    return np.asarray(good), np.asarray(~good & ~fails)
