"""Profiles: piecewise linear functions of time with jumps, from arrays or from words.

A chamber profile in words, temperatures in °C, durations as 90s, 30min or 5h (a bare number is seconds), rates in
K/min:

    soak T DURATION                          hold one temperature
    step FROM TO DURATION                    settled at FROM; a jump to TO at once, held for DURATION
    ramp FROM TO RATE                        straight from FROM to TO
    staircase FROM TO STEP HOLD              levels a STEP apart, each held for HOLD, jumps between
    cycle START FIRST SECOND RATE HOLD COUNT COUNT times: ramp to FIRST, hold, ramp to SECOND, hold; back to START
    … then …                                 one after the other; where temperatures differ the profile jumps
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermal.constants import zero_Celsius
from thermal.errors import ThermalError

Points = list[tuple[float, float]]
MOST_REPEATS = 10_000
UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class Profile:
    """A piecewise linear function of time: a boundary's temperature (K) or a source's power (W)."""

    # array (N,), seconds, not decreasing; a time given twice is a jump. The value before a jump at the start is the one
    # at which the network has settled
    time: NDArray[np.float64]
    value: NDArray[np.float64]  # array (N,), temperature in kelvin, or power in watt

    def __post_init__(self) -> None:
        try:
            time, value = np.array(self.time, dtype=float), np.array(self.value, dtype=float)
        except (TypeError, ValueError):
            raise ThermalError("a profile takes numbers: times (s) and as many values.") from None
        if time.ndim != 1 or time.shape != value.shape or time.size < 2:
            raise ThermalError("a profile needs two or more times and as many values.")
        if not (np.isfinite(time).all() and np.isfinite(value).all()):
            row = int(np.flatnonzero(~(np.isfinite(time) & np.isfinite(value)))[0])
            raise ThermalError(f"the profile has a gap: row {row + 1} is not a number.")
        back = np.flatnonzero(np.diff(time) < 0)
        if back.size:
            k = int(back[0])
            raise ThermalError(f"the time runs backwards at row {k + 2} ({time[k]:g} s, then {time[k + 1]:g} s).")
        if np.any(time[2:] == time[:-2]):
            k = int(np.flatnonzero(time[2:] == time[:-2])[0])
            raise ThermalError(f"the profile gives the time {time[k]:g} s three times; a jump needs it twice.")
        if time[-1] == time[0]:
            raise ThermalError("the profile has no duration.")
        time.flags.writeable = value.flags.writeable = False
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "value", value)

    @property
    def start(self) -> float:
        """First time (s)."""
        return float(self.time[0])

    @property
    def end(self) -> float:
        """Last time (s)."""
        return float(self.time[-1])

    @property
    def jumps(self) -> NDArray[np.float64]:
        """Times (s) at which the value jumps."""
        return np.asarray(self.time[1:][np.diff(self.time) == 0])

    def segments(self, time: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Value and slope of the straight piece at each time; at a jump, of the piece after it."""
        time = np.asarray(time, dtype=float)
        if time.size and not (time.min() >= self.start and time.max() <= self.end):
            raise ThermalError(f"the profile covers only {self.start:g} to {self.end:g} s; lengthen it.")
        piece = np.searchsorted(self.time, time, side="right") - 1
        last = self.time.size - 2 if self.time[-1] > self.time[-2] else self.time.size - 3
        inside = np.minimum(piece, last)
        slope = (self.value[inside + 1] - self.value[inside]) / (self.time[inside + 1] - self.time[inside])
        value = self.value[inside] + slope * (time - self.time[inside])
        return np.where(piece > last, self.value[-1], value), slope

    def at(self, time: ArrayLike) -> NDArray[np.float64]:
        """Value at each time (s); at a jump, the value after it."""
        return self.segments(time)[0]

    def require_within(self, low: float, high: float, what: str) -> None:
        """Raise `ThermalError` when a temperature (K) leaves low … high, the range of `what`."""
        outside = np.flatnonzero((self.value < low) | (self.value > high))
        if outside.size:
            k = int(outside[0])
            raise ThermalError(
                f"the profile reaches {self.value[k] - zero_Celsius:.6g} °C at {self.time[k]:g} s, outside {what} ({low - zero_Celsius:.6g} to {high - zero_Celsius:.6g} °C)."
            )


def constant(value: float, duration: float) -> Profile:
    """A profile that keeps one value (K or W) from 0 to `duration` (s)."""
    return Profile(np.array([0.0, duration]), np.array([value, value]))


