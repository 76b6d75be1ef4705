"""Runs that could come next: chamber programmes in words over the covered range, drives stepped where they help."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.calibration.observed import ObservedRun
from studies.planning.chamber import Chamber, limited
from studies.simulation.drive import COMMANDS
from thermal.profile import Profile, parse_profile

NARROW, WIDENED = 5.0, 15.0
"""A campaign that covers less than this, K, is widened by so much on both sides."""
SHORTEST, LONGEST = 3600.0, 16 * 3600.0
DURATIONS = (1.0, 0.5, 0.25)
"""Lengths of the runs that are considered, in parts of the longest recorded one."""
LEVELS = (0.5, 1.0, 0.0, 0.75, 0.25, 0.9)
"""Order of the levels of a stepped drive, from the lowest (0) to the highest (1)."""
HOLDS = {"voltage_squared": 5, "amplitude_squared": 7, "quadrature": 6, "pattern_angle": 4}
"""Steps of each drive in a run: different numbers, so that no two drives step together."""
RANDOM_HOLDS = (0.1, 0.18, 0.08, 0.2, 0.12, 0.17, 0.15)
BY_INPUT = {"temperature": "staircase both ways", "rate": "two rates", "history": "steps and soaks", "voltage": "quiet"}
"""Kind of run that varies one input alone."""


@dataclass(frozen=True)
class Steps:
    """Levels that a drive takes one after the other, in the unit of its column, each for `hold_min` minutes."""

    levels: tuple[float, ...]
    hold_min: int

    def at(self, time: Array) -> Array:
        """Return the levels at times (s)."""
        index = np.minimum((time / (60.0 * self.hold_min)).astype(int), len(self.levels) - 1)
        return np.asarray(np.array(self.levels, dtype=np.float64)[index])


@dataclass(frozen=True)
class Programme:
    """One possible run."""

    kind: str  # "repeat", or the name in the family
    profile: str  # in words, as `hrg simulate` takes them, or "repeat of FILE"
    chamber: Profile  # Profile, K
    steady: Mapping[str, float] = field(default_factory=dict)  # column -> value of the drives that stand still
    drives: Mapping[str, Steps] = field(default_factory=dict)  # column -> Steps
    repeats: ObservedRun | None = None  # the recorded run that it is once more

    @property
    def hours(self) -> float:
        """How long it takes the chamber."""
        return float(self.chamber.end - self.chamber.start) / 3600.0

    @property
    def name(self) -> str:
        """What to run, for people."""
        stepped = ", ".join(
            f"{c} stepped between {min(s.levels):g} and {max(s.levels):g}" for c, s in self.drives.items()
        )
        profile = f"a {self.profile}" if self.repeats else f"`{self.profile}`"
        return f"{profile} with {stepped}" if stepped else profile


@dataclass(frozen=True)
class NextRun:
    """One suggested run."""

    profile: str  # in words, as `hrg simulate` takes them, or "repeat of FILE"
    drives: Mapping[str, Steps]  # column -> Steps
    hours: float  # chamber time
    # time_h, temperature_degC: arrays, the profile, for pictures
    time_h: Array
    temperature_degC: Array
    # expected_evidence, repeat_evidence: what would separate the two after this run, and after the best repeat of a
    # recorded run
    expected_evidence: float | None = None
    repeat_evidence: float | None = None
    # the two, "nothing" for a cause against none; None for a run that looks again or sharpens
    separates: tuple[str, str] | None = None
    narrows: float | None = None  # width of the interval of the causes after this run over today's

    @classmethod
    def of(cls, programme: Programme, **told: Any) -> "NextRun":
        """Suggest a candidate."""
        time, value = programme.chamber.time, programme.chamber.value
        return cls(programme.profile, programme.drives, programme.hours, time / 3600.0, value - zero_Celsius, **told)

    def as_dict(self) -> dict[str, Any]:
        """Return the object `next_run` of the contract."""
        return {
            "profile": self.profile,
            "drives": {c: {"levels": list(s.levels), "hold_min": s.hold_min} for c, s in self.drives.items()},
            "expected_evidence": self.expected_evidence,
            "repeat_evidence": self.repeat_evidence,
            "separates": None if self.separates is None else list(self.separates),
            "narrows": self.narrows,
            "hours": self.hours,
        }


def words_of(low: float, high: float, duration: float) -> dict[str, str]:
    """Return a family of chamber profiles (stairs, ramps, cycles, steps, quiet) between two temperatures, °C, of about one duration, s."""
    middle, wide = _short(0.5 * (low + high)), high - low
    fifth, third = _short(np.floor(2.0 * wide) / 10.0), _short(np.floor(10.0 * wide / 3.0) / 10.0)
    top, upper = _short(low + 5.0 * fifth), _short(low + 3.0 * third)
    bottom = _short(low)

    def time(share: float) -> str:
        return f"{max(1, round(duration * share / 60.0))}min"

    def cycle(count: int) -> str:
        rate = _short(2 * count * wide / (0.8 * duration / 60.0), 3)
        return f"cycle {middle} {top} {bottom} {rate} {time(0.1 / count)} {count}"

    fast, slow = _short(wide / (duration / 60.0) * 12.0, 3), _short(wide / (duration / 60.0) * 2.4, 3)
    part = np.random.default_rng(8).permutation(7) / 6.0
    jumps = [f"soak {_short(low + p * wide)} {time(share)}" for p, share in zip(part, RANDOM_HOLDS, strict=True)]
    return {
        "staircase up": f"staircase {bottom} {top} {fifth} {time(1 / 6)}",
        "staircase down": f"staircase {top} {bottom} {fifth} {time(1 / 6)}",
        "staircase both ways": f"staircase {bottom} {upper} {third} {time(1 / 8)}"
        f" then staircase {upper} {bottom} {third} {time(1 / 8)}",
        "two rates": f"soak {bottom} {time(0.1)} then ramp {bottom} {top} {slow} then soak {top} {time(0.12)} then "
        f"ramp {top} {bottom} {fast} then soak {bottom} {time(0.12)} then ramp {bottom} {top} {fast} then soak {top} {time(0.08)}",
        "slow cycle": cycle(1),
        "fast cycles": cycle(3),
        "steps and soaks": f"soak {bottom} {time(0.23)} then soak {top} {time(0.42)} then soak {bottom} {time(0.35)}",
        "cold step and hot step": f"soak {middle} {time(0.1)} then soak {bottom} {time(0.3)} then soak {middle} {time(0.3)}"
        f" then soak {top} {time(0.3)}",
        "random steps": " then ".join(jumps),
        "quiet": f"soak {middle} {time(1.0)}",
    }


def _short(value: float, digits: int = 0) -> float | int:
    """Return a number that is short in words: a tenth of a kelvin, or so many significant digits."""
    rounded = float(f"{value:.{digits}g}") if digits else round(value, 1)
    return int(rounded) if rounded == int(rounded) else rounded


def candidates(runs: Sequence[ObservedRun], chamber: Chamber, stepped: Sequence[str] = ()) -> list[Programme]:
    """Return the runs that could follow recorded ones: their repeats first; of `stepped` drives those that records have are stepped."""
    spans = [float(np.ptp(run.inner.time)) for run in runs]
    duration = float(np.clip(600.0 * round(max(spans) / 600.0), SHORTEST, LONGEST))
    housing = np.concatenate([run.inner.profile.value for run in runs]) - zero_Celsius
    low, high = float(np.ceil(housing.min())), float(np.floor(housing.max()))
    if high - low < NARROW:
        low, high = low - WIDENED, high + WIDENED
    low, high = chamber.within(low, high)
    out = [_repeat(run) for run, span in zip(runs, spans, strict=True) if span >= 0.5 * max(spans)]
    for part in DURATIONS:
        if part * duration < SHORTEST and part < 1.0:
            continue
        steady, steps = _drives(runs, part * duration, stepped)
        for kind, words in words_of(low, high, part * duration).items():
            words = limited(words, chamber.rate)
            out.append(Programme(kind, words, parse_profile(words), steady, steps))
    return out


def _repeat(run: ObservedRun) -> Programme:
    record = run.record
    profile = Profile(run.inner.profile.time - run.inner.profile.time[0], run.inner.profile.value)
    return Programme("repeat", f"repeat of {record.path}", profile, repeats=run)


def _drives(
    runs: Sequence[ObservedRun], duration: float, stepped: Sequence[str]
) -> tuple[dict[str, float], dict[str, Steps]]:
    """Return the mean of each recorded drive that stands still, and the steps of those that move."""
    steady: dict[str, float] = {}
    steps: dict[str, Steps] = {}
    for name, (column, _, _) in COMMANDS.items():
        if not all(name in run.inner.commands for run in runs):
            continue
        recorded = np.concatenate([run.record[column] for run in runs])
        if name not in stepped:
            steady[column] = float(recorded.mean())
            continue
        levels = _levels(recorded, HOLDS[name], angle=name == "pattern_angle")
        steps[column] = Steps(tuple(float(f"{v:.3g}") for v in levels), max(1, round(duration / len(levels) / 60.0)))
    return steady, steps


def _levels(recorded: Array, count: int, angle: bool) -> Array:
    """Levels between the recorded extremes; around a drive that stood still, 20 % (azimuth: 22.5°) up and down."""
    low, high = float(recorded.min()), float(recorded.max())
    if high - low < 0.02 * max(abs(high), abs(low), 1e-12):
        reach = 22.5 if angle else 0.2 * max(abs(high), 1e-12)
        low, high = low - reach, high + reach
    return low + (high - low) * np.resize(np.array(LEVELS), count)
