"""What a channel of a file is: what reads its values, its unit and its clock, even or of time stamps."""

import datetime
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from compensation.arrays import Array

STEPS = ("dt", "wf_increment", "increment", "sample_period", "sampling_period", "sample_interval", "sampling_interval", "sample_period_s")  # fmt: skip
RATES = ("fs", "sample_rate", "sampling_rate", "samplerate", "sampling_frequency", "sample_rate_hz")
STARTS = ("start", "start_time", "wf_start_time")
UNITS = ("unit", "units", "unit_string")


@dataclass(frozen=True)
class Clock:
    """The clock of channels: `seconds` of rows from one to before another, and when it started; one `key`, the same times."""

    key: str
    seconds: Callable[[int, int], Array] = field(repr=False)
    step: float | None = None
    start: datetime.datetime | None = None


@dataclass(frozen=True)
class Channel:
    """One channel: what reads its values from one row to before another, its clock, or why it cannot be read."""

    group: str
    name: str
    unit: str = ""
    rows: int = 0
    read: Callable[[int, int], Array] = field(default=lambda *_: np.empty(0), repr=False)
    clock: Clock | None = None
    refused: str = ""


def stamp_clock(key: str, read: Callable[[int, int], Any], utc: bool) -> Clock | None:
    """Return the clock of a channel of time stamps; None where the first is missing."""
    first, nanosecond = read(0, 1)[0], np.timedelta64(1, "ns")
    if np.isnat(first):
        return None

    def seconds(begin: int, end: int) -> Array:
        return np.asarray((read(begin, end) - first) / nanosecond * 1e-9, dtype=float)

    return Clock(key, seconds, start=_moment(first, utc))


def even_clock(about: Mapping[str, Any]) -> Clock | None:
    """Return the clock that properties such as dt, wf_increment or sample_rate state."""
    known = {str(name).lower(): value for name, value in about.items()}
    step, rate = (_number(next((known[name] for name in of if name in known), None)) for of in (STEPS, RATES))
    step = step or (1 / rate if rate else None)
    if step is None or not 0 < step < np.inf:
        return None
    start = next(filter(None, (_moment(known.get(name)) for name in STARTS)), None)
    offset = _number(known.get("wf_start_offset")) or 0.0
    return Clock(
        f"{step!r} s from {start} + {offset!r}",
        lambda begin, end: np.asarray(offset + step * np.arange(float(begin), float(end))),
        step,
        start,
    )


def find_unit(about: Mapping[str, Any]) -> str:
    """Return the unit that properties state."""
    known = {str(name).lower(): value for name, value in about.items()}
    found = next((known[name] for name in UNITS if name in known), "")
    return found.decode(errors="replace") if isinstance(found, bytes) else str(found)


def _number(value: Any) -> float | None:
    try:
        return float(np.asarray(value).flat[0])
    except (TypeError, ValueError, IndexError):
        return None


def _moment(value: Any, utc: bool = True) -> datetime.datetime | None:
    """Return the moment of a stamp (numpy's are in UTC or without a zone); None where it is none, or the zero of a clock never set."""
    try:
        if isinstance(value, np.datetime64):
            found = value.astype("datetime64[us]").item()
            found = found.replace(tzinfo=datetime.UTC) if utc else found
        else:
            found = datetime.datetime.fromisoformat(value.decode() if isinstance(value, bytes) else str(value))
    except (ValueError, UnicodeDecodeError, AttributeError, TypeError):
        return None
    return found if found.year >= 1970 else None
