"""What the lines above a table, and its column names, say in words: a nominal frequency, the time between rows."""

import re
from collections.abc import Sequence

HZ = {"": 1.0, "k": 1e3, "m": 1e6}
SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0}
NUMBER = r"(\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)"
NOMINAL = re.compile(rf"(?:nominal|nenn|\bf_?0\b|reference|centre|center)[^\d\n]{{0,30}}{NUMBER}\s*(k|m|)hz\b")
PERIOD = re.compile(
    rf"(?:sampl\w*|abtast\w*|log\w*|interval\w*|period\w*|\bdt\b)[^\d\n]{{0,30}}{NUMBER}\s*(s|ms|min)(?:ec\w*)?\b(?!\s*\^?-1)"
)
RATE = re.compile(rf"(?:sampl\w*|abtast\w*|log\w*|rate)[^\d\n]{{0,30}}{NUMBER}\s*(k|)hz\b")


def find_nominal(lines: Sequence[str]) -> float | None:
    """Return the nominal frequency (Hz) that a line states, such as "f nominal = 4546 Hz"; None where none does."""
    found = _first(NOMINAL, lines)
    return found and found[0] * HZ[found[1]]


def find_period(lines: Sequence[str]) -> float | None:
    """Return the seconds between rows that a line states, such as "sample period 10 s" or "sampling rate: 50 Hz"."""
    if found := _first(PERIOD, lines):
        return found[0] * SECONDS[found[1]]
    if (found := _first(RATE, lines)) and found[0] > 0:
        return 1 / (found[0] * HZ[found[1]])
    return None


def _first(pattern: "re.Pattern[str]", lines: Sequence[str]) -> tuple[float, str] | None:
    for line in lines:
        if found := pattern.search(line.lower()):
            return float(found[1].replace(",", ".")), found[2]
    return None