def parse_profile(words: str) -> Profile:
    """Read a chamber profile from words (see the module); temperatures are °C in the words, K in the result."""
    sentences = [sentence.split() for sentence in re.split(r"\bthen\b", words)]
    points: Points = []
    for sentence in sentences:
        if not sentence:
            raise ThermalError(f"the profile '{words}' has an empty part. {_forms()}")
        kind, *arguments = sentence
        if kind not in FORMS:
            raise ThermalError(f"'{kind}' is not a kind of profile. {_forms()}")
        names, build = FORMS[kind]
        if len(arguments) != len(names):
            durations = " (durations without a space: 5h, 30min, 90s)" if {"DURATION", "HOLD"} & set(names) else ""
            raise ThermalError(f"'{' '.join(sentence)}' has {len(arguments)} value{'s' * (len(arguments) != 1)} after '{kind}', not {len(names)}; write '{kind} {' '.join(names)}'{durations}.")  # fmt: skip
        given = " ".join(sentence)
        values = [_read(name, text, given) for name, text in zip(names, arguments, strict=True)]
        try:
            piece = build(*values)
        except ThermalError as error:
            raise ThermalError(f"'{given}': {error}") from None
        offset = points[-1][0] if points else 0.0
        for time, temperature in piece:
            _append(points, offset + time, temperature)
    time, temperature = np.array(points).T
    return Profile(time, temperature + zero_Celsius)


def _append(points: Points, time: float, temperature: float) -> None:
    """Add a point; of three points at one time keep the first and the last, of equal ones one."""
    if points and points[-1] == (time, temperature):
        return
    if len(points) > 1 and points[-1][0] == points[-2][0] == time:
        points.pop()
    points.append((time, temperature))


def _ramp(before: float, after: float, rate: float) -> Points:
    if before == after:
        raise ThermalError(f"a ramp from {before:g} to {after:g} °C changes nothing; use 'soak'.")
    return [(0.0, before), (60 * abs(after - before) / rate, after)]


def _staircase(before: float, after: float, step: float, hold: float) -> Points:
    span = abs(after - before)
    count = round(min(span / step, 1e9))
    if count == 0 or not math.isclose(count * step, span, rel_tol=1e-9):
        _check_repeats(count, "steps")
        below = int(span / step)
        near = sorted({span / max(part, 1) for part in (below, below + 1)})
        mend = f"take steps of {' or '.join(f'{one:.6g}' for one in near)} K" if span else "use 'soak'"
        raise ThermalError(f"steps of {step:g} K do not lead from {before:g} to {after:g} °C; {mend}.")
    _check_repeats(count, "steps")
    levels = np.linspace(before, after, count + 1)
    return [(hold * (k + end), float(level)) for k, level in enumerate(levels) for end in (0, 1)]


def _cycle(start: float, first: float, second: float, rate: float, hold: float, count: float) -> Points:
    if count != int(count):
        raise ThermalError(f"a cycle is repeated a whole number of times, not {count:g}.")
    _check_repeats(count, "cycles")
    points = [(0.0, start)]
    stops = [(first, hold), (second, hold)] * int(count) + [(start, 0.0)]
    for level, wait in stops:
        time, temperature = points[-1]
        arrival = time + 60 * abs(level - temperature) / rate
        for moment in (arrival, arrival + wait):
            _append(points, moment, level)
    return points


def _check_repeats(count: float, what: str) -> None:
    if count > MOST_REPEATS:
        raise ThermalError(f"a profile has at most {MOST_REPEATS} {what}, not {count:.0f}.")


FORMS: dict[str, tuple[tuple[str, ...], Callable[..., Points]]] = {
    "soak": (("T", "DURATION"), lambda level, duration: [(0.0, level), (duration, level)]),
    "step": (
        ("FROM", "TO", "DURATION"),
        lambda before, after, duration: [(0.0, before), (0.0, after), (duration, after)],
    ),
    "ramp": (("FROM", "TO", "RATE"), _ramp),
    "staircase": (("FROM", "TO", "STEP", "HOLD"), _staircase),
    "cycle": (("START", "FIRST", "SECOND", "RATE", "HOLD", "COUNT"), _cycle),
}
TEMPERATURES = ("T", "FROM", "TO", "START", "FIRST", "SECOND")


def parse_duration(text: str) -> float:
    """Read a duration in words (s), such as 5h, 30min or 90s."""
    return _read("DURATION", text, text)


def _forms() -> str:
    forms = "; ".join(f"{kind} {' '.join(names)}" for kind, (names, _) in FORMS.items())
    return f"A profile is one of: {forms}; joined by 'then'. Example: step 20 -10 5h."


def _read(name: str, text: str, sentence: str) -> float:
    unit = 1.0
    number = text
    if name in ("DURATION", "HOLD"):
        suffix = next((unit for unit in UNITS if text.endswith(unit)), "")
        number, unit = text.removesuffix(suffix), UNITS.get(suffix, 1.0)
    try:
        value = float(number) * unit
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        what = "a duration such as 5h, 30min or 90s" if name in ("DURATION", "HOLD") else "a number"
        raise ThermalError(f"'{sentence}': {name} must be {what}, not '{text}'.")
    if name in TEMPERATURES and value <= -zero_Celsius:
        raise ThermalError(f"'{sentence}': {text} °C is below absolute zero; temperatures are in °C.")
    if name not in TEMPERATURES and value <= 0:
        spelled = {"RATE": " (K/min)", "STEP": " (K)", "COUNT": ""}.get(name, " (5h, 30min or 90s)")
        raise ThermalError(f"'{sentence}': {name}{spelled} must be positive, not {text}.")
    return value
