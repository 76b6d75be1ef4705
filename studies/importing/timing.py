"""Which columns of a raw file tell the time, and how it is written there."""

import datetime
import itertools
import math
import re
from collections.abc import Mapping, Sequence

from studies.importing.look import Look, is_stamp
from studies.importing.mapping import SECONDS
from studies.importing.meaning import find_meanings, find_unit
from studies.importing.notation import find_second

DATES = (
    *("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y"),
    *("%d.%m.%y", "%d/%m/%y", "%m/%d/%y", "%d-%b-%Y", "%d %b %Y", "%d-%b-%y", "%b %d %Y"),
)
CLOCKS = ("%H:%M:%S", "%H:%M:%S.%f", "%H:%M:%S:%f", "%H:%M", "%I:%M:%S %p", "%I:%M %p", "%Hh%Mm%Ss", "%Hh%Mm", "%Hh%M")
STAMPS = (*map(" ".join, itertools.product(DATES, CLOCKS)), "%Y%m%d%H%M%S", *CLOCKS)
TIME_WORDS = (
    r"time|epoch|unix|elapsed|zeit|date|datum|clock|stamp|uhr|^t$|^t\s*[ _/\[(]\s*([mµun]?s|min)\b|^t\s*[/\[(]\s*h\b"
)
UNIX_BY_SIZE = ((1e9, "unix-s"), (1e12, "unix-ms"), (1e15, "unix-us"), (1e18, "unix-ns"))
HOUSING = "housing_temperature_degC"  # whose units no time has
DAY = datetime.timedelta(days=1)
LONGEST_RUN = 1000.0  # days of a file whose times look like Excel's
USUAL_STEP = (1e-3, 3600.0)  # s between rows


def find_time(look: Look, evenly: bool = False) -> tuple[list[str], str, str]:
    """Return the time columns, their format and doubts; `evenly`: the file states its step, and a column that merely rises is no time."""
    names, hints, numbers = look.names, look.hints, look.numbers
    # the head may come again
    cells = {name: [cell for cell in own if cell != name] for name, own in look.columns.items()}
    named = [name for name in names if re.search(TIME_WORDS, name.lower()) and not find_unit(HOUSING, hints[name])]
    named = [name for name in named if name != "T" or "t" not in names]
    stamps = [name for name in names if cells[name] and all(is_stamp(cell) for cell in cells[name] if cell)]
    stamped = [name for name in (named or stamps) if name in stamps][:2]
    if stamped:
        for columns in [stamped, stamped[:1], stamped[1:]] if len(stamped) > 1 else [stamped]:
            form, unsure = _find_stamp(columns, cells)
            if form:
                return list(columns), form, unsure
        return stamped[:1], "iso", "no known form fits; write the pattern"
    meant = find_meanings(hints, numbers)  # a temperature that only rises is no clock
    rising = [name for name in names if _rises(numbers[name]) and name not in meant]
    if not named and (evenly or not rising):
        return [], "", "no column is a time; by how many seconds do the rows lie apart?"
    time = next((name for name in named if name in rising or _rises(numbers[name])), (named or rising)[0])
    unsure = "" if named else "no column is named time; the first increasing one was taken"
    values = numbers[time]
    first = values[0] if values else 0.0
    for size, form in UNIX_BY_SIZE:
        if size <= first < 4 * size:
            return [time], form, unsure
    words = re.findall(r"[^\W\d_]+", hints[time])
    if unit := next(filter(None, map(find_second, reversed(words))), ""):
        return [time], unit, unsure
    if 40000 < first < 60000 and any(value % 1 for value in values) and values[-1] - first < LONGEST_RUN:
        return [time], "excel-days", "the values look like Excel's days"
    return [time], _likely_unit(values), unsure or "the name states no unit; chosen by the step between rows"


def _rises(values: Sequence[float]) -> bool:
    return len(values) > 2 and all(b > a for a, b in itertools.pairwise(values))


def _likely_unit(values: Sequence[float]) -> str:
    """Return s, or ms, us, ns where seconds would put the rows hours apart."""
    steps = sorted(b - a for a, b in itertools.pairwise(values))
    step = steps[len(steps) // 2] if steps else 1.0
    if USUAL_STEP[0] <= step <= USUAL_STEP[1]:
        return "s"
    return min(("s", "ms", "us", "ns"), key=lambda unit: abs(math.log10(max(step, 1e-300) * SECONDS[unit])))


def _find_stamp(columns: Sequence[str], cells: Mapping[str, list[str]]) -> tuple[str, str]:
    text = [stamp for row in zip(*(cells[name] for name in columns), strict=True) if (stamp := " ".join(row).strip())]
    fitting = {
        form: times for form in STAMPS if text and parse_stamps(text[:1], form) and (times := parse_stamps(text, form))
    }
    if not fitting:
        return ("iso", "") if parse_stamps(text, "iso") else ("", "")
    spans = {form: max(times) - min(times) for form, times in fitting.items()}
    best = min(fitting, key=lambda form: spans[form])  # of two dates the one by which the run is shorter
    other = next((f for f in fitting if fitting[f] != fitting[best] and spans[f] < 2 * spans[best] + DAY), "")
    unsure = f"day and month could be exchanged; or '{other}'" if other else ""
    return best, unsure or ("no date: give 'start' to place the run in time" if best in CLOCKS else "")


def parse_stamps(text: Sequence[str], form: str) -> list[datetime.datetime]:
    """Return the times of stamps; none at all where one is not of the form."""
    import pandas as pd

    plain = pd.Series(text, dtype=str).str.replace(",", ".", regex=False)
    try:
        times = pd.to_datetime(plain, format="ISO8601" if form == "iso" else form, errors="coerce", utc=True)
    except ValueError:
        return []
    return [] if times.isna().any() else list(times.dt.tz_localize(None).dt.to_pydatetime())
